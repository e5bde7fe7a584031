"""Simulates flights of a known model and writes logs with sensor noise. Only the model is code under test."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import greylag

GRAVITY = 9.806
#: Standard deviations of the sensor noise: angles in rad, rates in rad/s, airspeed in m/s, specific force in m/s², velocity
#: in m/s.
NOISE = {"roll": 1e-3, "pitch": 1e-3, "yaw": 1e-3, "p": 2e-3, "q": 2e-3, "r": 2e-3, "airspeed": 0.05, "alpha": 2e-3, "beta": 2e-3,
         "ax": 0.05, "ay": 0.05, "az": 0.05, "vn": 0.05, "ve": 0.05, "vd": 0.05}


def write_model(folder: Path, name: str, effect: str = "") -> Path:
    """Writes the X8 prior, with the text ``effect`` at its end, to the file ``name`` in ``folder``; returns its path."""
    text = greylag.shipped("params/x8/prior.toml").read_text()
    (folder / "airframe.toml").write_text(greylag.shipped("params/x8/airframe.toml").read_text())
    path = folder / name
    path.write_text(text + effect)
    return path


def rotation(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """The rotation matrix from body axes to earth axes (NED) for Euler angles in rad."""
    (sr, sp, sy), (cr, cp, cy) = np.sin([roll, pitch, yaw]), np.cos([roll, pitch, yaw])
    return np.array([
        [cp * cy, sr * sp * cy - cr * sy, cr * sp * cy + sr * sy],
        [cp * sy, sr * sp * sy + cr * cy, cr * sp * sy - sr * cy],
        [-sp, sr * cp, cr * cp],
    ])


def body_velocity(state: np.ndarray) -> np.ndarray:
    """The velocity u, v, w of a state in body axes, m/s."""
    _, _, speed, _, _, _, alpha, beta = state
    return speed * np.array([np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)])


def specific_force(model: greylag.Model, state: np.ndarray, controls: np.ndarray) -> np.ndarray:
    """The specific force at the centre of gravity in body axes, as an ideal accelerometer measures it, m/s²."""
    rate, step = model.derivative(state, controls), 1e-5
    slope = (body_velocity(state + step * rate) - body_velocity(state - step * rate)) / (2 * step)
    down = rotation(state[0], state[1], 0.0).T @ [0.0, 0.0, GRAVITY]
    return slope + np.cross(state[3:6], body_velocity(state)) - down


def fly(model: greylag.Model, path: Path, seconds: float, seed: int) -> Path:
    """Simulates a flight at random attitude setpoints, with multisines on every control, and writes its log to ``path``."""
    random = np.random.default_rng(seed)
    phases = random.uniform(0, 2 * np.pi, (3, 5))
    state, yaw, altitude = model.start.copy(), 0.0, 600.0
    target, rows = np.array([0.0, 0.05]), []
    for k in range(int(seconds * 100)):
        t = 0.01 * k
        if k % 400 == 399:
            target = random.uniform([-0.8, -0.2], [0.8, 0.3])
        sines = np.sin(2 * np.pi * np.outer([1, 1, 0.3], [0.3, 0.7, 1.1, 1.9, 2.7]) * t + phases).mean(axis=1)
        aileron = 0.8 * (target[0] - state[0]) - 0.1 * state[3] + 0.08 * sines[0]
        elevator = -0.8 * (target[1] - state[1]) + 0.1 * state[4] + 0.16 * sines[1] - 0.02
        throttle = 0.35 + 0.6 * target[1] + 0.4 * sines[2]
        controls = np.clip([aileron, elevator, throttle], [-0.5, -0.5, 0.0], [0.5, 0.5, 1.0])
        velocity = rotation(state[0], state[1], yaw) @ body_velocity(state)
        rows.append([t, *state[:2], yaw, *state[3:6], *state[[2, 6, 7]], *specific_force(model, state, controls), *velocity, altitude, *controls])
        roll, pitch, _, _, q, r, *_ = state
        yaw += 0.01 * (q * np.sin(roll) + r * np.cos(roll)) / np.cos(pitch)
        altitude -= 0.01 * velocity[2]
        state = model.step(state, controls).astype(float)
        assert np.isfinite(state).all(), f"the aircraft was lost after {t} s"
    table = np.array(rows)
    table[:, 1:16] += random.normal(0, list(NOISE.values()), (len(table), 15))
    header = ("time_s,roll_rad,pitch_rad,yaw_rad,p_radps,q_radps,r_radps,airspeed_mps,alpha_rad,beta_rad,"
              "ax_mps2,ay_mps2,az_mps2,vn_mps,ve_mps,vd_mps,altitude_m,aileron_rad,elevator_rad,throttle")
    np.savetxt(path, table, delimiter=",", header=header, comments="", fmt="%.6f")
    return path
