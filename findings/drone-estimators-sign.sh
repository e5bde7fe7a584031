#!/usr/bin/env bash
# drone-estimators 0.1.0 (October 2026), Kalman filters for drones that are seen by motion capture: a measured quaternion that changes its sign, which is the same attitude, throws the extended filter off for good. Its innovation is the
# difference of two vectors of four numbers, here twice the quaternion, and what remains of it after each correction is taken for a rotation that is still to come. A drone that turns to the left past 90 degrees and stops has
# an estimate that is 87 degrees off and turns at 12 rad/s, seven seconds later as in the third, at a claimed 0.03 rad/s. It is not a jump that decays: prediction and correction balance each other there.
# No sensor has to be at fault: scipy's Rotation.from_matrix(...).as_quat() makes the largest of the four numbers positive, so that the sign changes at a heading of -90 degrees in a turn about the vertical, and libraries that make the real
# part positive change it at 180. Given the same matrices with the sign of the one before, the error is 0.03 degrees (checked here). The unscented filter of the package is hardly moved as long as its commands are exact; with a yaw
# trim of 2 degrees, an error of 1 degree and 0.12 rad/s before, it is 9 degrees off and turns at 1.0 rad/s. The package's DiffFilter, which works on rotations, is right throughout, and so is the position.
# Why it matters: the estimate is what a controller is flown with and what a model of a drone is identified from; a test on one heading passes, and the flight goes wrong where it turns.
# The documentation: "quat: Latest observation of the quaternion"; of its sign nothing. Instead: before correct(), the sign of the estimate: quat if quat @ estimate.quat >= 0 else -quat.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/v"
"$folder/v/bin/pip" -q install --no-compile drone-estimators==0.1.0 crazyflow==0.4.0 jax==0.10.1 flax==0.12.8 mujoco==4.0.0 numpy==2.4.6 scipy==1.17.1
JAX_PLATFORMS=cpu SCIPY_ARRAY_API=1 OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 "$folder/v/bin/python" - 2> "$folder/errors" <<'PYTHON' || { cat "$folder/errors" >&2; exit 1; }
from importlib.metadata import version

import numpy as np
from drone_estimators.estimator_diff import DiffFilter
from drone_estimators.estimator_kalman import KalmanFilter
from drone_estimators.utils.dynamics import dynamics_function
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

DT, MODEL, DRONE = 1 / 200, "so_rpy", "cf2x_L250"
derivatives = dynamics_function(MODEL, DRONE)
still, upright = np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0])

def change(attitude, rate, command, what):
    return np.asarray(derivatives(pos=still, quat=attitude, vel=still, ang_vel=rate, cmd=command)[what])

thrust = brentq(lambda f: change(upright, still, np.array([0, 0, 0, f]), 2)[2], 0.1, 0.8)
# the command of yaw at which the filter's own model stays at a heading: it is linear in both
trimmed = Rotation.from_euler("z", 0.5).as_quat()
by_command = change(upright, still, np.array([0, 0, 1, thrust]), 3)[2]
scale = -change(trimmed, still, np.array([0, 0, 0, thrust]), 3)[2] / 0.5 / by_command

def flight():
    """Hovers at one place; 2 s on a heading of -69 degrees, then turned to -109 within 2 s, with the model that the filters have."""
    attitude, rate = Rotation.from_euler("z", -1.2), still
    for k in range(int(10 / DT) + 1):
        command = np.array([0, 0, scale * (-1.2 - 0.35 * np.clip(k * DT - 2, 0, 2)), thrust])
        yield k * DT, attitude, rate, command
        moment = change(attitude.as_quat(), rate, command, 3)
        attitude, rate = attitude * Rotation.from_rotvec(rate * DT), rate + DT * moment

RECORD = list(flight())

def run(kind, one_sign, trim=0.0):
    rng = np.random.default_rng(0)
    estimator = DiffFilter((0.02, 0.05, 0.1, 0.02, 0.05), jit=False) if kind == "Diff" else KalmanFilter(dt=DT, model=MODEL, config=DRONE, filter_type=kind)
    errors, changes, last, given = [], [], None, None
    for time, attitude, rate, command in RECORD:
        seen = (attitude * Rotation.from_rotvec(rng.normal(0, 0.003, 3))).as_matrix()    # what motion capture has: a matrix, with 0.17 degrees of noise
        quaternion = Rotation.from_matrix(seen).as_quat()
        if last is not None and quaternion @ last < 0:
            if one_sign:
                quaternion = -quaternion
            else:
                changes.append((time, np.degrees(attitude.as_euler("ZYX")[0])))
        last = quaternion
        if given is None:
            estimator.set_state(pos=still, quat=quaternion)
        else:
            estimator.predict(dt=DT) if kind == "Diff" else estimator.predict(dt=DT, command=given + [0, 0, trim, 0])
            e = estimator.correct(pos=rng.normal(0, 3e-4, 3), quat=quaternion)
            errors.append((time, np.degrees((Rotation.from_quat(np.asarray(e.quat)).inv() * attitude).magnitude()), np.linalg.norm(np.asarray(e.ang_vel) - rate), np.linalg.norm(np.asarray(e.pos))))
        given = command
    errors = np.array(errors)
    rms = [np.sqrt((errors[(errors[:, 0] > a) & (errors[:, 0] <= b)][:, 1:]**2).mean(0)) for a, b in ((1, 2), (5, 6), (9, 10))]
    claimed = None if kind == "Diff" else np.sqrt(estimator.data.covariance[12, 12])
    print(f"{kind:4} yaw trim {np.degrees(trim):.0f}, {'sign of the one before' if one_sign else 'as scipy gives it'}: error of the attitude {rms[0][0]:.2f}, {rms[1][0]:.2f}, {rms[2][0]:.2f} degrees in the 2nd, 6th, 10th second; of the rate "
          f"{rms[0][1]:.3f}, {rms[1][1]:.3f}, {rms[2][1]:.3f} rad/s{'' if claimed is None else f', claimed {claimed:.3f}'}; of the position {1000 * rms[2][2]:.2f} mm"
          + "".join(f"; sign changes at {t:.2f} s, heading {h:.1f}" for t, h in changes))
    return rms, claimed, changes

print("drone-estimators", version("drone-estimators"), "scipy", version("scipy"))
for kind in ("EKF", "UKF", "Diff"):
    for trim in (0.0, np.radians(2)) if kind == "UKF" else (0.0,):
        fair, claimed, _ = run(kind, True, trim)
        as_given, _, changes = run(kind, False, trim)
        assert len(changes) == 1 and abs(changes[0][1] + 90) < 2
        assert fair[2][0] < (0.5 if trim == 0 else 1.5) and fair[2][2] < 1e-3 and as_given[2][2] < 1e-3
        if kind == "EKF":
            assert fair[2][0] < 0.1 and fair[2][1] < 0.05 and as_given[1][0] > 60 and abs(as_given[1][0] - as_given[2][0]) < 5 and as_given[2][1] > 100 * claimed
        elif kind == "Diff":
            assert np.allclose(fair, as_given, atol=1e-6)
        elif trim == 0:
            assert as_given[2][0] < 0.5
        else:
            assert as_given[2][0] > 5 * fair[2][0] and as_given[2][1] > 5 * fair[2][1]
PYTHON
