"""Errors of installation and calibration, as real aircraft have them: drawn for an aircraft, the same in all its flights.

Where a sensor errs, the true motion is turned, scaled or delayed before noise and biases are added. A gust is no error
of a sensor; it is drawn here since a flight on a real day has it, and JSBSim flies through it.
"""

import numpy as np

from sensors import GROUPS

NAMED = {
    "tilt": "axes_askew", "gyro_gain": "imu_gain", "force_gain": "imu_gain", "vane_gain": "vane_gain",
    "airspeed_lag": "clock_skew", "velocity_late": "clock_skew",
}  # fmt: skip
"""What `greylag diagnose` calls each error of a sensor."""
SERVO = {
    "servo_sides": ("servo_aileron", "servo_elevator"),
    "servo": ("servo_aileron_curve", "servo_elevator_curve"),
}
"""What it calls a wrong servo of aileron or elevator, an effect on the inputs: one that turns further than recorded on one
side, and one whose gain changes with deflection. The equal gain of `servo` is one of the model's derivatives."""
KINDS = (*NAMED, "frozen", "servo", "gusts", "servo_sides")
"""All errors. Those without a name have none in the program's list."""
LATE = 0.02
"""Delays above this (s) are more than the skew that every log has."""
GUST_TIME = 1.5
"""Correlation time of the gusts, s."""


def drawn(kinds, random):
    """The size of each of `kinds`: angles in rad, gains as shares, times in s."""
    axis, sign = int(random.integers(3)), float(random.choice([-1.0, 1.0]))
    size = {
        "tilt": np.radians(random.uniform(1.0, 3.0)),
        "gyro_gain": random.uniform(0.03, 0.1),
        "force_gain": random.uniform(0.03, 0.1),
        "vane_gain": random.uniform(0.03, 0.1),
        "airspeed_lag": random.uniform(0.05, 0.2),
        "velocity_late": random.uniform(0.05, 0.2),
        "frozen": random.uniform(0.1, 0.3),
        "servo": random.uniform(0.1, 0.3),
        "gusts": random.uniform(0.3, 1.0),
        "servo_sides": random.uniform(0.1, 0.2),
    }
    return {kind: {"size": float(sign * size[kind]) if kind in SIGNED else float(size[kind]), "axis": axis} for kind in kinds}


SIGNED = ("tilt", "gyro_gain", "force_gain", "vane_gain", "servo", "servo_sides")
"""Errors of either sign."""


def name_of(kind, error):
    """What `greylag diagnose` calls an error; None if it has no name."""
    return SERVO[kind][error["axis"] % 2] if kind in SERVO else NAMED.get(kind)


def gusty(wind, gust, steps, period, random):
    """The wind (NED, m/s) at each of `steps` commands: steady, with a gust of the first order of that size (m/s)."""
    kept = np.exp(-period / GUST_TIME)
    gusts = np.zeros((steps, 3))
    for k in range(1, steps):
        gusts[k] = kept * gusts[k - 1] + gust * np.sqrt(1.0 - kept**2) * random.standard_normal(3)
    return wind + gusts


def turned(by, axis):
    """The matrix from body axes to those of a board turned by `by` (rad) about `axis`."""
    c, s = np.cos(by), np.sin(by)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = c
    matrix[i, j], matrix[j, i] = s, -s
    return matrix


def body_to_earth(attitude):
    """The rotation from body axes to NED of each row of roll, pitch, yaw."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(attitude.T), np.cos(attitude.T)
    rows = [
        [cp * cy, sr * sp * cy - cr * sy, cr * sp * cy + sr * sy],
        [cp * sy, sr * sp * sy + cr * cy, cr * sp * sy - sr * cy],
        [-sp, sr * cp, cr * cp],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def angles(matrix):
    """Roll, pitch, yaw of rotations from body axes to NED."""
    roll, pitch = np.arctan2(matrix[:, 2, 1], matrix[:, 2, 2]), -np.arcsin(matrix[:, 2, 0])
    return np.column_stack([roll, pitch, np.arctan2(matrix[:, 1, 0], matrix[:, 0, 0])])


def lagged(values, tau, step):
    """`values` through a lag of the first order."""
    kept, out = np.exp(-step / tau), values.copy()
    for k in range(1, len(out)):
        out[k] = kept * out[k - 1] + (1.0 - kept) * out[k]
    return out


def frozen(names, rows, errors, random):
    """The log's rows with an airspeed that stands still, value and noise, for that share of the seconds."""
    if "frozen" not in errors:
        return rows
    out, column = rows.copy(), names.index("airspeed_mps")
    begin = 0
    while begin < len(out):
        end = int(np.searchsorted(out[:, 0], out[begin, 0] + 1.0))
        if random.random() < errors["frozen"]["size"]:
            out[begin:end, column] = out[begin, column]
        begin = max(end, begin + 1)
    return out


def seen(truth, step, errors):
    """The true rows as wrongly installed sensors show them, without noise."""
    out, of = truth.copy(), {name: slice(s.start, s.stop) for name, s in GROUPS.items()}
    for kind, error in errors.items():
        size, axis = error["size"], error["axis"]
        if kind == "tilt":
            turn = turned(size, axis)
            for group in ("gyros", "accelerometers"):
                out[:, of[group]] = out[:, of[group]] @ turn.T
            out[:, of["attitude"]] = angles(body_to_earth(out[:, of["attitude"]]) @ turn.T)
        elif kind in ("gyro_gain", "force_gain"):
            out[:, of["gyros" if kind == "gyro_gain" else "accelerometers"].start + axis] *= 1.0 + size
        elif kind == "vane_gain":
            out[:, of["vanes"].start + axis % 2] *= 1.0 + size
        elif kind == "airspeed_lag":
            out[:, of["airspeed"]] = lagged(out[:, of["airspeed"]], size, step)
        elif kind == "velocity_late":
            k = round(size / step)
            out[k:, of["velocity"]] = truth[:-k, of["velocity"]]
        elif kind == "servo":  # gain, and a curve of the recorded deflection
            column = of["actuators"].start + axis % 2
            out[:, column] *= 1.0 + 0.3 * size + size * np.abs(out[:, column])
        elif kind == "servo_sides":  # it turns by 1 + size times what is recorded on the positive side, by 1 - size on the other
            column = of["actuators"].start + axis % 2
            out[:, column] /= 1.0 + size * np.sign(out[:, column])
    return out
