"""Formulas that a case of the continuous truth can hide, drawn from a grammar.

A formula is a force or a moment of one channel: an amount times a form of one or two variables, in proportion to
dynamic pressure. The throttle alone acts without the air. What the catalogue of Greylag or the model that a case is
given holds already is not drawn (`HELD`).
"""

import math
from dataclasses import asdict, dataclass

from compiled import compiled

VARIABLES = {
    "alpha": 0.08, "beta": 0.08, "p_hat": 0.03, "q_hat": 0.005, "r_hat": 0.02, "aileron": 0.12, "elevator": 0.14,
    "throttle": 0.5,
}  # fmt: skip
"""Variables, each with a size that it has in the flights: between the quantiles 0.75 and 0.95 of its magnitude.

The rates are p b/(2V), q c/(2V) and r b/(2V).
"""
CHANNELS = {"drag": 0.02, "lift": 0.06, "side": 0.02, "roll": 0.004, "pitch": 0.01, "yaw": 0.002}
"""Channels, each with an amount of its coefficient that shows. Forces are along the axes of the wind."""
FACTORS = {
    "drag": "qbar*S", "lift": "qbar*S", "side": "qbar*S", "roll": "qbar*S*b", "pitch": "qbar*S*c", "yaw": "qbar*S*b",
}  # fmt: skip
"""What the form is multiplied by in each channel."""
WITHOUT_AIR = {"drag": 2.5, "lift": 7.5, "side": 2.5, "roll": 1.0, "pitch": 0.5, "yaw": 0.5}
"""Amounts that show of the throttle alone: N and N m."""
FORMS = {
    "magnitude": ("abs({v})", ("even",)),
    "square": ("{v}^2", ("even",)),
    "signed square": ("{v}*abs({v})", ("odd",)),
    "cube": ("{v}^3", ("odd",)),
    "dead band": ("deadband({v}, {c})", ("odd",)),
    "hinge": ("max({v} - {c}, 0)", ("one-sided",)),
    "tanh": ("tanh({v}/{c})", ("odd",)),
    "product": ("{v}*{w}", ("odd", "odd")),
    "product with a square": ("{v}*{w}^2", ("odd", "even")),
    "throttle alone": ("{v}", ("grows",)),
}
"""Forms with their text and their parity in each variable. All of them are monotone on either side of zero.

The throttle is never negative, so in it a form just grows.
"""
LAGGED = {
    "lag": ("lag({v}, {c})", ("odd",)),
    "lag without air": ("lag({v}, {c})", ("grows",)),
}
"""Controls through a first-order lag of so many seconds: drawn by `drawn_lagged` alone."""
CONTROLS = ("aileron", "elevator", "throttle")
LAGS = (0.1, 0.6)
"""Shortest and longest time constant, s."""
OF_TWO = ("product", "product with a square")
WITH_CONSTANT = ("dead band", "hinge", "tanh")
THROTTLE = "throttle alone"

HELD = {
    ("drag", "alpha^2"): "drag_alpha2",
    ("drag", "abs(beta)"): "drag_beta2, which the model has",
    ("drag", "beta^2"): "drag_beta2, which the model has",
    ("drag", "abs(elevator)"): "drag_elevator_abs, which the model has",
    ("drag", "throttle"): "thrust_scale",
    ("roll", "throttle"): "motor_torque",
    ("pitch", "throttle"): "thrust_line_offset",
    ("yaw", "throttle"): "thrust_line_sideways",
    ("pitch", "alpha^3"): "pitch_break",
    ("pitch", "elevator^3"): "effectiveness_saturation, which has the aileron as well",
    ("roll", "aileron^3"): "effectiveness_saturation, which has the elevator as well",
    ("roll", "alpha*beta"): "dihedral_alpha",
    ("roll", "alpha*r_hat"): "lateral_with_lift",
    ("yaw", "alpha*beta"): "lateral_with_lift",
    ("yaw", "alpha*p_hat"): "lateral_with_lift",
    ("roll", "alpha*aileron"): "roll_control_alpha",
    ("yaw", "alpha*aileron"): "roll_control_alpha",
}
"""Formulas that an effect of the catalogue is, alone or beside coefficients of the model: they are not drawn."""


