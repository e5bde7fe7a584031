"""The companion beside a real flight stack in simulation: engagements, attitudes, a killed companion, cut links.

    python3 tests/firmware/acceptance.py --stack arduplane --firmware PATH/bin/arduplane \\
        --greylag target/release/greylag --sitl target/release/greylag-sitl --out DIR

The firmware is not part of this project; without it nothing runs. The aircraft is JSBSim's X8 in `greylag-sitl`.
Needs pymavlink. Prints a table and writes it with all numbers to DIR/acceptance.json; exits with 1 if a bound is missed.
"""

import argparse
import gc
import json
import math
import pathlib
import signal
import statistics
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "clients"))

import flight
from flight import Failure, Program, check, say
from offboard import ARM, FORCE, Offboard, mavlink
from stacks import STACKS

TARGETS = [(0, 2), (20, 2), (-30, 2), (0, 8), (0, -6), (35, 5), (-45, 5), (0, 2)]
CUTS = [0.2, 0.5, 1.0, 2.0, 5.0, 10.0]
# The bounds.
SETTLED_DEG = {"surfaces": 0.05, "attitude": 0.3}
LOWEST_M = -30.0
# A pitch that swings by more than this is an oscillation; a limit cycle beside ArduPlane had 3 to 13 deg.
STEADY_DEG = 0.5


class Bench:
    """A firmware that flies, with a companion beside it."""

    def __init__(self, arguments, authority):
        self.arguments, self.authority = arguments, authority
        self.room = arguments.out / f"{arguments.stack}-{authority}"
        self.room.mkdir(parents=True)
        words = (word.split("=", 1) for word in arguments.parameter)
        parameters = {name: float(value) for name, value in words}
        self.stack = STACKS[arguments.stack]()
        self.companion = self.client = None
        self.starts = 0
        try:
            self.stack.start(arguments, self.room, parameters)
        except BaseException:
            self.stack.end()
            raise
        self.station = self.stack.station

    def start_companion(self):
        """A new companion and a client of it."""
        self.starts += 1
        port = self.port = flight.free_ports(1)[0]
        arguments = self.arguments
        self.companion = Program(
            "companion",
            [arguments.greylag, "fly", "--vehicle", self.stack.vehicle, "--client", f"udpin:127.0.0.1:{port}",
             "--profile", self.stack.profile, "--command", self.authority, "--controller", arguments.controller,
             "--model", arguments.model, "--record", self.room / f"recording-{self.starts}"],
        )  # fmt: skip
        self.companion.wait_for("vehicle found", 40.0)
        self.client = Offboard(f"udpout:127.0.0.1:{port}", pilot=(1, 191))
        # Rates are measured and parameters read before an aircraft is taken.
        self.both(6.0)

    def both(self, seconds):
        """Goes on with client and station; what the station saw."""
        end, seen = time.monotonic() + seconds, []
        while time.monotonic() < end:
            self.client.turn()
            seen += self.station.run(0.0) or self.look()
        return seen

    def look(self):
        """The attitudes that have come to the station by now."""
        seen, message = [], self.station.link.recv_match(blocking=False)
        while message is not None:
            if self.station.own(message):
                self.station.keep(message)
                if message.get_type() == "ATTITUDE":
                    seen.append((
                        time.monotonic(), math.degrees(message.roll), math.degrees(message.pitch),
                        self.station.height(),
                    ))  # fmt: skip
            message = self.station.link.recv_match(blocking=False)
        return seen

    def until_mode(self, wanted, seconds):
        """Seconds until the firmware's own heartbeat shows one of these modes; None if it does not."""
        start = time.monotonic()
        while time.monotonic() < start + seconds:
            self.both(0.05)
            if self.station.mode() in wanted:
                return time.monotonic() - start
        return None

    def engage(self, roll, pitch):
        """Arms the companion and steers by attitude setpoints; seconds until the firmware shows the mode."""
        begun = time.monotonic()
        self.client.mav.command_long_send(1, 191, ARM, 0, 1, 0, 0, 0, 0, 0, 0)
        self.client.target = (roll, pitch)
        self.both(0.4)
        self.client.mav.command_long_send(1, 191, mavlink.MAV_CMD_DO_SET_MODE, 0, 1, 6, 0, 0, 0, 0, 0)
        shown = self.until_mode([self.stack.steered[self.authority]], 6.0)
        return None if shown is None else time.monotonic() - begun

    def take(self, roll, pitch):
        """Engages; asks again where that is refused, as while rates are disturbed by a download of parameters."""
        for _ in range(3):
            if self.engage(roll, pitch) is not None:
                return
            self.give_back()
            self.both(2.0)
        raise Failure("not engaged in three attempts")

    def give_back(self):
        """The client takes its demand back; seconds until the firmware flies by itself."""
        self.client.target = None
        self.client.mav.command_long_send(1, 191, ARM, 0, 0, FORCE, 0, 0, 0, 0, 0)
        return self.until_mode([self.stack.hold], 5.0)

    def fresh(self):
        """A companion that lives and steers nothing, beside a firmware that flies by itself with its radio and its link."""
        self.client.target = None
        self.stack.relay.cut = False
        if self.companion.process.poll() is not None:
            self.start_companion()
        self.give_back()

    def level(self):
        """A gentle flight of the firmware's own, high enough for the next check."""
        self.stack.to_mode(self.stack.hold)
        end = time.monotonic() + 60.0
        while True:
            seen = self.both(1.5)
            bank = max((abs(roll) for _, roll, _, _ in seen), default=90.0)
            if bank < 40.0 and self.station.height() > 50.0 and self.station.mode() == self.stack.hold:
                return
            check(time.monotonic() < end, f"the firmware does not hold: bank {bank:.0f} deg, {self.station.height():.0f} m")

    def said(self, after):
        """What the companion said from its line `after` on."""
        return self.companion.lines[after:]

    def end(self):
        if self.companion and self.companion.process.poll() is None:
            self.companion.process.kill()
            self.companion.process.wait()
        self.stack.end()


