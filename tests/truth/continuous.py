"""A continuous-time truth: six degrees of freedom, RK4 at 1 kHz, exact actuators.

Flat earth, constant gravity, steady wind. Body axes FRD, earth axes NED. The state is the velocity relative to
the air (u, v, w), the rates (p, q, r), the attitude quaternion (earth to body) and the altitude.
"""

import math

import numpy as np

import aircraft as x8
from atmosphere import density
from compiled import compiled
from formulas import FORMS, LAGGED, THROTTLE, VARIABLES, form_of
from hidden import INPUTS
from pilot import PERIOD, command

STEP = 0.001
PER_COMMAND = round(PERIOD / STEP)
HISTORY = 256
"""Half steps of the surfaces that are remembered: 128 ms."""

NAMES = (
    "drag_alpha2", "drag_beta2", "drag_elevator_abs", "stall", "stall_alpha", "stall_sharpness", "pitch_break",
    "cg_shift", "lift_alphadot", "pitch_alphadot", "thrust_decay", "thrust_scale", "thrust_line_offset",
    "motor_torque", "propeller_gyro", "propwash", "aeroelastic_loss", "mass_error", "inertia_xz", "asymmetry",
    "dihedral_alpha", "roll_control_alpha", "effectiveness_saturation", "formula_channel", "formula_form",
    "formula_first", "formula_second", "formula_constant", "formula_amount",
)  # fmt: skip
"""Figures of the hidden effects and of a hidden formula, in the order of the vector that the equations take."""

_C = {f"{e}.{n}": v for e, names in x8.COEFFICIENTS.items() for n, v in names.items()}
CLQ, CLDE = _C["lift_linear.CLq"], _C["lift_linear.CLde"]
CYB, CYP, CYR, CYDA = (_C[f"side_force_linear.CY{n}"] for n in ("beta", "p", "r", "da"))
CLB, CLP, CLR, CLDA = (_C[f"roll_linear.Cl{n}"] for n in ("beta", "p", "r", "da"))
CM0, CMA, CMQ, CMDE = (_C[f"pitch_linear.Cm{n}"] for n in ("0", "alpha", "q", "de"))
CNB, CNP, CNR, CNDA = (_C[f"yaw_linear.Cn{n}"] for n in ("beta", "p", "r", "da"))
CDB, CDB2, CDDE = _C["drag_beta2.CDbeta"], _C["drag_beta2.CDbeta2"], _C["drag_elevator_abs.CDde"]
CL0, CLA = x8.LINEAR_LIFT["CL0"], x8.LINEAR_LIFT["CLalpha"]
AREA, SPAN, CHORD, MASS, THRUST = x8.AREA, x8.SPAN, x8.CHORD, x8.MASS, x8.THRUST_MAX
JX, JY, JZ, JXZ, GRAVITY = x8.JX, x8.JY, x8.JZ, x8.JXZ, x8.GRAVITY
LIFT_ALPHA, LIFT, DRAG_ALPHA, DRAG = x8.LIFT_ALPHA, x8.LIFT, x8.DRAG_ALPHA, x8.DRAG
WITHOUT_AIR = (1 + list(FORMS).index(THROTTLE), 1 + list(FORMS | LAGGED).index("lag without air"))
FIRST_LAGGED = 1 + len(FORMS)
OF_CONTROLS = list(VARIABLES).index("aileron")
V0, THROTTLE0, LIMIT, LAG = x8.REFERENCE_SPEED, x8.REFERENCE_THROTTLE, x8.DEFLECTION_MAX, x8.THROTTLE_LAG


def vector(effect=None, amount=0.0, formula=None):
    """The figures of one hidden effect or of a formula (`formulas.Formula`), or of none."""
    values = dict.fromkeys(NAMES, 0.0)
    if effect == "lift_stall":
        values.update(stall=1.0, stall_alpha=amount, stall_sharpness=50.0)
    elif effect == "unsteady_lift":
        values.update(lift_alphadot=amount, pitch_alphadot=-0.5 * amount)
    elif effect == "drag_beta2":
        values.update(drag_beta2=amount - CDB2)
    elif effect == "drag_elevator_abs":
        values.update(drag_elevator_abs=amount - CDDE)
    elif effect is not None and effect not in INPUTS:
        values[effect] = amount
    if formula is not None:
        values.update(formula.figures())
    return tuple(values.values())


