"""The official JSBSim (PyPI) as a truth: the repository's X8 at 400 Hz, an effect written into its XML."""

import copy
import math
import tempfile
import xml.etree.ElementTree as ET
from pathlib import Path

import jsbsim
import numpy as np

import aircraft as x8
from pilot import PERIOD, command

STEP = 0.0025
PER_COMMAND = round(PERIOD / STEP)
SOURCE = Path(__file__).resolve().parents[2] / "sitl" / "aircraft" / "x8"
FOOT, POUND = 0.3048, 4.4482216152605
TORQUE = FOOT * POUND
QS = ("aero/qbar-psf", "metrics/Sw-sqft")
POSITIONS = {"aileron": "fcs/effective-aileron-pos", "elevator": "fcs/elevator-pos-rad"}
THROTTLE = "fcs/throttle-pos-norm"
THRUST = "propulsion/engine/thrust-lbs"
HALF_CHORD_TIMES_RATE = ("aero/ci2vel", "aero/alphadot-rad_sec")


def product(*terms):
    """A product of numbers, names of properties and elements."""
    return operation("product", *terms)


def operation(tag, *terms):
    """An element of JSBSim's functions."""
    out = ET.Element(tag)
    for term in terms:
        if isinstance(term, ET.Element):
            out.append(term)
        elif isinstance(term, str):
            ET.SubElement(out, "property").text = term
        else:
            ET.SubElement(out, "value").text = repr(float(term))
    return out


class Document:
    """The aircraft's XML while an effect is written into it."""

    def __init__(self):
        self.root = ET.parse(SOURCE / "x8.xml").getroot()

    def axis(self, name):
        """An axis of the aerodynamics."""
        return self.root.find(f"aerodynamics/axis[@name='{name}']")

    def add(self, axis, name, expression):
        """A further function of an axis (lbf, lbf ft)."""
        function = ET.SubElement(self.axis(axis), "function", name=f"truth/{name}")
        function.append(expression)

    def set(self, path, change):
        """Replaces a number of the mass balance."""
        element = self.root.find(path)
        element.text = repr(change(float(element.text)))

    def number(self, axis, old, new):
        """Replaces the coefficient `old` of an axis."""
        found = [v for v in self.axis(axis).iter("value") if math.isclose(float(v.text), old)]
        assert len(found) == 1, (axis, old, len(found))
        found[0].text = repr(new)

    def read_instead(self, surface, name, axes=("DRAG", "SIDE", "LIFT", "ROLL", "PITCH", "YAW")):
        """Lets the aerodynamics of `axes` read the property `name` for a surface's position."""
        for axis in axes:
            for element in self.axis(axis).iter("property"):
                if element.text.strip() == POSITIONS[surface]:
                    element.text = name

    def pass_through(self, component, settings):
        """Passes both surfaces' positions through a component of the flight control."""
        channel = ET.SubElement(self.root.find("flight_control"), "channel", name="truth")
        for surface, position in POSITIONS.items():
            element = ET.SubElement(channel, component, name=f"truth/{surface}")
            ET.SubElement(element, "input").text = position
            for tag, attributes, value in settings:
                ET.SubElement(element, tag, attributes).text = repr(value)
            self.read_instead(surface, f"truth/{surface}")

    def scale(self, factor, axes=("DRAG", "SIDE", "LIFT", "ROLL", "PITCH", "YAW"), surfaces=tuple(POSITIONS)):
        """Multiplies the positions of `surfaces` by `factor(position)` where they act."""
        for surface in surfaces:
            position = POSITIONS[surface]
            function = ET.Element("function", name=f"truth/{surface}")
            function.append(product(position, factor(position)))
            self.read_instead(surface, f"truth/{surface}", axes)
            self.root.find("aerodynamics").insert(0, function)

    def push(self, expression):
        """A further force along body x, lbf."""
        reactions = ET.SubElement(self.root, "external_reactions")
        force = ET.SubElement(reactions, "force", name="truth", frame="BODY")
        ET.SubElement(force, "function", name="truth/force").append(expression)
        for tag, values in (("location", "000"), ("direction", "100")):
            at = ET.SubElement(force, tag, {"unit": "M"} if tag == "location" else {})
            for axis, value in zip("xyz", values):
                ET.SubElement(at, axis).text = value