def swings(points):
    """Standard deviation about a straight line, deg: what swings, not what still settles."""
    if len(points) < 6:
        return math.nan
    times, values = zip(*points)
    slope, level = statistics.linear_regression(times, values)
    return statistics.pstdev([value - slope * at - level for at, value in points])


def engagements(bench):
    """Engaged and given back, again and again."""
    results = []
    for number in range(bench.arguments.engagements):
        bench.level()
        line = len(bench.companion.lines)
        taken = bench.engage(0, 2)
        seen = bench.both(5.0) if taken is not None else []
        kept = bench.station.mode() == bench.stack.steered[bench.authority]
        swing = swings([(at, pitch) for at, _, pitch, _ in seen if at > time.monotonic() - 2.5])
        back = bench.give_back()
        good = taken is not None and kept and back is not None and swing < STEADY_DEG
        results.append({"engaged_s": taken, "kept": kept, "pitch_sd_deg": swing, "given_back_s": back, "good": good})
        say(f"engagement {number + 1}: {results[-1]}")
        if not good:
            results[-1]["said"] = bench.said(line)
    good = sum(r["good"] for r in results)
    times = [r["engaged_s"] for r in results if r["engaged_s"] is not None]
    words = f"{good} of {len(results)}; engaged after {statistics.median(times):.2f} s in the median, {max(times):.2f} s at most" if times else "none"
    return {"holds": good == len(results), "words": words, "each": results}


def targets(bench):
    """Attitudes held; the error is that of the firmware's own attitude, mean over the last 3 of 12 s."""
    bench.level()
    bench.take(*TARGETS[0])
    results = []
    line = len(bench.companion.lines)
    for roll, pitch in TARGETS:
        bench.client.target = (roll, pitch)
        seen = bench.both(12.0)
        if bench.station.mode() != bench.stack.steered[bench.authority]:
            # What is flown now is the firmware's own: no error of the companion's.
            said = " | ".join(bench.said(line)[-3:])
            done = f"{len(results)} of {len(TARGETS)} targets flown"
            return {"holds": False, "words": f"handed back at {roll} / {pitch} deg ({done}): {said}", "each": results, "said": bench.said(line)}
        late = [(r, p) for at, r, p, _ in seen if at > seen[-1][0] - 3.0]
        error = [statistics.fmean(x[i] for x in late) - (roll, pitch)[i] for i in (0, 1)]
        results.append({"target_deg": [roll, pitch], "error_deg": error})
        say(f"target {roll} / {pitch}: error {error[0]:+.3f} / {error[1]:+.3f} deg")
    bench.give_back()
    largest = max(abs(e) for r in results for e in r["error_deg"])
    bound = SETTLED_DEG[bench.authority]
    return {"holds": largest <= bound, "words": f"{largest:.3f} deg at most (bound {bound})", "each": results}


