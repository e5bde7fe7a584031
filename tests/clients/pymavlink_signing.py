"""Signed links: pymavlink with the right key flies, without a key or with another it is not heard."""

import os

# Before pymavlink is loaded: signatures need MAVLink 2.
os.environ["MAVLINK20"] = "1"

import pathlib  # noqa: E402
import subprocess  # noqa: E402
import tempfile  # noqa: E402
import time  # noqa: E402

import flight  # noqa: E402
from flight import PITCH_DEG, ROLL_DEG, check, say  # noqa: E402
from offboard import ARM, HOLD, SET_MODE, Offboard, mavlink  # noqa: E402
from pymavlink import mavutil  # noqa: E402

KEY = bytes(range(32))


class Signed(Offboard):
    """A client that signs, and believes nothing that is not signed with its key."""

    def __init__(self, address):
        self.unsigned = 0
        connect = mavutil.mavlink_connection

        def signing(*arguments, **options):
            link = connect(*arguments, **options)
            link.setup_signing(KEY, sign_outgoing=True, allow_unsigned_callback=self.refuse, link_id=7)
            return link

        mavutil.mavlink_connection = signing
        try:
            super().__init__(address)
        finally:
            mavutil.mavlink_connection = connect

    def refuse(self, _mav, _id):
        """Counts what came without a signature."""
        self.unsigned += 1
        return False


def stranger(address, key):
    """A client with another key, or with none, which is not to be served."""
    link = mavutil.mavlink_connection(address, source_system=254, source_component=190)
    if key:
        link.setup_signing(key, sign_outgoing=True, allow_unsigned_callback=lambda *_: True)
    heard, end = [], time.monotonic() + 1.5
    while time.monotonic() < end:
        link.mav.heartbeat_send(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 4)
        link.mav.command_long_send(1, 1, ARM, 0, 0, 21196, 0, 0, 0, 0, 0)
        message = link.recv_match(blocking=True, timeout=0.05)
        if message is not None and message.get_type() != "BAD_DATA":
            heard.append(message.get_type())
    link.close()
    return heard


def refused_key(arguments, folder):
    """A key that others may read ends the program at once."""
    key = folder / "open-key"
    key.write_text(KEY.hex())
    key.chmod(0o644)
    command = [arguments.greylag, "fly", "--no-record", "--sign", str(key)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)
    check(done.returncode != 0 and "chmod 600" in done.stderr, f"open key: {done.stderr}")
    say(done.stderr.strip())


def main():
    """Flies."""
    arguments = flight.arguments(__doc__)
    port, local = flight.free_ports(2)
    with tempfile.TemporaryDirectory(prefix="greylag-key-") as room:
        folder = pathlib.Path(room)
        refused_key(arguments, folder)
        key = folder / "key"
        key.write_text(KEY.hex() + "\n")
        key.chmod(0o600)
        options = ["--sign", str(key), "--local", f"udpin:127.0.0.1:{local}"]
        with flight.Flight(arguments, [f"udpin:127.0.0.1:{port}"], options=options) as flown:
            client = Signed(f"udpout:127.0.0.1:{port}")
            client.arm()
            client.engage(ROLL_DEG, PITCH_DEG)
            say("strangers: without a key, then with another")
            for other in [None, bytes(32)]:
                # They must not even learn that somebody is there.
                heard = stranger(f"udpout:127.0.0.1:{port}", other)
                check(not heard, f"a stranger was answered: {heard}")
            client.until_text("without a right signature are refused")
            say("on the local link nothing is signed")
            heard = stranger(f"udpout:127.0.0.1:{local}", None)
            check("HEARTBEAT" in heard and "COMMAND_ACK" in heard, f"the local link heard {heard}")
            client.arm()
            client.engage(ROLL_DEG, PITCH_DEG)
            client.until_attitude(ROLL_DEG, PITCH_DEG)
            check(client.unsigned == 0, f"{client.unsigned} unsigned frames came")
            check(client.command(SET_MODE, 1, *HOLD) == mavlink.MAV_RESULT_ACCEPTED, "HOLD")
            client.link.close()
            check(flown.companion.end() == 0, "the companion did not end well")
            check(flown.shim.end() == 0, "the shim did not end well")
            line = flown.companion.wait_for("signatures: ")
            check(" 0 false" not in line and "refused: 0 " not in line, line)
        stamp = int((folder / "key.stamp").read_text())
        now = int((time.time() - 1420070400) * 100_000)
        # 10 µs each: what was kept is of the last moments of the flight.
        check(0 <= now - stamp < 3_000_000, f"the timestamp kept is {(now - stamp) * 1e-5:.1f} s old")


flight.run(main, 120)
