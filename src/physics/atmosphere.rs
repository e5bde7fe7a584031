//! Air density (constant, or that of the standard atmosphere) and constant gravity.

/// Sea-level density of the standard atmosphere (ISO 2533), the reference of equivalent airspeed, kg/m³.
pub const SEA_LEVEL_DENSITY: f64 = 1.225;
/// Standard gravity (ISO 80000-3), the unit g of load factors, m/s².
pub const STANDARD_GRAVITY: f64 = 9.806_65;
/// Effective gravity at middle latitudes, m/s². It is used where no model of the aircraft states the gravity. The value is that
/// of JSBSim at 46.8° latitude and 600 m. Near sea level, gravity at any latitude is within 0.03 m/s² of it.
pub const MIDDLE_GRAVITY: f64 = 9.806;

/// Law of the air density over altitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Density {
    /// Constant density, kg/m³.
    Constant(f64),
    /// Density of the standard atmosphere (ISO 2533) in the troposphere, a function of altitude.
    Standard,
}

/// Density law and gravity of a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Atmosphere {
    /// Law of the air density over altitude.
    pub density: Density,
    /// Effective gravity (gravitation minus the centrifugal acceleration of the Earth's rotation), m/s².
    pub gravity: f64,
}

impl Atmosphere {
    /// The density at `altitude` (m above mean sea level), kg/m³.
    #[inline(always)]
    pub fn density_at(&self, altitude: f64) -> f64 {
        match self.density {
            Density::Constant(rho) => rho,
            Density::Standard => standard_density(altitude),
        }
    }
}

/// Density of the standard atmosphere below 11 km, kg/m³, at geometric `altitude` (m).
///
/// The sea-level pressure is JSBSim's, 2116.228 lbf/ft², which exceeds that of ISO 2533 by 5 parts in a million.
pub fn standard_density(altitude: f64) -> f64 {
    const RADIUS: f64 = 6_356_766.0;
    const LAPSE: f64 = 0.0065;
    const SEA_TEMPERATURE: f64 = 288.15;
    const SEA_PRESSURE: f64 = 2116.228 * 47.880_258_98;
    /// Gas constant of dry air, J/(kg K).
    const GAS: f64 = 8.314_32 / 0.028_964_5;
    const EXPONENT: f64 = STANDARD_GRAVITY / (GAS * LAPSE) - 1.0;
    let geopotential = RADIUS * altitude / (RADIUS + altitude);
    let ratio = 1.0 - LAPSE * geopotential / SEA_TEMPERATURE;
    SEA_PRESSURE / (GAS * SEA_TEMPERATURE) * ratio.max(0.0).powf(EXPONENT)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn standard_atmosphere_at_tabulated_altitudes() {
        // the tables of ISO 2533 have five significant figures
        for (altitude, density) in
            [(0.0, 1.2250), (600.0, 1.1560), (2000.0, 1.0066), (5000.0, 0.73643)]
        {
            let ours = standard_density(altitude);
            assert!((ours / density - 1.0).abs() < 5e-5, "{altitude} m: {ours}");
        }
    }
}