def watched(bench, seconds):
    """Lowest height below that of now, and the modes that are shown, for a time."""
    height, before = bench.station.height(), len(bench.station.modes)
    seen = bench.both(seconds) if bench.companion.process.poll() is None else bench.station.run(seconds)
    heights = [h for *_, h in seen] or [height]
    bank = max((abs(r) for _, r, _, _ in seen), default=math.nan)
    return {
        "lowest_m": min(heights) - height, "bank_deg": bank,
        "modes": [mode for _, mode in bench.station.modes[before:]], "last_mode": bench.station.mode(),
    }  # fmt: skip


def killed(bench):
    """The companion dies in a turn (SIGKILL); by surfaces with a radio whose sticks are released, and without one: in either case
    the firmware leaves the mode in which it was steered, where that is MANUAL."""
    results = []
    for radio in bench.stack.radios(bench.authority):
        bench.level()
        bench.take(15, 3)
        bench.both(4.0)
        bench.stack.radio(radio)
        bench.both(1.0)
        bench.companion.signal(signal.SIGKILL)
        bench.companion.process.wait()
        seen = watched(bench, 20.0)
        bench.stack.radio(True)
        bench.stack.to_mode(bench.stack.hold)
        bench.start_companion()
        manual = bench.authority == "surfaces" and seen["last_mode"] == bench.stack.steered["surfaces"]
        holds = seen["lowest_m"] > LOWEST_M and not manual
        results.append({"radio": radio, **seen, "holds": holds})
    words = "; ".join(
        f"{'radio' if r['radio'] else 'no radio'}: {r['lowest_m']:.0f} m, bank {r['bank_deg']:.0f} deg, modes {r['modes']}"
        for r in results
    )
    return {"holds": all(r["holds"] for r in results), "words": words, "each": results}


def cuts(bench):
    """The link is cut both ways for a time."""
    results = []
    for seconds in CUTS:
        bench.level()
        bench.take(10, 3)
        bench.both(3.0)
        line = len(bench.companion.lines)
        bench.stack.relay.cut = True
        cut = watched(bench, seconds)
        bench.stack.relay.cut = False
        after = watched(bench, 8.0)
        steered = bench.stack.steered[bench.authority]
        lowest = min(cut["lowest_m"], cut["lowest_m"] + after["lowest_m"], after["lowest_m"])
        said = [words for words in bench.said(line) if "hand" in words or "lost" in words or "back" in words]
        # A short cut may be ridden through; otherwise the firmware flies by itself, and that is said.
        holds = lowest > LOWEST_M and (after["last_mode"] == steered or bool(said))
        results.append({"cut_s": seconds, "lowest_m": lowest, "during": cut, "after": after, "said": said, "holds": holds})
        say(f"cut of {seconds} s: {'holds' if holds else 'FAILS'}, {lowest:.1f} m, {cut['modes']} then {after['modes']}")
        bench.give_back()
        bench.both(1.0)
    lowest = min(r["lowest_m"] for r in results)
    bad = [r["cut_s"] for r in results if not r["holds"]]
    return {"holds": not bad, "words": f"cuts of {CUTS} s: {lowest:.0f} m at the lowest" + (f", fails {bad}" if bad else ""), "each": results}