def stall(d, a):
    """The aircraft's own lift table is what the model lacks."""


def lift_lag(d, a):
    """Lift and pitching moment by the rate of alpha."""
    d.add("LIFT", "lift", product(*QS, a, *HALF_CHORD_TIMES_RATE))
    d.add("PITCH", "pitch", product(*QS, "metrics/cbarw-ft", -0.5 * a, *HALF_CHORD_TIMES_RATE))


def gyro(d, a):
    """Moments of a rotor along body x."""
    d.add("PITCH", "pitch", product(a / TORQUE, "velocities/r-rad_sec"))
    d.add("YAW", "yaw", product(-a / TORQUE, "velocities/q-rad_sec"))


def decay(d, a):
    """Thrust that falls with airspeed."""
    over = operation("sum", a, product(-a * FOOT / x8.REFERENCE_SPEED, "velocities/vt-fps"))
    d.push(product(over, THRUST))


def spool(d, a):
    """Thrust that follows a lag; what the filter reads is a frame old."""
    channel = ET.SubElement(d.root.find("flight_control"), "channel", name="truth")
    element = ET.SubElement(channel, "lag_filter", name="truth/thrust")
    ET.SubElement(element, "input").text = THRUST
    ET.SubElement(element, "c1").text = repr(1.0 / a)
    d.push(operation("sum", "truth/thrust", product(-1.0, THRUST)))


def wash(d, a):
    """Deflections that act more with throttle."""
    factor = operation("sum", 1.0 - a * x8.REFERENCE_THROTTLE, product(a, THROTTLE))
    d.scale(lambda _: copy.deepcopy(factor))


def twist(d, a):
    """Deflections that act less with dynamic pressure."""
    square = product(-a * (FOOT / x8.REFERENCE_SPEED) ** 2, "velocities/vt-fps", "velocities/vt-fps")
    d.scale(lambda _: copy.deepcopy(operation("sum", 1.0 + a, square)))


def saturate(d, a):
    """Deflections that act less when large, in roll and pitch."""
    d.scale(lambda position: operation("sum", 1.0, product(a, position, position)), ("ROLL", "PITCH"))


def bent(d, a):
    """Constant coefficients of roll, yaw and side force."""
    d.add("ROLL", "roll", product(*QS, "metrics/bw-ft", a))
    d.add("YAW", "yaw", product(*QS, "metrics/bw-ft", a))
    d.add("SIDE", "side", product(*QS, a))


def delay(d, a):
    """A pure delay of whole frames; JSBSim's actuator delays by one frame less than it is given."""
    d.pass_through("actuator", [("delay", {"type": "frames"}, round(a / STEP) + 1)])


def servo(surface):
    """A surface whose gain is 1 + a on the positive side and 1 - a on the other."""

    def write(d, a):
        channel = ET.SubElement(d.root.find("flight_control"), "channel", name="truth")
        element = ET.SubElement(channel, "aerosurface_scale", name=f"truth/{surface}")
        ET.SubElement(element, "input").text = POSITIONS[surface]
        for tag, ends in (("domain", (-1.0, 1.0)), ("range", (a - 1.0, a + 1.0))):
            part = ET.SubElement(element, tag)
            for name, end in zip(("min", "max"), ends):
                ET.SubElement(part, name).text = repr(end)
        d.read_instead(surface, f"truth/{surface}")

    return write


def curve(surface):
    """A surface whose gain is 1 + a times the size of its deflection."""

    def factor(position, a):
        return operation("sum", 1.0, product(a, operation("abs", position)))

    return lambda d, a: d.scale(lambda position: factor(position, a), surfaces=(surface,))


