"""A flight with MAVProxy's own command line, typed into it as a user would."""

import math
import pathlib
import re
import subprocess
import sys
import time

import flight
from flight import NEAR_DEG, PITCH_DEG, ROLL_DEG, check, quaternion, say
from pymavlink import mavutil

# MAVProxy names the modes of ArduPilot and PX4 only; of others it shows the number.
HOLD, OFFBOARD = 4 << 16 | 3 << 24, 6 << 16


class MavProxy(flight.Program):
    """MAVProxy, with what is typed into it."""

    def __init__(self, address, watcher, folder):
        program = pathlib.Path(sys.executable).parent / "mavproxy.py"
        command = [sys.executable, program, f"--master={address}", f"--out={watcher}", "--no-state"]
        super().__init__("mavproxy", command, stdin=subprocess.PIPE, cwd=folder)

    def type(self, line, answer=None, seconds=10.0):
        """Types a line, then waits for what MAVProxy shows in answer."""
        say(f"typing {line!r}")
        shown = len(self.lines)
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()
        return self.wait_for(answer, seconds, after=shown) if answer else None


class Watcher:
    """What MAVProxy forwards to its --out, which says what came of it."""

    def __init__(self, address):
        self.link = mavutil.mavlink_connection(address)

    def until(self, kind, wanted, what, seconds=10.0):
        """The first message of a kind that is as wanted."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            message = self.link.recv_match(type=kind, blocking=True, timeout=0.2)
            # MAVProxy forwards its own heartbeats as well.
            if message and message.get_srcSystem() == 1 and wanted(message):
                return message
        raise flight.Failure(f"no {what} within {seconds:g} s")

    def until_mode(self, custom_mode):
        """Waits for a heartbeat in a mode."""
        self.until("HEARTBEAT", lambda m: m.custom_mode == custom_mode, f"mode {custom_mode:#x}")

    def until_attitude(self, roll_deg, pitch_deg):
        """Waits until the attitude has been near for two seconds."""
        since = last = None

        def settled(message):
            nonlocal since, last
            last = (math.degrees(message.roll), math.degrees(message.pitch))
            near = max(abs(last[0] - roll_deg), abs(last[1] - pitch_deg)) <= NEAR_DEG
            since = (since or time.monotonic()) if near else None
            return since is not None and time.monotonic() - since >= 2.0

        try:
            self.until("ATTITUDE", settled, "settled attitude", 20.0)
        finally:
            say(f"attitude {last} degrees for {roll_deg:g} / {pitch_deg:g}")


def set_parameters(proxy, watcher):
    """All are fetched on connection; one is shown, one set, one refused."""
    line = proxy.wait_for("Received", 20.0)
    say(f"parameters: {line}")
    counts = re.search(r"Received (\d+) parameters", line)
    check(counts is not None and int(counts[1]) >= 14, f"too few parameters: {line}")
    proxy.type("param show GL_BANK_MAX_DEG", "GL_BANK_MAX_DEG")
    proxy.type("param set GL_BANK_MAX_DEG 50")

    def is_50(message):
        return message.param_id == "GL_BANK_MAX_DEG" and message.param_value == 50.0

    watcher.until("PARAM_VALUE", is_50, "echo of GL_BANK_MAX_DEG")
    proxy.type("param set GL_BANK_MAX_DEG 500", "GL_BANK_MAX_DEG refused")
    watcher.until("PARAM_VALUE", is_50, "old value of GL_BANK_MAX_DEG after the refusal")
    proxy.type("param fetch GL_BANK_MAX_DEG", "GL_BANK_MAX_DEG = 50")


def fly(proxy, watcher):
    """Arms, flies an attitude, holds, disarms."""
    set_parameters(proxy, watcher)
    proxy.type("long DO_SET_MODE 1 6", "arm first")
    proxy.type("arm throttle", "COMPONENT_ARM_DISARM: ACCEPTED")
    armed = mavutil.mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    watcher.until("HEARTBEAT", lambda m: m.base_mode & armed, "armed heartbeat")

    # MAVProxy's `attitude` sends one setpoint; `repeat` makes a stream of it.
    q = " ".join(f"{part:.7f}" for part in quaternion(ROLL_DEG, PITCH_DEG))
    proxy.type(f"repeat add 0.2 attitude {q} 0.5", "thrust:0.5")
    # PX4's main mode 6 is OFFBOARD.
    proxy.type("long DO_SET_MODE 1 6", "DO_SET_MODE: ACCEPTED")
    watcher.until_mode(OFFBOARD)
    watcher.until_attitude(ROLL_DEG, PITCH_DEG)

    say("`mode` takes the number that MAVProxy shows, and refuses a mode of ArduPilot's in words")
    proxy.type("mode FBWA", "not a mode of this autopilot")
    proxy.type(f"mode {HOLD}")
    watcher.until_mode(HOLD)
    proxy.type("repeat clean")
    watcher.until("ATTITUDE", lambda m: abs(m.roll) < 0.01, "level wings in HOLD")

    proxy.type("disarm", "flying at")
    proxy.type("disarm force", "COMPONENT_ARM_DISARM: ACCEPTED")
    watcher.until("HEARTBEAT", lambda m: not m.base_mode & armed, "disarmed heartbeat")


def main():
    """Flies."""
    arguments = flight.arguments(__doc__)
    port, forwarded = flight.free_ports(2)
    # The way of MAVProxy to a simulator: TCP, as to ArduPilot's 5760.
    with flight.Flight(arguments, [f"tcpin:127.0.0.1:{port}"]) as flown:
        watcher = Watcher(f"udpin:127.0.0.1:{forwarded}")
        proxy = MavProxy(f"tcp:127.0.0.1:{port}", f"udp:127.0.0.1:{forwarded}", flown.folder)
        try:
            fly(proxy, watcher)
        finally:
            proxy.process.stdin.close()
            proxy.process.kill()
            proxy.process.wait()
        alarms = [line for line in proxy.lines if "breach" in line or "Failed to load" in line]
        check(not alarms, f"MAVProxy raised alarms: {alarms}")
        flown.land()


flight.run(main, 180)
