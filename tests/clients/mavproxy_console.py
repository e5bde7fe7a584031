"""MAVProxy with what is typed into it, and what it forwards."""

import math
import pathlib
import subprocess
import sys
import time

import flight
from flight import NEAR_DEG, say
from pymavlink import mavutil


class MavProxy(flight.Program):
    """MAVProxy, with what is typed into it."""

    def __init__(self, address, watcher, folder, *options):
        program = pathlib.Path(sys.executable).parent / "mavproxy.py"
        command = [sys.executable, program, f"--master={address}", f"--out={watcher}", "--no-state"]
        command += options
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

    def until_attitude(self, roll_deg, pitch_deg, near_deg=NEAR_DEG):
        """Waits until the attitude has been near for two seconds."""
        since = last = None

        def settled(message):
            nonlocal since, last
            last = (math.degrees(message.roll), math.degrees(message.pitch))
            near = max(abs(last[0] - roll_deg), abs(last[1] - pitch_deg)) <= near_deg
            since = (since or time.monotonic()) if near else None
            return since is not None and time.monotonic() - since >= 2.0

        try:
            self.until("ATTITUDE", settled, "settled attitude", 20.0)
        finally:
            say(f"attitude {last} degrees for {roll_deg:g} / {pitch_deg:g}")
