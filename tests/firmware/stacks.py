"""How each firmware is started on the JSBSim X8 of `greylag-sitl`, and how it is spoken to."""

import math
import pathlib
import time

from flight import Failure, Program, check, say
from pymavlink import mavutil
from relay import TcpRelay, UdpRelay

mavlink = mavutil.mavlink
COMMAND_SECONDS = 3.0

# What the aircraft and the companion need is shipped once; what a simulation without a pilot needs besides stands here.
SHIPPED = pathlib.Path(__file__).resolve().parents[2] / "params" / "x8"


def shipped(name):
    """The parameters of a shipped file: a name and a value a line."""
    lines = (line.split("#")[0].split() for line in (SHIPPED / name).read_text().splitlines())
    return {words[0]: float(words[1]) for words in lines if words}


ARDUPLANE = {
    **shipped("arduplane.parm"),
    "SERVO1_FUNCTION": 4, "SERVO2_FUNCTION": 19, "SERVO3_FUNCTION": 70, "SERVO4_FUNCTION": 21, "SERVO3_TRIM": 1000,
    "ARSPD_TYPE": 100, "ARSPD_USE": 1, "ARSPD_PIN": 1,
    "TKOFF_ALT": 100, "TKOFF_LVL_ALT": 10, "TKOFF_THR_MINACC": 0, "TKOFF_THR_DELAY": 0,
    # RTL keeps its height: the descent to 100 m that it is shipped with would count as height lost.
    "RTL_ALTITUDE": -1,
    "ARMING_SKIPCHK": -1, "ARMING_CHECK": 0, "LOG_DISARMED": 0, "LOG_BITMASK": 65535,
}  # fmt: skip


class Station:
    """A ground station on a port of the firmware itself: it sees what the firmware does."""

    def __init__(self, address, seconds=60.0):
        self.link = mavutil.mavlink_connection(
            address, source_system=254, source_component=190, retries=30
        )
        self.modes, self.texts, self.state = [], [], {}
        self.beat = 0.0
        self.until(lambda m: self.own(m) and m.get_type() == "HEARTBEAT", "heartbeat", seconds)
        self.every(mavlink.MAVLINK_MSG_ID_ATTITUDE, 20)
        self.every(mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, 5)

    @staticmethod
    def own(message):
        return (message.get_srcSystem(), message.get_srcComponent()) == (1, 1)

    def every(self, number, hz):
        """Asks for a message at a rate."""
        self.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, number, 1e6 / hz, wait=False)

    def turn(self):
        """Takes in what has come, for a twentieth of a second at most."""
        now = time.monotonic()
        if now >= self.beat:
            self.beat = now + 1.0
            self.link.mav.heartbeat_send(mavlink.MAV_TYPE_GCS, 8, 0, 0, 4)
        found, message = [], self.link.recv_match(blocking=True, timeout=0.05)
        while message is not None:
            if self.own(message):
                found.append(message)
                self.keep(message)
            message = self.link.recv_match(blocking=False)
        return found

    def keep(self, message):
        kind = message.get_type()
        self.state[kind] = message
        if kind == "HEARTBEAT" and (not self.modes or self.modes[-1][1] != message.custom_mode):
            self.modes.append((time.monotonic(), message.custom_mode))
        if kind == "STATUSTEXT":
            self.texts.append(message.text)
            print(f"  firmware: {message.text}", flush=True)

    def until(self, wanted, what, seconds=10.0):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            for message in self.turn():
                if wanted(message):
                    return message
        raise Failure(f"the firmware showed no {what} within {seconds:g} s")

    def run(self, seconds):
        """Goes on for a time; roll, pitch (deg) and height (m above the start) that were seen."""
        end, seen = time.monotonic() + seconds, []
        while time.monotonic() < end:
            for message in self.turn():
                if message.get_type() == "ATTITUDE":
                    attitude = math.degrees(message.roll), math.degrees(message.pitch)
                    seen.append((time.monotonic(), *attitude, self.height()))
        return seen

    def height(self):
        position = self.state.get("GLOBAL_POSITION_INT")
        return position.relative_alt / 1000.0 if position else 0.0

    def mode(self):
        return self.modes[-1][1] if self.modes else None

    def command(self, number, *params, wait=True):
        padded = [*params, *[0.0] * (7 - len(params))]
        self.link.mav.command_long_send(1, 1, number, 0, *padded)
        if wait:
            self.until(
                lambda m: m.get_type() == "COMMAND_ACK" and m.command == number,
                f"answer to command {number}", COMMAND_SECONDS,
            )  # fmt: skip

    def set(self, name, value):
        """Sets a parameter and waits for its echo; False if the firmware has none of this name."""
        self.link.mav.param_set_send(1, 1, name.encode(), value, mavlink.MAV_PARAM_TYPE_REAL32)
        try:
            self.until(
                lambda m: m.get_type() == "PARAM_VALUE" and m.param_id == name, name, 2.0
            )
        except Failure:
            return False
        return True


def end(stack):
    """Ends what has been started of a stack."""
    if stack.relay:
        stack.relay.close()
    for program in (stack.firmware, stack.simulator):
        if program:
            program.process.kill()
            program.process.wait()


