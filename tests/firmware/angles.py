"""How well angle of attack and sideslip were known in a flight of acceptance.py, judged by the simulator's truth.

    python3 tests/firmware/angles.py DIR/arduplane-surfaces/recording-1
    greylag logs reconstruct DIR/arduplane-surfaces/logs/00000001.BIN path.csv --model params/x8/jsbsim.toml
    python3 tests/firmware/angles.py path.csv --truth DIR/arduplane-surfaces/truth.csv

The first prints the error of the companion's estimate (flight.csv) and of ArduPilot's own (AOA_SSA in flight.tlog, where there is one) while
Greylag steered: mean, standard deviation, largest, in degrees. The truth is truth.csv beside the recording: JSBSim's own angles.
The second judges a reconstructed flight path, with roll, pitch and heading too, and how late surfaces and rates are in it.
"""

import bisect
import csv
import math
import pathlib
import statistics
import sys

from pymavlink import mavutil


def table(path, columns):
    """The rows of a CSV file in which all these columns are numbers."""
    rows = []
    with open(path, newline="") as file:
        for row in csv.DictReader(file):
            try:
                rows.append([float(row[name]) for name in columns])
            except (TypeError, ValueError):
                continue
    return rows


def at(rows, time, column):
    """A column of `rows` at a time, between two rows; None beyond them."""
    k = bisect.bisect(rows, [time])
    if not 0 < k < len(rows):
        return None
    (a, b), share = rows[k - 1 : k + 1], 0.0
    share = (time - a[0]) / (b[0] - a[0])
    return a[column] + share * (b[column] - a[column])


def offset(truth, flown):
    """Seconds by which the truth's clock is ahead: where its roll is that of the flight."""

    def error(shift):
        pairs = ((at(truth, row[0] + shift, 3), row[3]) for row in flown[::25])
        gaps = [abs(a - b) for a, b in pairs if a is not None]
        return statistics.fmean(gaps) if len(gaps) > 20 else math.inf

    # greylag-sitl begins PX4's clock at 1000 s
    bases = [0.0, -1000.0]
    return min((error(base + 0.02 * k), base + 0.02 * k) for base in bases for k in range(-1000, 1001))[1]


def show(name, truth, rows, shift, angles=((1, "angle of attack"), (2, "sideslip"))):
    """A line for each angle."""
    for column, angle in angles:
        pairs = ((row[column], at(truth, row[0] + shift, column)) for row in rows)
        errors = [a - b for a, b in pairs if b is not None]
        errors = [math.degrees((e + math.pi) % (2 * math.pi) - math.pi) for e in errors]
        mean, sd, most = statistics.fmean(errors), statistics.pstdev(errors), max(map(abs, errors))
        print(f"{name:24} {angle:16} mean {mean:+.2f}  sd {sd:.2f}  largest {most:.2f} deg  ({len(errors)} samples)")


def unwrapped(rows, column):
    """The same rows with an angle that does not jump."""
    for before, row in zip(rows, rows[1:]):
        row[column] += 2 * math.pi * round((before[column] - row[column]) / (2 * math.pi))
    return rows


def late_ms(truth, rows, shift, column):
    """By how much a column comes late beside the truth: where it fits best, to a millisecond."""

    def error(ms):
        pairs = ((at(truth, row[0] + shift - 0.001 * ms, column), row[column]) for row in rows[::7])
        return statistics.fmean((a - b) ** 2 for a, b in pairs if a is not None)

    return min(range(-50, 51), key=error)


def judge_path(path, truth):
    """A reconstructed path from 30 s after its first sample: a launch is no flight."""
    columns = ["time_s", "alpha_rad", "beta_rad", "roll_rad", "pitch_rad", "yaw_rad", "p_radps", "q_radps", "aileron_rad", "elevator_rad"]
    truth, path = unwrapped(table(truth, columns), 5), table(path, columns)
    path = [row for row in path if row[0] > path[0][0] + 30.0]
    angles = [(1, "angle of attack"), (2, "sideslip"), (3, "roll"), (4, "pitch"), (5, "heading")]
    shift = offset(truth, path)
    show("reconstructed path", truth, path, shift, angles)
    for name, surface, rate in (("aileron", 8, 6), ("elevator", 9, 7)):
        of_surface, of_rate = (late_ms(truth, path, shift, column) for column in (surface, rate))
        print(f"{'reconstructed path':24} {name:16} {of_surface:+d} ms late, its rate {of_rate:+d} ms")


def main():
    """Prints."""
    if "--truth" in sys.argv:
        judge_path(sys.argv[1], sys.argv[3])
        return
    folder = pathlib.Path(sys.argv[1])
    truth = table(folder.parent / "truth.csv", ["time_s", "alpha_rad", "beta_rad", "roll_rad"])
    # armed is 1 while Greylag steers or may
    flown = table(folder / "flight.csv", ["time_s", "alpha_rad", "beta_rad", "roll_rad", "armed"])
    flown = [row for row in flown if row[4] == 1]
    shift = offset(truth, flown)
    show("companion's estimate", truth, flown, shift)
    own, time, steered = [], None, {round(row[0], 1) for row in flown}
    log = mavutil.mavlink_connection(str(folder / "flight.tlog"))
    while (message := log.recv_match(type=["AOA_SSA", "ATTITUDE_QUATERNION"])) is not None:
        if message.get_type() == "ATTITUDE_QUATERNION":
            time = message.time_boot_ms / 1000.0
        elif time is not None and round(time, 1) in steered:
            own.append([time, math.radians(message.AOA), math.radians(message.SSA)])
    if own:
        show("ArduPilot's AOA_SSA", truth, own, shift)


if __name__ == "__main__":
    main()
