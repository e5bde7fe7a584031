#!/usr/bin/env bash
# qsp-orientation 0.1.1 (March 2026), attitude from accelerometer, gyro and magnetometer: Mahony's filter with a magnetometer banks an aircraft that stands level, by half the dip of the Earth's field. In central Europe, with 65 degrees of
# dip, that is 32.5 degrees: of roll where the aircraft looks east or west, of pitch where it looks north or south, and to the other side in the southern hemisphere. The whole measured field is compared with horizontal north, where its
# direction in the Earth's axes belongs: the correction from the magnetometer wants to tilt the horizon until the field lies in it, that from gravity wants it level, both have the same weight, and they meet half-way. At the magnetic equator,
# and in a test with a horizontal field, nothing is seen; elsewhere the integral, which stands for the gyro's bias, comes to rest with the tilt: for the filter all is well.
# The package's Madgwick filter, with the same readings, is level to about a tenth of a degree, as is this one without magnetometer. Nor have the two the same north: Madgwick's is along x, Mahony's along y, and their headings differ by 90
# degrees, of which nothing is said either.
# Why it matters: tilt by magnetometer is what no one looks for, since the usual advice is that it corrects the heading only; a log that is replayed through this filter has a bank that turns into a pitch as the heading turns.
# The documentation: "magnetometer (optional)". Instead: up = world_to_body(q, [0, 0, 1]) before each step, and mag - (mag @ up) * up, the part that is horizontal by the attitude so far, to mahony_update() (checked here); or
# madgwick_update(), or AHRS's filters with what ahrs-signs.sh says of their signs.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/v"
"$folder/v/bin/pip" -q install --no-compile numpy==2.2.6 scipy==1.15.3
"$folder/v/bin/pip" -q install --no-compile --no-deps qsp-orientation==0.1.1
OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 "$folder/v/bin/python" - <<'PYTHON'
from importlib.metadata import version

import numpy as np
from qsp.orientation import madgwick_update, mahony_update, world_to_body
from scipy.spatial.transform import Rotation

DT, SECONDS = 0.01, 60
NORTH = {"mahony": np.array([0.0, 1.0, 0.0]), "madgwick": np.array([1.0, 0.0, 0.0])}        # where each has it; up is z for both

def settle(kind, dip, attitude):
    """A board at rest, held for a minute; the filter begins level."""
    down = np.radians(dip)
    field = 48.0 * (np.cos(down) * NORTH["madgwick" if kind == "madgwick" else "mahony"] - np.sin(down) * np.array([0, 0, 1.0]))
    accel, mag = attitude.inv().apply([0, 0, 9.81]), attitude.inv().apply(field)
    q, integral = np.array([1.0, 0.0, 0.0, 0.0]), None
    for _ in range(int(SECONDS / DT)):
        if kind == "madgwick":
            q = madgwick_update(q, np.zeros(3), accel, dt=DT, mag=mag)
        elif kind == "mahony":
            q, integral = mahony_update(q, np.zeros(3), accel, dt=DT, integral_error=integral, mag=mag)
        elif kind == "mahony without magnetometer":
            q, integral = mahony_update(q, np.zeros(3), accel, dt=DT, integral_error=integral)
        else:
            up = world_to_body(q, [0, 0, 1])
            q, integral = mahony_update(q, np.zeros(3), accel, dt=DT, integral_error=integral, mag=mag - (mag @ up) * up)
    found = Rotation.from_quat(q, scalar_first=True)
    up, true_up = found.inv().apply([0, 0, 1]), attitude.inv().apply([0, 0, 1])
    tilt = np.degrees(np.arctan2(np.linalg.norm(np.cross(up, true_up)), up @ true_up))
    return found.as_euler("ZYX", degrees=True)[::-1], tilt

print("qsp-orientation", version("qsp-orientation"), "- roll, pitch and heading of a board at rest after a minute, and by how much its vertical is wrong")
for true in ((0, 0, 0), (0, 0, 90), (20, 5, 40)):
    attitude = Rotation.from_euler("ZYX", true[::-1], degrees=True)
    for dip in (0, 30, 65, -60):
        for kind in ("mahony", "madgwick", "mahony without magnetometer", "mahony, horizontal part"):
            angles, tilt = settle(kind, dip, attitude)
            print(f"true {true}, dip {dip:3}: {kind:28} {np.round(angles, 1) + 0.0}, vertical {tilt:.2f}")
            if kind == "mahony":
                assert abs(tilt - abs(dip) / 2) < 0.1
            else:
                assert tilt < 0.3 and ("without" in kind or abs((angles[2] - true[2] + 180) % 360 - 180) < 1)
PYTHON