@compiled
def between(x, xs, ys):
    """Linear interpolation, the ends held."""
    if x <= xs[0]:
        return ys[0]
    for k in range(1, len(xs)):
        if x <= xs[k]:
            return ys[k - 1] + (ys[k] - ys[k - 1]) * (x - xs[k - 1]) / (xs[k] - xs[k - 1])
    return ys[-1]


@compiled
def lift_of_wing(alpha, e):
    """Lift coefficient of the wing: the table, or the blend of Beard & McLain eqs. (4.9), (4.10)."""
    if e[3] == 0.0:
        return between(alpha, LIFT_ALPHA, LIFT)
    low, high = math.exp(-e[5] * (alpha - e[4])), math.exp(e[5] * (alpha + e[4]))
    share = (1.0 + low + high) / ((1.0 + low) * (1.0 + high))
    plate = 2.0 * math.copysign(1.0, alpha) * math.sin(alpha) ** 2 * math.cos(alpha)
    return (1.0 - share) * (CL0 + CLA * alpha) + share * e[3] * plate


@compiled
def wrench(x, z, e):
    """Force other than gravity (N), moment (N m), airspeed, alpha, beta.

    `z`: aileron, elevator (rad, as they act), throttle, and the control that a hidden lag has made late; `e`: figures of
    the hidden effects.
    """
    u, v, w, p, q, r = x[0], x[1], x[2], x[3], x[4], x[5]
    airspeed = math.sqrt(u * u + v * v + w * w)
    alpha, beta = math.atan2(w, u), math.asin(v / airspeed)
    throttle = z[2]
    act = 1.0 + e[15] * (throttle - THROTTLE0) - e[16] * ((airspeed / V0) ** 2 - 1.0)
    aileron, elevator = z[0] * act, z[1] * act
    roll_aileron = aileron * (1.0 + e[22] * aileron * aileron)
    pitch_elevator = elevator * (1.0 + e[22] * elevator * elevator)
    qs = 0.5 * density(x[10]) * airspeed * airspeed * AREA
    ph, qh, rh = (p * SPAN / (2.0 * airspeed), q * CHORD / (2.0 * airspeed), r * SPAN / (2.0 * airspeed))
    lift = lift_of_wing(alpha, e) + CLQ * qh + CLDE * elevator
    drag = between(alpha, DRAG_ALPHA, DRAG) + CDB * abs(beta) + (CDB2 + e[1]) * beta * beta
    drag += (CDDE + e[2]) * abs(elevator) + e[0] * alpha * alpha
    side = CYB * beta + CYP * ph + CYR * rh + CYDA * aileron + e[19]
    roll = CLB * beta + CLP * ph + CLR * rh + CLDA * roll_aileron + e[19]
    roll += e[20] * alpha * beta + e[21] * alpha * aileron
    pitch = CM0 + CMA * alpha + CMQ * qh + CMDE * pitch_elevator + e[6] * alpha**3
    yaw = CNB * beta + CNP * ph + CNR * rh + CNDA * aileron + e[19]
    thrust = THRUST * throttle * (1.0 - e[10] * (airspeed / V0 - 1.0)) + e[11] * throttle
    sa, ca, sb, cb = math.sin(alpha), math.cos(alpha), math.sin(beta), math.cos(beta)
    along = -drag * cb - side * sb
    fx = qs * (along * ca + lift * sa) + thrust
    fy = qs * (side * cb - drag * sb)
    fz = qs * (along * sa - lift * ca)
    l = qs * SPAN * roll - e[13] * throttle
    m = qs * CHORD * pitch + e[12] * thrust + e[14] * r
    n = qs * SPAN * yaw - e[14] * q
    if e[8] != 0.0 or e[9] != 0.0:
        # the rate of alpha depends on the lift that it makes: linear, so solved
        mass = MASS * (1.0 + e[17])
        g = gravity(x)
        across = (fz / mass + g[2]) * ca - (fx / mass + g[0]) * sa
        rate = q - (p * ca + r * sa) * v / (airspeed * cb) + across / (airspeed * cb)
        half = qs * CHORD / (2.0 * airspeed)
        rate /= 1.0 + half * e[8] / (mass * airspeed * cb)
        fx += half * e[8] * rate * sa
        fz -= half * e[8] * rate * ca
        m += half * CHORD * e[9] * rate
    m, n = m - e[7] * fz, n + e[7] * fy
    if e[23] != 0.0:
        more = of_formula((alpha, beta, ph, qh, rh, z[0], z[1], throttle, z[3]), qs, e)
        along = -more[0] * cb - more[2] * sb
        fx += along * ca + more[1] * sa
        fy += more[2] * cb - more[0] * sb
        fz += along * sa - more[1] * ca
        l, m, n = l + more[3], m + more[4], n + more[5]
    return fx, fy, fz, l, m, n, airspeed, alpha, beta


