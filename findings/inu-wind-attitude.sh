#!/usr/bin/env bash
# inu 2.5.7 (February 2026), trajectories and inertial navigation: vne_to_rpy() has an argument for the wind, and of the three angles only the yaw gets it. Roll and pitch are the same numbers with the wind, without it and with another one: they
# follow from the velocity over the ground, where an aircraft's follow from that through the air. Flying at 15 m/s into 13 m/s of wind and climbing at 1.5 m/s the nose is at 35 degrees where 9 is right; with the wind from behind at 6.5. In a level
# turn of 25 degrees in 10 m/s the bank varies from 19 to 25.
# And the yaw, the one that has the wind, is multiplied by 1 - exp(-ground speed in m/s), which is there for standing still: an aircraft that hangs at 2 m/s over the ground and flies at 15 through the air has 78 degrees of heading where 90 is
# right, and 156 where 180 is; at 1 m/s 57 and 114. It is not a share towards another heading but towards north.
# Why it matters: attitude from GNSS and a forecast or an estimated wind is the reference for a flight without an attitude, and the truth for simulated sensors: 25 degrees of pitch are 4 m/s^2 of gravity along the nose. In still air all is
# right, which is why a check passes; small aircraft in wind are the case that the argument is for.
# The documentation: "wind: Horizontal velocity vector of wind in meters per second", of a function that estimates "the attitude angles", and "alpha: Angle of attack". Instead: the same function with the velocity through the air,
# vne_to_rpy(vne - wind), without its argument: all three are right then (checked here).
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/v" && "$folder/v/bin/pip" -q install --no-compile inu==2.5.7 r3f==2.2.1 numpy==2.2.6 scipy==1.15.3 matplotlib==3.10.3
MPLCONFIGDIR="$folder" MPLBACKEND=Agg OPENBLAS_NUM_THREADS=1 "$folder/v/bin/python" - <<'PYTHON'
from importlib.metadata import version

import numpy as np
from inu import vne_to_rpy

T, G, ALPHA = 0.02, 9.80665, 0.06
t = np.arange(0, 60, T)

def flight(airspeed, heading, climb, wind):
    """Velocity over the ground and true attitude; the sideslip is zero and the turn coordinated."""
    heading = np.broadcast_to(heading, t.shape)
    level = np.sqrt(airspeed**2 - climb**2)
    air = np.array([level * np.cos(heading), level * np.sin(heading), np.full_like(t, -climb)])
    bank = np.arctan(level * np.gradient(np.unwrap(heading), T) / G)
    true = np.array([bank, np.arcsin(climb / airspeed) + ALPHA * np.cos(bank), heading])
    return air + np.array([wind[0], wind[1], 0.0])[:, None], air, true

def got(velocity, wind=None):
    return vne_to_rpy(velocity, G, T, alpha=ALPHA, wind=None if wind is None else np.array(wind))

middle, degrees = len(t) // 2, lambda a: np.round(np.degrees(a), 1)
print("inu", version("inu"), "- roll, pitch, yaw in degrees")
found = {}
for name, heading, climb, wind in (("still air, east, climbing", 90, 1.5, (0, 0)), ("east into 13 m/s, climbing", 90, 1.5, (0, -13)), ("east with 13 m/s, climbing", 90, 1.5, (0, 13)), ("east into 13 m/s, level", 90, 0, (0, -13)),
                                    ("south into 13 m/s, level", 180, 0, (13, 0)), ("east into 14 m/s, level", 90, 0, (0, -14)), ("south into 14 m/s, level", 180, 0, (14, 0))):
    ground, air, true = flight(15.0, np.radians(heading), climb, wind)
    seen, none, other, through = got(ground, wind), got(ground), got(ground, (-3.0, 7.0)), got(air)
    assert np.array_equal(seen[:2], none[:2]) and np.array_equal(seen[:2], other[:2])
    assert abs(through[:, middle] - true[:, middle]).max() < np.radians(0.2)
    found[name] = np.degrees(seen[:, middle]), np.degrees(true[:, middle])
    print(f"{name:28} inu with the wind {degrees(seen[:, middle])}, with another or none: the same roll and pitch; from the velocity through the air {degrees(through[:, middle])}; true {degrees(true[:, middle])}")
near = lambda name, axis, value, tolerance: abs(found[name][0][axis] - value) < tolerance
assert abs(found["still air, east, climbing"][0] - found["still air, east, climbing"][1]).max() < 0.2
assert near("east into 13 m/s, climbing", 1, 34, 2) and found["east into 13 m/s, climbing"][1][1] < 9.5 and near("east with 13 m/s, climbing", 1, 6.5, 0.5)
assert near("east into 13 m/s, level", 2, 78, 1) and near("south into 13 m/s, level", 2, 156, 1) and near("east into 14 m/s, level", 2, 57, 1) and near("south into 14 m/s, level", 2, 114, 1)

wind = (10.0, 0.0)
ground, air, true = flight(15.0, (0.3 * t + np.pi) % (2 * np.pi) - np.pi, 0.0, wind)
seen, through = got(ground, wind), got(air)
inside = slice(50, -50)
print(f"level turn of {np.degrees(true[0, middle]):.1f} degrees in 10 m/s: inu's roll from {np.degrees(seen[0, inside].min()):.1f} to {np.degrees(seen[0, inside].max()):.1f}, "
      f"from the velocity through the air {np.degrees(through[0, inside].min()):.1f} to {np.degrees(through[0, inside].max()):.1f}")
assert np.degrees(seen[0, inside].min()) < 20 and np.degrees(seen[0, inside].max()) > 24 and np.ptp(through[0, inside]) < 1e-3 and abs(through[0, middle] - true[0, middle]) < 1e-3
PYTHON