class ArduPlane:
    """ArduPlane's SITL, through its JSON interface."""

    name, profile = "ArduPlane", "ardupilot"
    steered = {"attitude": 15, "surfaces": 0}
    # LOITER: where the companion hands back to
    hold, other = 12, 11
    log_names = ("*.BIN", "logs/*.BIN")

    def __init__(self):
        self.simulator = self.firmware = self.station = self.relay = None
        self.high = 0.0

    def start(self, arguments, room, parameters):
        """Starts simulator and firmware, and listens to it."""
        self.simulator = Program(
            "simulator",
            [arguments.sitl, "--ardupilot-sim", "--truth", room / "truth.csv", *arguments.sitl_option],
        )
        home = self.simulator.wait_for("--home", 20.0).split("--home")[1].split()[0].strip("`,;)")
        file = room / "acceptance.parm"
        settings = {**ARDUPLANE, **parameters}
        # turbulence carries an aircraft far down or up in fifty engagements: TKOFF_ALT=500 leaves room
        self.high = 0.8 * settings["TKOFF_ALT"]
        file.write_text("".join(f"{k} {v:g}\n" for k, v in settings.items()))
        command = [pathlib.Path(arguments.firmware).resolve(), "--wipe", "--model", "JSON:127.0.0.1"]
        self.firmware = Program(
            "arduplane", [*command, "--home", home, "--defaults", file, "--speedup", 1], cwd=room
        )
        self.station = Station("tcp:127.0.0.1:5760")
        self.relay = TcpRelay(arguments.port, 5762).start()
        self.vehicle = f"tcpout:127.0.0.1:{arguments.port}"

    def take_off(self):
        """Thrown by the catapult; climbs, then loiters."""
        station = self.station
        end = time.monotonic() + 300.0
        while not any("is using GPS" in text for text in station.texts) and time.monotonic() < end - 260.0:
            station.run(1.0)
        while not station.modes or station.mode() != 13:
            check(time.monotonic() < end, "ArduPlane does not go to TAKEOFF")
            self.to_mode(13)
            station.run(1.0)
        armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED
        while not station.state["HEARTBEAT"].base_mode & armed:
            check(time.monotonic() < end, "ArduPlane does not arm")
            station.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1, wait=False)
            station.run(1.0)
        while station.height() < self.high:
            check(time.monotonic() < end, "ArduPlane does not climb")
            station.run(1.0)
        self.to_mode(self.hold)
        station.run(8.0)
        say(f"{self.name} flies, {station.height():.0f} m above its start")

    def to_mode(self, number):
        """The ground station's own change of mode."""
        self.station.link.mav.command_long_send(1, 1, mavlink.MAV_CMD_DO_SET_MODE, 0, 1, number, 0, 0, 0, 0, 0)

    @staticmethod
    def radios(authority):
        """With which radios a death of the companion is tried."""
        return [True, False] if authority == "surfaces" else [True]

    def radio(self, bound):
        """Binds or takes away the pilot's radio, whose sticks are released: neutral, throttle closed."""
        self.station.set("SIM_RC_FAIL", 0 if bound else 1)

    def end(self):
        end(self)


class Px4:
    """PX4's SITL; `firmware` is the folder of its build, px4_sitl_default."""

    name, profile = "PX4", "px4"
    steered = {"attitude": 6 << 16, "surfaces": 1 << 16}
    hold, other = 4 << 16 | 3 << 24, 4 << 16 | 5 << 24
    log_names = ("**/*.ulg",)
    settings = {**shipped("px4.parm"), "SDLOG_PROFILE": 155, "RWTO_TKOFF": 0, "MIS_TAKEOFF_ALT": 150}

    def __init__(self):
        self.simulator = self.firmware = self.station = self.relay = None

    def start(self, arguments, room, parameters):
        """Starts simulator and firmware, and listens to it."""
        self.simulator = Program(
            "simulator", [arguments.sitl, "--px4-sim", "--truth", room / "truth.csv", "--start-altitude-m", "50", *arguments.sitl_option]
        )
        self.simulator.wait_for("4560", 20.0)
        build = pathlib.Path(arguments.firmware).resolve()
        environment = {f"PX4_PARAM_{k}": f"{v:g}" for k, v in {**self.settings, **parameters}.items()}
        environment |= {"PX4_SYS_AUTOSTART": "1036", "PX4_SIM_MODEL": "jsbsim_malolo", "PATH": "/usr/bin:/bin"}
        self.firmware = Program(
            "px4", [build / "bin/px4", "-d", build / "etc", "-w", room], cwd=room, env=environment
        )
        self.station = Station("udpin:127.0.0.1:14550")
        self.relay = UdpRelay(14540, arguments.port).start()
        self.vehicle = f"udpin:127.0.0.1:{arguments.port}"

    def take_off(self):
        station, end = self.station, time.monotonic() + 120.0
        # On the stand PX4's height controller begins at sea level and follows at 3 m/s.
        station.run(20.0)
        armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED
        while not station.state["HEARTBEAT"].base_mode & armed:
            check(time.monotonic() < end, "PX4 does not arm")
            station.link.mav.command_long_send(1, 1, mavlink.MAV_CMD_DO_SET_MODE, 0, 1, 4, 2, 0, 0, 0, 0)
            station.run(0.5)
            station.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1, wait=False)
            station.run(1.0)
        while station.height() < 120.0:
            check(time.monotonic() < end, "PX4 does not climb")
            station.run(1.0)
        self.to_mode(self.hold)
        station.run(8.0)
        say(f"{self.name} flies, {station.height():.0f} m above its start")

    def to_mode(self, number):
        main, sub = number >> 16 & 0xFF, number >> 24
        self.station.link.mav.command_long_send(1, 1, mavlink.MAV_CMD_DO_SET_MODE, 0, 1, main, sub, 0, 0, 0, 0)

    @staticmethod
    def radios(_):
        """There is none beside its simulator."""
        return [False]

    def radio(self, _):
        """There is none."""

    def end(self):
        end(self)


STACKS = {"arduplane": ArduPlane, "px4": Px4}
