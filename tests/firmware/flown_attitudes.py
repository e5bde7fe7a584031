"""Attitudes and thrusts that real firmware was asked for, and what it made of them, as rows of 50 ms.

    python3 tests/firmware/flown_attitudes.py LOG.ulg TRUTH.csv tests/data/px4_attitude_steps.csv 1037.0 1109.8
    python3 tests/firmware/flown_attitudes.py LOG.BIN tests/data/ardupilot_loiter.csv 38.0 59.9

Of a ULog: vehicle_attitude_setpoint; the attitude is the simulator's truth in log-format columns on PX4's clock. Of a DataFlash log: the desired
attitude of ATT, the throttle of AETR, the simulator's truth in SIM. The last two words are the times between which rows are written, s.
The played controllers are compared with them (sitl/src/shim/controller/law.rs). Needs numpy, pyulog, pymavlink.
"""

import csv
import sys

import numpy as np

HEADER = "time_s,roll_asked_deg,pitch_asked_deg,thrust,roll_deg,pitch_deg,airspeed_mps\n"


def of_ulog(path, truth, times):
    """Columns of a ULog with a truth file, at these times."""
    from pyulog import ULog

    asked = next(t.data for t in ULog(path).data_list if t.name == "vehicle_attitude_setpoint")
    w, x, y, z = (asked[f"q_d[{i}]"] for i in range(4))
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2 * (w * y - z * x), -1, 1))
    last = np.searchsorted(asked["timestamp"] * 1e-6, times, side="right") - 1
    with open(truth, newline="") as file:
        rows = list(csv.DictReader(file))
    seen = {name: np.array([float(row[name]) for row in rows]) for name in ("time_s", "roll_rad", "pitch_rad", "airspeed_mps")}
    flown = [np.interp(times, seen["time_s"], seen[name]) for name in ("roll_rad", "pitch_rad", "airspeed_mps")]
    degrees = [np.degrees(v) for v in (roll[last], pitch[last], *flown[:2])]
    return [*degrees[:2], asked["thrust_body[0]"][last], *degrees[2:], flown[2]]


def of_dataflash(path, times):
    """Columns of a DataFlash log, at these times."""
    from pymavlink import DFReader

    wanted = {"ATT": ("DesRoll", "DesPitch"), "SIM": ("Roll", "Pitch"), "AETR": ("Thr",), "ARSP": ("Airspeed",)}
    found = {kind: [] for kind in wanted}
    log = DFReader.DFReader_binary(path)
    while (message := log.recv_msg()) is not None:
        kind = message.get_type()
        if kind in wanted:
            found[kind].append([message.TimeUS * 1e-6, *(getattr(message, field) for field in wanted[kind])])
    found = {kind: np.array(rows) for kind, rows in found.items()}
    between = lambda kind, column: np.interp(times, found[kind][:, 0], found[kind][:, column])
    last = np.searchsorted(found["AETR"][:, 0], times, side="right") - 1
    thrust = found["AETR"][last, 1] / 100
    return [between("ATT", 1), between("ATT", 2), thrust, between("SIM", 1), between("SIM", 2), between("ARSP", 1)]


def main():
    """Writes the rows."""
    *logs, out, begins, ends = sys.argv[1:]
    times = np.arange(float(begins), float(ends), 0.05)
    columns = of_ulog(*logs, times) if len(logs) == 2 else of_dataflash(*logs, times)
    with open(out, "w") as file:
        file.write(HEADER)
        for time, *row in zip(times - times[0], *columns):
            words = [f"{time:.2f}", *(f"{v:.2f}" for v in row[:2]), f"{row[2]:.4f}", *(f"{v:.3f}" for v in row[3:])]
            file.write(",".join(words).replace("-0.00,", "0.00,") + "\n")


main()
