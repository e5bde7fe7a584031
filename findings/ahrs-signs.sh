#!/usr/bin/env bash
# AHRS 0.4.0 (PyPI): the estimators of one package do not share a convention. A board at rest, rolled by +20 degrees (forward-right-down), is given to each with what its accelerometer
# measures, the specific force, and with the opposite, gravity. Most take gravity, also where `frame="NED"` is the default, so that a real board reads upside down (-160). FQA takes the specific
# force; AQUA takes neither. With a magnetometer that points north Mahony turns the heading by 90 degrees.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/v" && "$folder/v/bin/pip" -q install AHRS==0.4.0 numpy==2.2.6
"$folder/v/bin/python" - <<'PYTHON'
import numpy as np
from ahrs.filters import AQUA, EKF, FQA, Complementary, Madgwick, Mahony, Tilt
from importlib.metadata import version

roll, dip, n = np.radians(20), np.radians(60), 2000
to_body = np.array([[1, 0, 0], [0, np.cos(roll), np.sin(roll)], [0, -np.sin(roll), np.cos(roll)]])
gravity = np.tile(to_body @ [0, 0, 9.81], (n, 1))
field = np.tile(to_body @ [50 * np.cos(dip), 0, 50 * np.sin(dip)], (n, 1))
still = np.zeros((n, 3))

def angles(q):
    """Roll and yaw of a quaternion (w, x, y, z), degrees."""
    w, x, y, z = q
    of = lambda a, b: round(float(np.degrees(np.arctan2(a, b)))) + 0
    return of(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)), of(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))

print("AHRS", version("AHRS"), "- roll and yaw in degrees, right is 20 and 0")
found = {}
for name, of, gyro, mag in [("Madgwick", Madgwick, True, False), ("Mahony", Mahony, True, False), ("Complementary", Complementary, True, False), ("Tilt", Tilt, False, False),
                            ("EKF", EKF, True, False), ("AQUA", AQUA, False, False), ("FQA", FQA, False, True), ("Mahony + mag", Mahony, True, True)]:
    sensors = {**({"gyr": still} if gyro else {}), **({"mag": field} if mag else {})}
    if of is FQA:
        sensors["mag_ref"] = np.array([np.cos(dip), 0, np.sin(dip)])
    got = [angles(np.atleast_2d(of(acc=acc, **sensors).Q)[-1]) for acc in (-gravity, gravity)]
    found[name] = got
    print(f"{name:14} specific force {got[0]}, gravity {got[1]}, frame {getattr(of(acc=gravity, **sensors), 'frame', 'not an option')}")
assert all(found[k][1] == (20, 0) and found[k][0][0] == -160 for k in ("Madgwick", "Mahony", "Complementary", "Tilt", "EKF"))
assert [r[0] for r in found["AQUA"]] == [160, -20] and found["FQA"][0] == (20, 0) and found["Mahony + mag"][1] == (20, 90)
PYTHON