@compiled
def of_formula(of, qs, e):
    """Drag, lift, side force (N), rolling, pitching, yawing moment (N m) of a hidden formula of the variables `of`."""
    channel, form = int(e[23]), int(e[24])
    amount = e[28] * form_of(form, of[int(e[25])], of[int(e[26])], e[27])
    if form != WITHOUT_AIR[0] and form != WITHOUT_AIR[1]:
        amount *= qs * (1.0, 1.0, 1.0, SPAN, CHORD, SPAN)[channel - 1]
    return (
        amount if channel == 1 else 0.0, amount if channel == 2 else 0.0, amount if channel == 3 else 0.0,
        amount if channel == 4 else 0.0, amount if channel == 5 else 0.0, amount if channel == 6 else 0.0,
    )  # fmt: skip


@compiled
def gravity(x):
    """Gravity in body axes, m/s2."""
    a, b, c, d = x[6], x[7], x[8], x[9]
    return (
        GRAVITY * 2.0 * (b * d - a * c),
        GRAVITY * 2.0 * (c * d + a * b),
        GRAVITY * (a * a - b * b - c * c + d * d),
    )


@compiled
def rates(x, z, e):
    """The state's rate of change."""
    u, v, w, p, q, r, a, b, c, d = x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7], x[8], x[9]
    fx, fy, fz, l, m, n, _, _, _ = wrench(x, z, e)
    g, mass, jxz = gravity(x), MASS * (1.0 + e[17]), JXZ + e[18]
    # Euler's equations with -Jxz in the inertia matrix
    hx, hy, hz = JX * p - jxz * r, JY * q, JZ * r - jxz * p
    tl, tm, tn = l - (q * hz - r * hy), m - (r * hx - p * hz), n - (p * hy - q * hx)
    left = JX * JZ - jxz * jxz
    return (
        fx / mass + g[0] + r * v - q * w,
        fy / mass + g[1] + p * w - r * u,
        fz / mass + g[2] + q * u - p * v,
        (JZ * tl + jxz * tn) / left,
        tm / JY,
        (jxz * tl + JX * tn) / left,
        0.5 * (-b * p - c * q - d * r),
        0.5 * (a * p + c * r - d * q),
        0.5 * (a * q - b * r + d * p),
        0.5 * (a * r + b * q - c * p),
        2.0 * (b * d - a * c) * u + 2.0 * (c * d + a * b) * v + (a * a - b * b - c * c + d * d) * w,
    )  # fmt: skip


@compiled
def ahead(x, k, h):
    """x + h k; the last rate is downward, the altitude upward."""
    return (
        x[0] + h * k[0], x[1] + h * k[1], x[2] + h * k[2], x[3] + h * k[3], x[4] + h * k[4], x[5] + h * k[5],
        x[6] + h * k[6], x[7] + h * k[7], x[8] + h * k[8], x[9] + h * k[9], x[10] - h * k[10],
    )  # fmt: skip


@compiled
def rk4(x, begin, middle, end, e, h):
    """The state one step on, with the controls at its begin, middle and end."""
    k1 = rates(x, begin, e)
    k2 = rates(ahead(x, k1, 0.5 * h), middle, e)
    k3 = rates(ahead(x, k2, 0.5 * h), middle, e)
    k4 = rates(ahead(x, k3, h), end, e)
    x = ahead(ahead(ahead(ahead(x, k1, h / 6.0), k2, h / 3.0), k3, h / 3.0), k4, h / 6.0)
    size = math.sqrt(x[6] ** 2 + x[7] ** 2 + x[8] ** 2 + x[9] ** 2)
    return (x[0], x[1], x[2], x[3], x[4], x[5], x[6] / size, x[7] / size, x[8] / size, x[9] / size, x[10])