def along_alpha(*others):
    """A rolling moment by alpha times other properties."""
    return lambda d, a: d.add("ROLL", "roll", product(*QS, "metrics/bw-ft", a, "aero/alpha-rad", *others))


WRITE = {
    "drag_alpha2": lambda d, a: d.add("DRAG", "drag", product(*QS, a, "aero/alpha-rad", "aero/alpha-rad")),
    "drag_beta2": lambda d, a: d.number("DRAG", 0.1478, a),
    "drag_elevator_abs": lambda d, a: d.number("DRAG", 0.0633, a),
    "lift_stall": stall,
    "pitch_break": lambda d, a: d.add(
        "PITCH", "pitch", product(*QS, "metrics/cbarw-ft", a, *3 * ("aero/alpha-rad",))
    ),
    "cg_shift": lambda d, a: d.set("mass_balance/location[@name='CG']/x", lambda x: x + a),
    "unsteady_lift": lift_lag,
    "thrust_decay": decay,
    "thrust_lag": spool,
    "thrust_scale": lambda d, a: d.push(product(a / POUND, THROTTLE)),
    "thrust_line_offset": lambda d, a: d.add("PITCH", "pitch", product(a / FOOT, THRUST)),
    "motor_torque": lambda d, a: d.add("ROLL", "roll", product(-a / TORQUE, THROTTLE)),
    "propeller_gyro": gyro,
    "propwash": wash,
    "aeroelastic_loss": twist,
    "actuator_lag": lambda d, a: d.pass_through("lag_filter", [("c1", {}, 1.0 / a)]),
    "time_delay": delay,
    "dead_zone": lambda d, a: d.pass_through("deadband", [("width", {}, 2.0 * a)]),
    "backlash": lambda d, a: d.pass_through("actuator", [("hysteresis_width", {}, a)]),
    "rate_limit": lambda d, a: d.pass_through("actuator", [("rate_limit", {}, a)]),
    "servo_aileron": servo("aileron"),
    "servo_elevator": servo("elevator"),
    "servo_aileron_curve": curve("aileron"),
    "servo_elevator_curve": curve("elevator"),
    "mass_error": lambda d, a: d.set("mass_balance/emptywt", lambda m: m * (1.0 + a)),
    # JSBSim's ixz is -Jxz
    "inertia_xz": lambda d, a: d.set("mass_balance/ixz", lambda i: i - a / TORQUE),
    "asymmetry": bent,
    "dihedral_alpha": along_alpha("aero/beta-rad"),
    "roll_control_alpha": along_alpha(POSITIONS["aileron"]),
    "effectiveness_saturation": saturate,
}
"""How each effect is written into the aircraft."""


def simulator(effect=None, amount=0.0):
    """JSBSim with the aircraft, `effect` hidden in it."""
    document = Document()
    if effect is not None:
        WRITE[effect](document, amount)
    jsbsim.FGJSBBase().debug_lvl = 0
    with tempfile.TemporaryDirectory() as root:
        folder = Path(root) / "aircraft" / "x8"
        folder.mkdir(parents=True)
        ET.ElementTree(document.root).write(folder / "x8.xml")
        engines = Path(root) / "engine"
        engines.mkdir()
        for file in (SOURCE / "Engines").iterdir():
            (engines / file.name).write_bytes(file.read_bytes())
        sim = jsbsim.FGFDMExec(root)
        sim.set_debug_level(0)
        sim.set_dt(STEP)
        if not sim.load_model("x8"):
            raise RuntimeError(f"loading the X8 with {effect} into JSBSim failed; look at its messages")
    return sim


