"""MAVProxy's command line through the routing companion: it flies the controller behind it."""

import re

import flight
from flight import OWN_ERROR_DEG, PITCH_DEG, ROLL_DEG, check, quaternion, say
from mavproxy_console import MavProxy, Watcher

# PX4's HOLD and OFFBOARD.
HOLD, OFFBOARD = 4 << 16 | 3 << 24, 6 << 16


def patient(proxy, watcher):
    """Has PX4 wait ten seconds for setpoints; typed again where MAVProxy has not heard of it in time."""
    is_set = lambda m: m.param_id == "COM_OF_LOSS_T" and m.param_value == 10.0
    for attempt in range(4):
        proxy.type("param set COM_OF_LOSS_T 10")
        try:
            return watcher.until("PARAM_VALUE", is_set, "echo of COM_OF_LOSS_T")
        except flight.Failure as failure:
            if attempt == 3:
                raise
            say(f"{failure}: again")


def fly(proxy, watcher):
    """Parameters of the controller, OFFBOARD, an attitude, HOLD."""
    proxy.wait_for("Detected vehicle 1:1 ", 60.0)
    line = proxy.type("param fetch", "Received", 30.0)
    counts = re.search(r"Received (\d+) parameters", line)
    check(counts is not None and int(counts[1]) == 14, f"not PX4's 14 parameters: {line}")
    # A busy machine does not let MAVProxy repeat itself within PX4's half second; what is tested is the way.
    patient(proxy, watcher)
    watcher.until_mode(HOLD)
    q = " ".join(f"{part:.7f}" for part in quaternion(ROLL_DEG, PITCH_DEG))
    proxy.type(f"repeat add 0.1 attitude {q} 0.5", "thrust:0.5")
    proxy.type("long DO_SET_MODE 1 6", "DO_SET_MODE: ACCEPTED")
    watcher.until_mode(OFFBOARD)
    watcher.until_attitude(ROLL_DEG, PITCH_DEG, OWN_ERROR_DEG)
    say("HOLD")
    proxy.type("long DO_SET_MODE 1 4 3", "DO_SET_MODE: ACCEPTED")
    watcher.until_mode(HOLD)
    proxy.type("repeat clean")


def main():
    """Flies."""
    arguments = flight.arguments(__doc__)
    port, watched = flight.free_ports(2)
    with flight.Flight(arguments, [f"tcpin:127.0.0.1:{port}"], "px4") as flown:
        watcher = Watcher(f"udpin:127.0.0.1:{watched}")
        # MAVProxy takes whatever it hears first for its vehicle, also the companion.
        target = ["--target-system=1", "--target-component=1"]
        addresses = [f"tcp:127.0.0.1:{port}", f"udp:127.0.0.1:{watched}"]
        proxy = MavProxy(*addresses, flown.folder, *target)
        try:
            fly(proxy, watcher)
        finally:
            proxy.process.stdin.close()
            proxy.process.kill()
            proxy.process.wait()
        flown.end()


flight.run(main, 200)
