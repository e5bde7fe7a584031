"""A flight with MAVProxy's own command line, typed into it as a user would."""

import re

import flight
from flight import PITCH_DEG, ROLL_DEG, check, quaternion, say
from mavproxy_console import MavProxy, Watcher
from pymavlink import mavutil

# MAVProxy names the modes of ArduPilot and PX4 only; of others it shows the number.
HOLD, OFFBOARD = 4 << 16 | 3 << 24, 6 << 16


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
