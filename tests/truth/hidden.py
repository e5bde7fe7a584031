"""The effects that a case can hide, with the amplitudes at which they show in three flights.

The ids are those of `greylag effects list`.
"""

import numpy as np

AMPLITUDES = {
    "drag_alpha2": (0.6, 1.2, False),
    "drag_beta2": (0.5, 1.2, False),
    "drag_elevator_abs": (0.08, 0.16, False),
    "lift_stall": (0.19, 0.24, False),
    "pitch_break": (-3.0, -1.5, False),
    "cg_shift": (0.008, 0.016, True),
    "unsteady_lift": (2.0, 4.0, False),
    "thrust_decay": (0.3, 0.5, False),
    "thrust_scale": (-10.0, -8.0, False),
    "thrust_line_offset": (0.02, 0.04, True),
    "motor_torque": (0.4, 1.0, True),
    "propeller_gyro": (0.04, 0.1, True),
    "propwash": (0.3, 0.6, False),
    "aeroelastic_loss": (0.1, 0.2, False),
    "actuator_lag": (0.02, 0.05, False),
    "time_delay": (0.02, 0.03, False),
    "dead_zone": (0.015, 0.035, False),
    "backlash": (0.02, 0.06, False),
    "rate_limit": (1.6, 2.4, False),
    "mass_error": (0.1, 0.2, False),
    "inertia_xz": (0.06, 0.1, False),
    "asymmetry": (0.002, 0.004, True),
    "dihedral_alpha": (0.3, 0.6, True),
    "roll_control_alpha": (0.3, 0.5, True),
    "effectiveness_saturation": (-2.0, -1.0, False),
    "thrust_lag": (0.2, 0.6, False),
    "servo_aileron": (0.1, 0.2, True),
    "servo_elevator": (0.1, 0.2, True),
    "servo_aileron_curve": (0.3, 0.6, True),
    "servo_elevator_curve": (0.3, 0.6, True),
}
"""Smallest and largest amplitude, and whether it may as well be negative.

In SI units, as the catalogue has them. Of `drag_beta2` and `drag_elevator_abs`: the whole coefficient, as the
model lacks what the aircraft has of its own. Of `lift_stall`: the angle of attack of the stall. Of
`unsteady_lift`: CLalphadot; Cmalphadot is -1/2 of it.
"""

PARAMETERS = {
    "drag_alpha2": {"CDalpha2": 1.0},
    "drag_beta2": {"CDbeta2": 1.0},
    "drag_elevator_abs": {"CDde": 1.0},
    "lift_stall": {"alpha0_rad": 1.0},
    "pitch_break": {"Cmalpha3": 1.0},
    "cg_shift": {"x_m": 1.0},
    "unsteady_lift": {"CLalphadot": 1.0, "Cmalphadot": -0.5},
    "thrust_decay": {"k": 1.0},
    "thrust_line_offset": {"z_m": 1.0},
    "motor_torque": {"k_nm": 1.0},
    "propeller_gyro": {"h_nms": 1.0},
    "propwash": {"k": 1.0},
    "aeroelastic_loss": {"k": 1.0},
    "actuator_lag": {"tau_s": 1.0},
    "time_delay": {"delay_s": 1.0},
    "dead_zone": {"halfwidth_rad": 1.0},
    "backlash": {"width_rad": 1.0},
    "rate_limit": {"rate_radps": 1.0},
    "inertia_xz": {"dJxz_kgm2": 1.0},
    "asymmetry": {"Cl0": 1.0, "Cn0": 1.0, "CY0": 1.0},
    "dihedral_alpha": {"Clalphabeta": 1.0},
    "roll_control_alpha": {"Clalphada": 1.0, "Cnalphada": 0.0},
    "effectiveness_saturation": {"k_perrad2": 1.0},
    "thrust_lag": {"tau_s": 1.0},
    "servo_aileron": {"k": 1.0},
    "servo_elevator": {"k": 1.0},
    "servo_aileron_curve": {"c": 1.0},
    "servo_elevator_curve": {"c": 1.0},
}
"""The parameters in which the catalogue has a hidden effect, each as a multiple of the amplitude.

`mass_error` and `thrust_scale` are left out: their true value depends on the coefficients of the model, which are
wrong themselves. Of `lift_stall` only `alpha0_rad` is compared, and of `official` its table has no such formula.
"""

INPUTS = (
    "actuator_lag", "time_delay", "dead_zone", "backlash", "rate_limit", "thrust_lag", "servo_aileron", "servo_elevator",
    "servo_aileron_curve", "servo_elevator_curve",
)  # fmt: skip
"""Effects on what the surfaces, or of `thrust_lag` the engine, do with their measured position."""

BY_NAME = ("servo_aileron_curve", "servo_elevator_curve")
"""Effects that `make_cases.py --both` draws only if they are named: a seed draws what it drew before they were added."""

TAKEN_OUT = {"drag_beta2": "drag_beta2", "drag_elevator_abs": "drag_elevator_abs", "lift_stall": "lift_table"}
"""What a model loses so that it lacks the effect, where the aircraft has it of its own."""


THRESHOLDS = ("lift_stall", "rate_limit")
"""Effects whose amplitude is where they begin: a part of it is no weaker effect."""


def amplitude(effect, truth, random, strength=1.0):
    """`strength` times a clear amplitude of `effect`, drawn."""
    low, high, either_sign = AMPLITUDES[effect]
    size = random.uniform(low, high) * (1.0 if effect in THRESHOLDS else strength)
    if either_sign and random.random() < 0.5:
        size = -size
    if effect == "lift_stall" and truth == "official":
        size = 0.2146  # where the lift table of its file has its maximum
    if effect == "time_delay":  # whole steps of 400 Hz
        size = round(size * 400.0) / 400.0
    return float(f"{size:.4g}")


def random_of(seed, name, *more):
    """Random numbers of one subject of one case."""
    return np.random.default_rng([seed, *name.encode(), *more])