@dataclass
class Formula:
    """A hidden formula: `amount` times the form, times `factor`."""

    channel: str
    form: str
    variables: list
    constant: float
    amount: float

    @property
    def factor(self):
        """What the form is multiplied by besides."""
        return "1" if self.form in (THROTTLE, "lag without air") else FACTORS[self.channel]

    @property
    def shape(self):
        """The form with its variables."""
        v, w = (*self.variables, "")[:2]
        return (FORMS | LAGGED)[self.form][0].format(v=v, w=w, c=f"{self.constant:g}")

    @property
    def trend(self):
        """Parity by variable."""
        parity = zip(self.variables, (FORMS | LAGGED)[self.form][1])
        return {name: "grows" if name == "throttle" else of for name, of in parity}

    def text(self):
        """The formula in one line."""
        factor = "" if self.factor == "1" else f"{self.factor}*"
        return f"{self.channel} = {self.amount:g}*{factor}{self.shape}"

    def record(self):
        """What truth.json says of it."""
        return {**asdict(self), "factor": self.factor, "shape": self.shape, "trend": self.trend, "text": self.text()}

    def figures(self):
        """The numbers that the equations take: channel and form from one on, variables from zero."""
        places = [list(VARIABLES).index(v) for v in self.variables]
        # behind the variables stands what a lag makes of the second one
        first = len(VARIABLES) if self.form in LAGGED else places[0]
        return {
            "formula_channel": 1.0 + list(CHANNELS).index(self.channel),
            "formula_form": 1.0 + list(FORMS | LAGGED).index(self.form),
            "formula_first": float(first),
            "formula_second": float(places[-1]),
            "formula_constant": self.constant,
            "formula_amount": self.amount,
        }


def drawn(random, strength=1.0):
    """A formula that neither the catalogue nor the model holds; `strength` is a factor on its amount."""
    while True:
        formula = anything(random, strength)
        if (formula.channel, formula.shape) not in HELD:
            return formula


def drawn_lagged(random, strength=1.0):
    """A control through a lag, where neither the catalogue nor the model holds it."""
    while True:
        channel, variable = str(random.choice(list(CHANNELS))), str(random.choice(CONTROLS))
        without_air = variable == "throttle" and random.uniform() < 0.5
        if without_air and channel == "drag":  # the thrust of an engine that takes time: thrust_lag
            continue
        low, high = LAGS
        constant = float(f"{low * (high / low) ** random.uniform():.2g}")
        times, sign = random.uniform(1.0, 2.0), random.choice((-1.0, 1.0))
        size = WITHOUT_AIR[channel] if without_air else CHANNELS[channel]
        amount = float(f"{sign * times * strength * size / VARIABLES[variable]:.4g}")
        return Formula(channel, "lag without air" if without_air else "lag", [variable], constant, amount)


def anything(random, strength=1.0):
    """A formula of the grammar; at the size of its variables, `strength` times one to two amounts of its channel."""
    channel, form = random.choice(list(CHANNELS)), random.choice(list(FORMS))
    first = "throttle" if form == THROTTLE else random.choice(list(VARIABLES)[:-1])
    second = random.choice([v for v in VARIABLES if v != first])
    share, times, sign = random.uniform(0.3, 0.7), random.uniform(1.0, 2.0), random.choice((-1.0, 1.0))
    variables = [str(first), str(second)] if form in OF_TWO else [str(first)]
    if form == "product":  # the order of the table, so that one product has one text
        variables.sort(key=list(VARIABLES).index)
    constant = float(f"{share * VARIABLES[first]:.2g}") if form in WITH_CONSTANT else 0.0
    sizes = [VARIABLES[v] for v in variables]
    full = form_of(1 + list(FORMS).index(form), sizes[0], sizes[-1], constant)
    size = WITHOUT_AIR[channel] if form == THROTTLE else CHANNELS[channel]
    return Formula(str(channel), str(form), variables, constant, float(f"{sign * times * strength * size / full:.4g}"))


@compiled
def form_of(form, v, w, c):
    """The form of that number, from one on, of its variables."""
    if form == 1:
        return abs(v)
    if form == 2:
        return v * v
    if form == 3:
        return v * abs(v)
    if form == 4:
        return v * v * v
    if form == 5:
        return v - min(max(v, -c), c)
    if form == 6:
        return max(v - c, 0.0)
    if form == 7:
        return math.tanh(v / c)
    if form == 8:
        return v * w
    if form == 9:
        return v * w * w
    return v
