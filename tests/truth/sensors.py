"""Sensors that sample at instants: from the truth to the table of a log."""

from dataclasses import asdict, dataclass, field

import numpy as np

from pilot import PERIOD

TRUTH = (
    "roll_rad", "pitch_rad", "yaw_rad", "p_radps", "q_radps", "r_radps", "airspeed_mps", "alpha_rad", "beta_rad",
    "ax_mps2", "ay_mps2", "az_mps2", "vn_mps", "ve_mps", "vd_mps", "altitude_m", "aileron_rad", "elevator_rad",
    "throttle",
)  # fmt: skip
"""Columns of a truth and, by the same names, of a log."""
COMMANDS = ("aileron_cmd", "elevator_cmd", "throttle_cmd")
GROUPS = {
    "attitude": slice(0, 3), "gyros": slice(3, 6), "airspeed": slice(6, 7), "vanes": slice(7, 9),
    "accelerometers": slice(9, 12), "velocity": slice(12, 15), "altitude": slice(15, 16), "actuators": slice(16, 19),
}  # fmt: skip
"""Columns that share a clock."""
NOISE = {
    "attitude": 0.0035, "gyros": 0.005, "airspeed": 0.3, "vanes": 0.005, "accelerometers": 0.1, "velocity": 0.1,
    "altitude": 0.5, "actuators": 0.0,
}  # fmt: skip
"""White noise of a small autopilot's sensors (standard deviations, SI)."""
STEPS = {
    "attitude": 1e-4, "gyros": 1.3e-4, "airspeed": 0.1, "vanes": 0.00153, "accelerometers": 0.0024,
    "velocity": 0.01, "altitude": 0.1, "actuators": 0.001,
}  # fmt: skip
"""What one count of each sensor is worth: MEMS of 16 bit, vanes of 12 bit a turn (SI)."""


@dataclass
class Options:
    """What the sensors are like. `noise` multiplies noise and biases; `drift` is the gyros' (rad/s²), of either sign."""

    rate: float = 100.0
    noise: float = 1.0
    skew: float = 0.01
    quantised: bool = False
    held: dict = field(default_factory=dict)
    missing: list = field(default_factory=list)
    drift: float = 0.0


@dataclass
class Errors:
    """The constant errors of one flight: biases in SI units, how late each group is in s."""

    gyros: list
    accelerometers: list
    airspeed_scale: float
    vanes: list
    late: dict


def drawn(random, options):
    """Errors as in a small autopilot; the gyros' clock is the log's."""

    def bias(sd):
        return float(options.noise * sd * np.clip(random.standard_normal(), -2.0, 2.0))

    late = {group: float(random.uniform(0.0, options.skew)) if options.skew else 0.0 for group in GROUPS}
    late["gyros"] = late["altitude"] = 0.0
    return Errors(
        gyros=[bias(0.005) for _ in range(3)],
        accelerometers=[bias(0.1) for _ in range(3)],
        airspeed_scale=1.0 + bias(0.02),
        vanes=[bias(np.radians(0.5)), bias(np.radians(0.4))],
        late=late,
    )


def sampled(truth, step, times):
    """The truth at `times` (s): cubic through the four nearest rows, `step` (s) apart."""
    at = np.clip(times / step, 1.0, len(truth) - 3.0)
    k = np.floor(at).astype(int)
    f = (at - k)[:, None]
    weights = (
        -f * (f - 1) * (f - 2) / 6, (f + 1) * (f - 1) * (f - 2) / 2, -(f + 1) * f * (f - 2) / 2,
        (f + 1) * f * (f - 1) / 6,
    )  # fmt: skip
    return sum(w * truth[k + j - 1] for j, w in enumerate(weights))


def log(truth, step, commands, begin, options, random):
    """The log's rows with their header's names, from `begin` (s) on, and the errors that it has."""
    errors = drawn(random, options)
    end = min(len(truth) * step, len(commands) * PERIOD)
    n = int(np.floor((end - begin) * options.rate - 1e-6)) - 1
    times = begin + np.arange(n) / options.rate
    smooth = truth.copy()
    smooth[:, 2] = np.unwrap(smooth[:, 2])
    out = np.empty((n, len(TRUTH)))
    for group, columns in GROUPS.items():
        when = times - errors.late[group]
        if group in options.held:  # the sensor's own, slower sample that was new last
            when = np.floor(when * options.held[group]) / options.held[group]
        out[:, columns] = sampled(smooth[:, columns], step, when)
    out[:, 3:6] += errors.gyros
    if options.drift:
        out[:, 3:6] += options.drift * random.choice([-1.0, 1.0], 3) * (times - times.mean())[:, None]
    out[:, 6] *= errors.airspeed_scale
    out[:, 7:9] += errors.vanes
    out[:, 9:12] += errors.accelerometers
    for group, columns in GROUPS.items():
        noise = options.noise * NOISE[group] * random.standard_normal(out[:, columns].shape)
        if group in options.held:
            number = np.floor((times - errors.late[group]) * options.held[group]).astype(int)
            noise = noise[number - number[0]]
        out[:, columns] += noise
        if options.quantised:
            out[:, columns] = STEPS[group] * np.round(out[:, columns] / STEPS[group])
        if group in options.missing:
            out[:, columns] = np.nan
    out[:, 2] = np.mod(out[:, 2] + np.pi, 2.0 * np.pi) - np.pi
    given = commands[np.minimum((times / PERIOD + 1e-6).astype(int), len(commands) - 1)]
    rows = np.column_stack([times - begin, out, given])
    return ("time_s", *TRUTH, *COMMANDS), rows, asdict(errors)


def write(path, names, rows):
    """Writes the table as the project's CSV; a missing sample is an empty field."""
    keep = [k for k in range(len(names)) if not np.isnan(rows[:, k]).all()]
    with open(path, "w") as file:
        file.write(",".join(names[k] for k in keep) + "\n")
        for row in rows[:, keep].tolist():
            file.write(",".join("" if x != x else f"{x:.10g}" for x in row) + "\n")
