#!/usr/bin/env bash
# RotorPy 3.0.0 (September 2026), a multirotor simulator for research in estimation, its IMU: the place and the orientation at which it is mounted, R_BS and p_BS, are half accounted for. The accelerometer is turned into the sensor's axes
# and the gyro is not: an IMU that is mounted a quarter turn to the side measures forces in its own axes and rates in the aircraft's, so that a roll shows in one as a roll and in the other as a pitch. With both at the centre and along the
# axes, which is the default, all is right to the last digits.
# The lever arm is turned into the world's axes, and is multiplied there by the rate and the angular acceleration in the aircraft's, as the state and statedot() of the package give them. Flying north, as examples do, the two are nearly
# the same. With an IMU 10 cm before and 5 cm above the centre, on one flight turned by its heading, the accelerometer is wrong by 1.3 m/s^2 to the north, 10 to the side, and 22 to the south, of at most 11 that the lever arm makes: there
# its sign is turned.
# Why it matters: the offset and the turned mounting are put into a simulation to show that an estimator, or a calibration between camera and IMU, copes with them. The data are those of no rigid body: the calibration finds a rotation between
# gyro and accelerometer, and the estimator is tuned until it bears it.
# The documentation: "R_BS, the rotation matrix of sensor frame S in body frame B"; state w "in LOCAL frame!", wdot "in world frame", which statedot() does not give. Instead: Imu() at the centre without noise, and the sensor of your own:
# R_BS.T @ w, and R_BS.T @ (accel + cross(wdot, p) + cross(w, cross(w, p))), all in the aircraft's axes; then bias and noise.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/v"
"$folder/v/bin/pip" -q install --no-compile numpy==2.2.6 scipy==1.15.3
"$folder/v/bin/pip" -q install --no-compile --no-deps rotorpy==3.0.0
OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 "$folder/v/bin/python" - <<'PYTHON'
from importlib.metadata import version

import numpy as np
from rotorpy.controllers.quadrotor_control import SE3Control
from rotorpy.sensors.imu import Imu
from rotorpy.vehicles.hummingbird_params import quad_params
from rotorpy.vehicles.multirotor import Multirotor
from scipy.spatial.transform import Rotation

H, GRAVITY = 1e-4, np.array([0, 0, -9.81])
ARM = np.array([0.1, 0, 0.05])
SIDEWAYS = Rotation.from_euler("z", 90, degrees=True).as_matrix()

def none(value):
    return {key: np.asarray(value) for key in ("initial_bias", "noise_density", "random_walk")}

def sensor_truth(states, mounting, arm):
    """From three states H apart: the velocity of the sensor's point and the turn of its axes, differentiated, at the middle one."""
    def velocity(s):
        return s["v"] + Rotation.from_quat(s["q"]).apply(np.cross(s["w"], arm))
    axes = [Rotation.from_quat(s["q"]) * Rotation.from_matrix(mounting) for s in states]
    acceleration = (velocity(states[2]) - velocity(states[0])) / (2 * H)
    return axes[1].inv().apply(acceleration - GRAVITY), (axes[0].inv() * axes[2]).as_rotvec() / (2 * H)

def fly(heading, mounting, arm):
    """One second towards a place 2 m ahead and 1 m to the side, from a start at rest; the same flight, turned by the heading."""
    turn = Rotation.from_euler("z", heading, degrees=True)
    vehicle, controller = Multirotor({**quad_params, "motor_noise_std": 0.0}), SE3Control(quad_params)
    imu = Imu(none([0.0] * 3), none([0.0] * 3), R_BS=mounting, p_BS=arm)
    centre = Imu(none([0.0] * 3), none([0.0] * 3))
    hover = np.sqrt(quad_params["mass"] * 9.81 / 4 / quad_params["k_eta"])
    state = {"x": np.zeros(3), "v": np.zeros(3), "q": turn.as_quat(), "w": np.zeros(3), "wind": np.zeros(3), "rotor_speeds": np.full(4, hover)}
    goal = {"x": turn.apply([2.0, 1.0, 0.5]), "yaw": np.radians(heading), "yaw_dot": 0.0, "yaw_ddot": 0.0}
    goal.update({key: np.zeros(3) for key in ("x_dot", "x_ddot", "x_dddot", "x_ddddot")})
    rows = []
    for k in range(100):
        control = controller.update(k * 0.01, state, goal)
        states = [state]
        for _ in range(2):
            states.append(vehicle.step(dict(states[-1]), control, H))
        change = vehicle.statedot(states[1], control, H)
        read, central = (i.measurement(states[1], change, with_noise=False) for i in (imu, centre))
        force, rate = sensor_truth(states, mounting, arm)
        w = states[1]["w"]
        instead = mounting.T @ (central["accel"] + np.cross(change["wdot"], arm) + np.cross(w, np.cross(w, arm)))
        assert np.allclose(instead, force, atol=0.02) and np.allclose(mounting.T @ w, rate, atol=0.01)
        share = force - sensor_truth(states, mounting, np.zeros(3))[0]
        rows.append(np.r_[read["accel"] - force, read["gyro"] - rate, share, rate])
        state = vehicle.step(states[2], control, 0.01 - 2 * H)
    rows = np.abs(np.array(rows))
    return rows[:, :3].max(), rows[:, 3:6].max(), rows[:, 6:9].max(), rows[:, 9:].max()

print("RotorPy", version("rotorpy"), "- largest error of a second of flight against the sensor's own motion, differentiated")
found = {}
for label, heading, mounting, arm in (("at the centre, heading 0", 0, np.eye(3), np.zeros(3)), ("at the centre, heading 90", 90, np.eye(3), np.zeros(3)),
                                      ("turned to the side", 0, SIDEWAYS, np.zeros(3)), ("10 cm ahead, heading 0", 0, np.eye(3), ARM),
                                      ("10 cm ahead, heading 90", 90, np.eye(3), ARM), ("10 cm ahead, heading 180", 180, np.eye(3), ARM)):
    found[label] = force, rate, share, true_rate = fly(heading, mounting, arm)
    print(f"{label:25} accelerometer {force:.3f} m/s^2 (the lever arm's whole share {share:.2f}), gyro {rate:.4f} rad/s (largest rate {true_rate:.2f})")
for label in ("at the centre, heading 0", "at the centre, heading 90"):
    assert found[label][0] < 0.02 and found[label][1] < 0.01
north, east, south = (found[f"10 cm ahead, heading {h}"] for h in (0, 90, 180))
assert north[0] > 0.5 and east[0] > 5 * north[0] and south[0] > 1.8 * south[2] and abs(north[2] - south[2]) < 1e-3
assert found["turned to the side"][0] < 0.02 and found["turned to the side"][1] > 0.8 * found["turned to the side"][3]
PYTHON