def station_takes(bench):
    """A ground station changes the mode: the companion lets go and does not take it back."""
    results = []
    for _ in range(3):
        bench.level()
        bench.take(10, 3)
        bench.both(2.0)
        line = len(bench.companion.lines)
        bench.stack.to_mode(bench.stack.other)
        taken = bench.until_mode([bench.stack.other], 3.0)
        seen = watched(bench, 5.0)
        said = [words for words in bench.said(line) if "left" in words]
        results.append({"after_s": taken, "said": said, **seen, "holds": taken is not None and not seen["modes"] and bool(said)})
        bench.give_back()
        bench.client.target = None
    good = sum(r["holds"] for r in results)
    return {"holds": good == len(results), "words": f"{good} of {len(results)}", "each": results}


def routing(bench):
    """Parameters and a second client through the companion."""
    table = {}
    client = Offboard(f"udpout:127.0.0.1:{bench.port}", component=192, pilot=(1, 1))
    client.mav.param_request_list_send(1, 1)
    end, count = time.monotonic() + 40.0, None
    while time.monotonic() < end and (count is None or len(table) < count):
        bench.client.turn()
        bench.look()
        for message in client.turn():
            if message.get_type() == "PARAM_VALUE" and message.get_srcComponent() == 1 and message.param_index < 65535:
                table[message.param_index], count = message.param_id, message.param_count
    client.link.close()
    return {"holds": count is not None and len(table) >= 0.99 * count, "words": f"{len(table)} of {count} parameters through the companion", "each": []}


CHECKS = {
    "engagements": engagements,
    "targets": targets,
    "station": station_takes,
    "routing": routing,
    "cuts": cuts,
    "killed": killed,
}


def fly(arguments, authority, report):
    """All checks of one authority, on one firmware that flies on."""
    bench = Bench(arguments, authority)
    try:
        bench.stack.take_off()
        bench.start_companion()
        for name in arguments.only or CHECKS:
            # Each check is judged by itself: what one leaves behind is cleared away before the next.
            try:
                bench.fresh()
                result = CHECKS[name](bench)
            except Failure as failure:
                result = {"holds": False, "words": str(failure), "each": [], "said": bench.companion.lines[-8:]}
            report.append({"authority": authority, "check": name, **result})
            say(f"== {authority}, {name}: {'holds' if result['holds'] else 'MISSED'}: {result['words']}")
            (arguments.out / "acceptance.json").write_text(json.dumps(report, indent=1))
    finally:
        bench.end()


def main():
    """Flies and prints."""
    # The wires run through this process: a collection of all it has seen stood the simulation still for up to 1.6 s.
    gc.disable()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--stack", choices=STACKS, required=True)
    parser.add_argument("--firmware", required=True, help="the program arduplane, or PX4's folder build/px4_sitl_default")
    parser.add_argument("--greylag", required=True, type=pathlib.Path)
    parser.add_argument("--sitl", required=True, type=pathlib.Path)
    parser.add_argument("--out", required=True, type=pathlib.Path, help="a new folder")
    parser.add_argument("--authority", nargs="+", default=["attitude", "surfaces"], choices=["attitude", "surfaces"])
    parser.add_argument("--controller", default="lqi-damped", help="the companion's controller")
    parser.add_argument("--model", default="params/x8/jsbsim.toml")
    parser.add_argument("--engagements", type=int, default=50)
    parser.add_argument("--only", nargs="+", choices=CHECKS)
    parser.add_argument("--parameter", action="append", default=[], metavar="NAME=VALUE", help="of the firmware")
    parser.add_argument("--sitl-option", action="append", default=[], help="one word more for greylag-sitl")
    parser.add_argument("--port", type=int, default=14741, help="of the wire between firmware and companion")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=False)
    arguments.out = arguments.out.resolve()
    for name in ("greylag", "sitl"):
        setattr(arguments, name, getattr(arguments, name).resolve())
    report = []
    for authority in arguments.authority:
        fly(arguments, authority, report)
    print(f"\n{'authority':10} {'check':12} {'':7} measured")
    for row in report:
        print(f"{row['authority']:10} {row['check']:12} {'holds' if row['holds'] else 'MISSED':7} {row['words']}")
    sys.exit(0 if all(row["holds"] for row in report) else 1)


if __name__ == "__main__":
    main()