@compiled
def euler(x):
    """Roll, pitch, yaw (rad)."""
    a, b, c, d = x[6], x[7], x[8], x[9]
    roll = math.atan2(2.0 * (a * b + c * d), 1.0 - 2.0 * (b * b + c * c))
    pitch = math.asin(min(max(2.0 * (a * c - b * d), -1.0), 1.0))
    return roll, pitch, math.atan2(2.0 * (a * d + b * c), 1.0 - 2.0 * (c * c + d * d))


@compiled
def follow(filtered, target, matrix):
    """A second-order filter half a step on under a constant target, exactly."""
    off, rate = filtered[0] - target, filtered[1]
    return target + matrix[0] * off + matrix[1] * rate, matrix[2] * off + matrix[3] * rate


@compiled
def act(kind, amount, past, now, before, h):
    """The deflection that acts through an effect on the input.

    `past`: measured positions at half steps, a ring whose newest entry is `now`; `before`: what acted last.
    """
    u, old = past[now % HISTORY], past[(now - 1) % HISTORY]
    if kind == 1:  # lag: exact for an input linear between half steps
        keep = math.exp(-h / amount)
        slope = (u - old) / h
        return u - slope * amount + (before - old + slope * amount) * keep
    if kind == 2:  # delay
        steps = amount / h
        whole = int(steps)
        part = steps - whole
        return (1.0 - part) * past[(now - whole) % HISTORY] + part * past[(now - whole - 1) % HISTORY]
    if kind == 3:  # dead zone
        return u - min(max(u, -amount), amount)
    if kind == 4:  # play of whole width `amount`
        return min(max(before, u - 0.5 * amount), u + 0.5 * amount)
    if kind == 5:  # limited rate
        return before + min(max(u - before, -amount * h), amount * h)
    if kind == 7 or kind == 8:  # a gain of 1 + amount on the positive side, of 1 - amount on the other
        return u + amount * abs(u)
    if kind == 9 or kind == 10:  # a gain of 1 + amount times the deflection's size
        return u * (1.0 + amount * abs(u))
    return u


@compiled
def clipped(x):
    """A deflection within its stops."""
    return min(max(x, -LIMIT), LIMIT)


@compiled
def integrate(x, wanted, e, kind, amount, matrix, truth, commands):
    """Flies the plan `wanted` (a row a command) and fills `truth` (a row a step) and `commands`."""
    h = 0.5 * STEP
    throttle_keep = math.exp(-h / LAG)
    past_a, past_e = np.zeros(HISTORY), np.zeros(HISTORY)
    surface_a, surface_e, throttle = (0.0, 0.0), (0.0, 0.0), 0.15
    acting_a, acting_e, acting_t, now = 0.0, 0.0, throttle, HISTORY
    thrust_keep = math.exp(-h / amount) if kind == 6 else 0.0
    lags, lagged_of, tau = e[24] >= FIRST_LAGGED, int(e[26]) - OF_CONTROLS, e[27]
    late_keep = math.exp(-h / tau) if lags else 0.0
    late = throttle if lags and lagged_of == 2 else 0.0
    memory = (0.0, 0.0, 0.0)
    row = 0
    for k in range(wanted.shape[0]):
        roll, pitch, _ = euler(x)
        speed = math.sqrt(x[0] ** 2 + x[1] ** 2 + x[2] ** 2)
        t = wanted[k]
        given, memory = command(
            (roll, pitch, x[3], x[4], x[5], speed), (t[0], t[1], t[2], t[3], t[4], t[5], t[6]), memory
        )
        commands[k, 0], commands[k, 1], commands[k, 2] = given
        for _ in range(PER_COMMAND):
            begin = (acting_a, acting_e, acting_t, late)
            note(truth, row, x, begin, clipped(surface_a[0]), clipped(surface_e[0]), throttle, e)
            middle = begin
            for half in range(2):
                surface_a = follow(surface_a, given[0] * LIMIT, matrix)
                surface_e = follow(surface_e, given[1] * LIMIT, matrix)
                old = throttle
                throttle = given[2] + (throttle - given[2]) * throttle_keep
                if kind == 6:  # a lag, exact for a throttle linear between half steps
                    slope = (throttle - old) / h
                    acting_t = throttle - slope * amount + (acting_t - old + slope * amount) * thrust_keep
                else:
                    acting_t = throttle
                acted = (acting_a, acting_e, old)
                now += 1
                past_a[now % HISTORY], past_e[now % HISTORY] = clipped(surface_a[0]), clipped(surface_e[0])
                # a wrong servo is that of one surface
                acting_a = act(0 if kind == 8 or kind == 10 else kind, amount, past_a, now, acting_a, h)
                acting_e = act(0 if kind == 7 or kind == 9 else kind, amount, past_e, now, acting_e, h)
                if lags:  # as the lag of the thrust
                    target = (acting_a, acting_e, throttle)[lagged_of]
                    slope = (target - acted[lagged_of]) / h
                    late = target - slope * tau + (late - acted[lagged_of] + slope * tau) * late_keep
                if half == 0:
                    middle = (acting_a, acting_e, acting_t, late)
            x = rk4(x, begin, middle, (acting_a, acting_e, acting_t, late), e, STEP)
            row += 1
    return x


