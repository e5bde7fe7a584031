"""The troposphere of the standard atmosphere (ISO 2533), sea-level pressure as JSBSim has it."""

from compiled import compiled


@compiled
def density(altitude):
    """Density (kg/m3) at a geometric altitude (m)."""
    geopotential = 6356766.0 * altitude / (6356766.0 + altitude)
    temperature = 288.15 - 0.0065 * geopotential
    gas = 8.31432 / 0.0289645
    pressure = 2116.228 * 47.88025898 * (temperature / 288.15) ** (9.80665 / (gas * 0.0065))
    return pressure / (gas * temperature)
