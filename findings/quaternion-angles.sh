#!/usr/bin/env bash
# pyquaternion 0.9.9 and AHRS 0.4.0: angles of a given attitude that agree with an autopilot's only while two of the three are zero. To pyquaternion's yaw_pitch_roll an aircraft that flies east with 30 degrees of bank has
# 30 degrees of pitch and none of bank; flying south it banks to the other side; in between there is some of both. Flying north all is right. They are the angles of R = Rx Ry Rz, the reverse of yaw, pitch, roll.
# AHRS reads a quaternion as an autopilot does, and a matrix in none of the ways: DCM(rpy=(roll, pitch, yaw)) turns by the roll about z and by the yaw about x; to_rpy() gives the angles of the reverse order with the
# opposite signs, so that DCM(rpy=a).to_rpy() is not a, and DCM(q=Quaternion(rpy=a)).to_rpy() is neither. Other than the estimators of the package, whose signs differ (ahrs-signs.sh), this concerns its arithmetic.
# Why it matters: bank read as pitch by way of the heading is no constant error that a calibration would find; a test with one angle at a time, or a flight to the north, passes.
# Documentation: pyquaternion says "z-y'-x''", which is an autopilot's order, and two lines below R_x R_y R_z, which is not. AHRS gives the formulas without the order. transforms3d 0.4.2's taitbryan module reads as
# pyquaternion does, and says so ("extrinsic"). Instead: scipy's as_euler("ZYX"), of which the capital letters matter.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/v" && "$folder/v/bin/pip" -q install pyquaternion==0.9.9 AHRS==0.4.0 transforms3d==0.4.2 numpy==2.2.6 scipy==1.15.3
"$folder/v/bin/python" - <<'PYTHON'
from importlib.metadata import version

import numpy as np
import transforms3d
from ahrs import DCM, Quaternion
from pyquaternion import Quaternion as Pyquaternion
from scipy.spatial.transform import Rotation

print(*(f"{name} {version(name)}" for name in ("pyquaternion", "AHRS", "transforms3d")), "- yaw, pitch, roll in degrees")
shown = lambda angles: "(" + ", ".join(f"{a:6.1f}" for a in np.degrees(angles) + 0.0) + ")"
for ypr in ((0, 0, 30), (90, 0, 30), (180, 0, 30), (45, 10, 20), (-90, 10, 20)):
    true = np.radians(ypr)
    attitude = Rotation.from_euler("ZYX", true)
    x, y, z, w = attitude.as_quat()
    q, matrix, reverse = np.array([w, x, y, z]), attitude.as_matrix(), attitude.as_euler("XYZ")[::-1]
    one = Pyquaternion(q).yaw_pitch_roll
    bryan = transforms3d.taitbryan.quat2euler(q)
    other = Quaternion(q).to_angles()[::-1]
    of_matrix = DCM(matrix).to_rpy()[::-1]
    print(f"{shown(true)} pyquaternion {shown(one)} taitbryan {shown(bryan)} AHRS, quaternion {shown(other)} matrix {shown(of_matrix)}")
    assert np.allclose(Pyquaternion(q).rotation_matrix, matrix) and np.allclose(Quaternion(q).to_DCM(), matrix)
    assert np.allclose(one, reverse) and np.allclose(bryan, reverse) and np.allclose(other, true) and np.allclose(of_matrix, -reverse)
east = np.degrees(Pyquaternion(matrix=Rotation.from_euler("ZYX", [90, 0, 30], degrees=True).as_matrix()).yaw_pitch_roll)
assert np.allclose(east, (90, 30, 0), atol=1e-6)

given = np.radians([20, 10, 45])
turned = Rotation.from_matrix(np.array(DCM(rpy=given))).as_euler("ZYX")
meant = Rotation.from_matrix(np.array(Quaternion(rpy=given).to_DCM())).as_euler("ZYX")
print("roll, pitch, yaw", shown(given), "- DCM(rpy) is yaw, pitch, roll", shown(turned), "and Quaternion(rpy) is", shown(meant))
back, by_quaternion = DCM(rpy=given).to_rpy(), DCM(q=np.array(Quaternion(rpy=given))).to_rpy()
print("DCM(rpy).to_rpy()", shown(back), " DCM(q=Quaternion(rpy)).to_rpy()", shown(by_quaternion), " Quaternion(rpy).to_angles()", shown(Quaternion(rpy=given).to_angles()))
assert np.allclose(turned, given) and np.allclose(meant, given[::-1])
assert not np.allclose(back, given, atol=0.5) and not np.allclose(by_quaternion, given, atol=0.4) and np.allclose(Quaternion(rpy=given).to_angles(), given)
PYTHON