@compiled
def note(truth, row, x, z, aileron, elevator, throttle, e):
    """One row of the truth: the columns of `sensors.TRUTH`, velocity relative to the air."""
    fx, fy, fz, _, _, _, airspeed, alpha, beta = wrench(x, z, e)
    mass = MASS * (1.0 + e[17])
    u, v, w, a, b, c, d = x[0], x[1], x[2], x[6], x[7], x[8], x[9]
    t = truth[row]
    t[0], t[1], t[2] = euler(x)
    t[3], t[4], t[5], t[6], t[7], t[8] = x[3], x[4], x[5], airspeed, alpha, beta
    t[9], t[10], t[11] = fx / mass, fy / mass, fz / mass
    t[12] = (a * a + b * b - c * c - d * d) * u + 2.0 * (b * c - a * d) * v + 2.0 * (b * d + a * c) * w
    t[13] = 2.0 * (b * c + a * d) * u + (a * a - b * b + c * c - d * d) * v + 2.0 * (c * d - a * b) * w
    t[14] = 2.0 * (b * d - a * c) * u + 2.0 * (c * d + a * b) * v + (a * a - b * b - c * c + d * d) * w
    t[15], t[16], t[17], t[18] = x[10], aileron, elevator, throttle


def filter_matrix(h):
    """Transition over `h` of the surfaces' second-order filter: (off, rate) to (off, rate)."""
    w, zeta = x8.SURFACE_FREQUENCY, x8.SURFACE_DAMPING
    wd, decay = w * math.sqrt(1.0 - zeta * zeta), math.exp(-zeta * w * h)
    s, c = math.sin(wd * h), math.cos(wd * h)
    return (
        decay * (c + zeta * w / wd * s), decay * s / wd, -decay * w * w / wd * s, decay * (c - zeta * w / wd * s),
    )  # fmt: skip


def fly(wanted, effect, amount, wind, heading, formula=None):
    """Truth (a row a millisecond) and commands of a plan, flown in a steady wind (NED, m/s).

    What is hidden is an effect with its amount, or a formula (`formulas.Formula`), or nothing.
    """
    pitch = 0.03
    x = (
        18.0 * math.cos(pitch), 0.0, 18.0 * math.sin(pitch), 0.0, 0.0, 0.0,
        math.cos(heading / 2) * math.cos(pitch / 2), -math.sin(heading / 2) * math.sin(pitch / 2),
        math.cos(heading / 2) * math.sin(pitch / 2), math.sin(heading / 2) * math.cos(pitch / 2), 600.0,
    )  # fmt: skip
    truth, commands = np.zeros((PER_COMMAND * len(wanted), 19)), np.zeros((len(wanted), 3))
    kind = INPUTS.index(effect) + 1 if effect in INPUTS else 0
    integrate(x, wanted, vector(effect, amount, formula), kind, amount, filter_matrix(0.5 * STEP), truth, commands)
    truth[:, 12:15] += wind
    return truth, commands
