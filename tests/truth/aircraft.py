"""The Skywalker X8 as numbers: geometry, mass, coefficients (Gryte et al., ICUAS 2018).

SI units, radians, body axes forward-right-down. The product of inertia follows Beard & McLain: it enters
the inertia matrix as -Jxz. Lift and drag over the angle of attack are tables, as in the aircraft's XML.
"""

AREA, SPAN, CHORD = 0.75, 2.1, 0.3571
MASS = 3.364
JX, JY, JZ, JXZ = 1.229, 0.1702, 0.8808, -0.9343
GRAVITY = 9.806
THRUST_MAX = 8.0 / 745.7 * 550.0 * 4.4482216152605
"""Full thrust, N: eight watts, which JSBSim's direct thruster takes for 5.9005 pounds."""
DEFLECTION_MAX = 0.5235
SURFACE_FREQUENCY, SURFACE_DAMPING = 100.0, 0.5**0.5
THROTTLE_LAG = 0.2
REFERENCE_SPEED = 16.67
"""Airspeed at which effects that change with speed vanish, m/s."""
REFERENCE_THROTTLE = 0.118
"""Throttle at which the propeller's wash vanishes."""

COEFFICIENTS = {
    "lift_linear": {"CL0": 0.0, "CLalpha": 0.0, "CLq": 3.87, "CLde": 0.2781},
    "side_force_linear": {"CY0": 0.0, "CYbeta": -0.2239, "CYp": -0.1374, "CYr": 0.0839, "CYda": 0.0433},
    "roll_linear": {"Cl0": 0.0, "Clbeta": -0.0849, "Clp": -0.4042, "Clr": 0.0555, "Clda": 0.1202},
    "pitch_linear": {"Cm0": 0.0227, "Cmalpha": -0.4629, "Cmq": -1.3012, "Cmde": -0.2292},
    "yaw_linear": {"Cn0": 0.0, "Cnbeta": 0.0283, "Cnp": 0.0044, "Cnr": -0.072, "Cnda": -0.00339},
    "thrust_linear": {"Cp_n": THRUST_MAX},
    "lift_table": {"k": 1.0},
    "drag_table": {"k": 1.0},
    "drag_beta2": {"CDbeta": -0.0058, "CDbeta2": 0.1478},
    "drag_elevator_abs": {"CDde": 0.0633},
}
"""Coefficients by the effects and names of model files."""

LINEAR_LIFT = {"CL0": 0.1119, "CLalpha": 3.93}
"""Lift between the stalls, for a model without the table and a truth that stalls by another law."""

LIFT_ALPHA = (
    -1.5714, -1.4614, -1.3252, -1.0581, -0.9691, -0.7491, -0.4925, -0.3406, -0.2987, -0.2725, -0.2254,
    -0.1573, -0.0682, -0.0001, 0.1308, 0.2146, 0.2722, 0.3403, 0.5288, 0.6441, 0.7802, 0.9583, 1.194,
    1.3511, 1.4821, 1.5711,
)
LIFT = (
    -0.0028, -0.2135, -0.4569, -0.7448, -0.7705, -0.6746, -0.3937, -0.2369, -0.3492, -0.5412, -0.7308,
    -0.5412, -0.1596, 0.1119, 0.6222, 0.896, 0.58, 0.2453, 0.4466, 0.5777, 0.7041, 0.7696, 0.6362, 0.4092,
    0.1751, 0.0042,
)
DRAG_ALPHA = (-0.5235, -0.4071, -0.2908, -0.1745, -0.0581, 0.0581, 0.1745, 0.2908, 0.4071, 0.5235)
DRAG = (
    0.24157882, 0.15065182, 0.08356223, 0.04030362, 0.02088696, 0.0253051, 0.05356137, 0.10565625,
    0.18158545, 0.28134915,
)
