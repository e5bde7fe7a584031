"""Shim and companion, started for one scripted flight and watched until its end."""

import argparse
import csv
import math
import pathlib
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time

# ArduPlane's parameters as the docs ship them
PARAMETERS = str(pathlib.Path(__file__).resolve().parents[2] / "params/x8/arduplane.parm")
# The attitude that every client flies, degrees, and how near it has to come.
ROLL_DEG, PITCH_DEG, NEAR_DEG = 20.0, 5.0, 0.5
# What a controller's own loops leave by themselves: the companion routes, and trims nothing. PX4's, played as the real
# ones fly, leave 3 to 4 degrees of pitch for half a minute at half thrust.
OWN_ERROR_DEG = 5.0
# Largest step of a surface between two cycles: 20 a second at 100 Hz (GL_SLEW_SURF), rounded.
SURFACE_STEP = 0.2 + 1e-6


class Failure(Exception):
    """Something is not as mavlink.md has it."""


def check(holds, words):
    """Ends the script with `words` unless it holds."""
    if not holds:
        raise Failure(words)


def say(words):
    """One line of what is being done."""
    print(words, flush=True)


def free_ports(count):
    """Ports of this machine that were free for UDP and TCP a moment ago."""
    held, ports = [], []
    while len(ports) < count:
        datagrams = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        stream = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        held += [datagrams, stream]
        datagrams.bind(("127.0.0.1", 0))
        port = datagrams.getsockname()[1]
        try:
            stream.bind(("127.0.0.1", port))
        except OSError:
            continue
        ports.append(port)
    for one in held:
        one.close()
    return ports


class Program:
    """A program whose lines are shown under its name and kept."""

    def __init__(self, name, command, **options):
        self.name, self.lines = name, []
        self.news = threading.Condition()
        self.process = subprocess.Popen(
            [str(word) for word in command],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            bufsize=1,
            **options,
        )
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()

    def _read(self):
        for line in self.process.stdout:
            print(f"  {self.name}: {line.rstrip()}", flush=True)
            with self.news:
                self.lines.append(line.rstrip())
                self.news.notify_all()

    def wait_for(self, words, seconds=10.0, after=0):
        """Waits for a line with `words` beyond the first `after` lines, and returns it."""
        end = time.monotonic() + seconds
        with self.news:
            while True:
                for line in self.lines[after:]:
                    if words in line:
                        return line
                left = end - time.monotonic()
                if left <= 0 or not self.reader.is_alive():
                    raise Failure(f"{self.name} did not say {words!r} within {seconds:g} s")
                self.news.wait(min(left, 0.2))

    def signal(self, number):
        """Sends a signal to this program alone."""
        if self.process.poll() is None:
            self.process.send_signal(number)

    def end(self):
        """Ctrl-C, then force after five seconds; the exit status."""
        self.signal(signal.SIGCONT)
        self.signal(signal.SIGINT)
        try:
            self.process.wait(5.0)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            raise Failure(f"{self.name} did not end at Ctrl-C") from None
        finally:
            self.reader.join(2.0)
        return self.process.returncode


class Flight:
    """A companion with a shim, to be used in a `with` block; `clients` are --client addresses,
    `options` what else is on the companion's command line.

    With a `personality`, `px4` or `ardupilot`, the shim plays that flight controller, and the
    companion is the onboard computer beside it that routes between it and the clients.
    """

    def __init__(self, arguments, clients, personality=None, options=()):
        self.arguments, self.clients = arguments, clients
        self.personality, self.options = personality, options
        self.shim = self.companion = None

    def __enter__(self):
        self.room = tempfile.TemporaryDirectory(prefix="greylag-clients-")
        self.folder = pathlib.Path(self.room.name)
        self.vehicle_port = free_ports(1)[0]
        try:
            self._start()
        except BaseException:
            self._clean()
            raise
        return self

    def _start(self):
        command = [self.arguments.greylag, "fly", "--vehicle", f"udpin:127.0.0.1:{self.vehicle_port}"]
        # what is tested is the link: a planner may be late where the program is not optimised
        command += ["--controller", "lqi", "--model", "params/x8/jsbsim.toml"]
        for client in self.clients:
            command += ["--client", client]
        if self.personality:
            command += ["--profile", self.personality]
        command += self.options
        self.companion = Program("companion", [*command, "--record", self.recording])
        self.companion.wait_for("waiting for a vehicle", 30.0)
        self.start_shim()
        self.companion.wait_for("vehicle found", 30.0)

    @property
    def recording(self):
        """The folder of the companion's recording."""
        return self.folder / "flight"

    def start_shim(self):
        """Starts a shim, also in place of one that has died."""
        played = ["--personality", self.personality] if self.personality else []
        if self.personality == "ardupilot":
            # its own gyro filter and loop rate are too slow for the controller that is flown
            played += ["--parameters", PARAMETERS]
        link = f"udpout:127.0.0.1:{self.vehicle_port}"
        self.shim = Program("shim", [self.arguments.sitl, "--link", link, *played])

    def end(self):
        """Ends both programs as Ctrl-C does."""
        check(self.companion.end() == 0, "the companion did not end well")
        check(self.shim.end() == 0, "the shim did not end well")

    def land(self):
        """Ends both programs, then looks at the recording."""
        self.end()
        self.check_surfaces()

    def rows(self):
        """The rows of flight.csv."""
        with open(self.recording / "flight.csv", newline="") as file:
            return list(csv.DictReader(file))

    def check_surfaces(self):
        """Every command is finite and in range; no surface has moved faster than it may."""
        rows = [row for row in self.rows() if row["armed"] == "1"]
        check(len(rows) > 100, f"only {len(rows)} armed rows were recorded")
        largest = 0.0
        for name in ["aileron_cmd", "elevator_cmd"]:
            values = [float(row[name]) for row in rows]
            check(all(abs(value) <= 1.0 for value in values), f"{name} left its range")
            largest = max([largest, *(abs(b - a) for a, b in zip(values, values[1:]))])
        check(largest <= SURFACE_STEP, f"a surface stepped by {largest:.3f}")
        say(f"{len(rows)} armed cycles, largest step of a surface {largest:.3f} of {SURFACE_STEP:.1f}")

    def __exit__(self, *_):
        self._clean()

    def _clean(self):
        for program in [self.companion, self.shim]:
            if program and program.process.poll() is None:
                program.process.kill()
                program.process.wait()
        self.room.cleanup()


def arguments(description):
    """The command line of every script."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--greylag", required=True, help="the program greylag")
    parser.add_argument("--sitl", required=True, help="the program greylag-sitl")
    return parser.parse_args()


def run(main, seconds):
    """Runs a script's main function; the exit status says how it went, at the latest in `seconds`."""

    def give_up(*_):
        raise Failure(f"not done after {seconds} s")

    signal.signal(signal.SIGALRM, give_up)
    signal.alarm(seconds)
    try:
        main()
    except Failure as failure:
        say(f"FAILED: {failure}")
        sys.exit(1)
    say("passed")


def quaternion(roll_deg, pitch_deg, yaw_deg=0.0):
    """NED to FRD, w first."""
    half = [math.radians(angle) / 2.0 for angle in (roll_deg, pitch_deg, yaw_deg)]
    (sr, sp, sy), (cr, cp, cy) = map(math.sin, half), map(math.cos, half)
    return [
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ]


def roll_pitch(q):
    """Roll and pitch, degrees, of a quaternion NED to FRD, w first."""
    w, x, y, z = q
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x))))
    return math.degrees(roll), math.degrees(pitch)