INTEGRATORS = {"default": {}, "adams": {"rate/rotational": 4, "rate/translational": 4, "position/rotational": 3}}
"""JSBSim's integrators by its own numbers: explicit Euler for rates and attitude by default, at whatever step; or
Adams-Bashforth of third and second order. Euler's half step of 1.25 ms acts as a lag of every moment: with the X8's
damping of 29/s in roll, as 4 % more inertia than the file says."""


def integrate_by(sim, integrators):
    """Sets JSBSim's integrators."""
    for name, number in INTEGRATORS[integrators].items():
        sim[f"simulation/integrator/{name}"] = number


def start(sim, wind, heading):
    """Sets the aircraft flying: 18 m/s through the air, 600 m."""
    first = {
        "ic/lat-geod-deg": 46.8, "ic/h-sl-ft": 600.0 / FOOT, "ic/psi-true-rad": heading,
        "ic/theta-rad": 0.03, "ic/alpha-rad": 0.03, "ic/vt-fps": 18.0 / FOOT,
    }  # fmt: skip
    for name, value in first.items():
        sim[name] = value
    if not sim.run_ic():
        raise RuntimeError("JSBSim takes no such start")
    for axis, speed in zip(("north", "east", "down"), wind):
        sim[f"atmosphere/wind-{axis}-fps"] = speed / FOOT
    sim["propulsion/set-running"] = -1


SEEN = (
    ("attitude/phi-rad", 1.0), ("attitude/theta-rad", 1.0), ("attitude/psi-rad", 1.0), ("velocities/p-rad_sec", 1.0),
    ("velocities/q-rad_sec", 1.0), ("velocities/r-rad_sec", 1.0), ("velocities/vt-fps", FOOT), ("aero/alpha-rad", 1.0),
    ("aero/beta-rad", 1.0), ("forces/fbx-total-lbs", POUND), ("forces/fby-total-lbs", POUND),
    ("forces/fbz-total-lbs", POUND), ("velocities/v-north-fps", FOOT), ("velocities/v-east-fps", FOOT),
    ("velocities/v-down-fps", FOOT), ("position/h-sl-meters", 1.0), (POSITIONS["aileron"], 1.0),
    (POSITIONS["elevator"], 1.0), (THROTTLE, 1.0),
)  # fmt: skip
"""Where the columns of `sensors.TRUTH` are read, and their units; the forces are still to be divided by the mass."""


def fly(wanted, effect, amount, wind, heading, integrators="default"):
    """Truth (a row a step of 1/400 s) and commands of a plan, flown in a wind (NED, m/s), steady or one for each command."""
    sim = simulator(effect, amount)
    integrate_by(sim, integrators)
    winds = np.broadcast_to(wind, (len(wanted), 3)) / FOOT
    start(sim, winds[0] * FOOT, heading)
    blow = [sim.get_property_manager().get_node(f"atmosphere/wind-{axis}-fps") for axis in ("north", "east", "down")]
    nodes = [sim.get_property_manager().get_node(name) for name, _ in SEEN]
    units = np.array([unit for _, unit in SEEN])
    units[9:12] /= sim["inertia/mass-slugs"] * POUND / FOOT
    read = [node.get_double_value for node in nodes]
    to = [sim.get_property_manager().get_node(f"fcs/{c}-cmd-norm") for c in ("aileron", "elevator", "throttle")]
    truth, commands = np.zeros((PER_COMMAND * len(wanted), len(SEEN))), np.zeros((len(wanted), 3))
    memory, row = (0.0, 0.0, 0.0), 0
    for k, target in enumerate(wanted.tolist()):
        seen = tuple(read[j]() * units[j] for j in (0, 1, 3, 4, 5, 6))
        commands[k], memory = command(seen, tuple(target), memory)
        for node, value in zip(to, commands[k].tolist()):
            node.set_double_value(value)
        if np.ndim(wind) == 2:
            for node, value in zip(blow, winds[k].tolist()):
                node.set_double_value(value)
        for _ in range(PER_COMMAND):
            truth[row] = [get() for get in read]
            row += 1
            sim.run()
    return truth * units, commands
