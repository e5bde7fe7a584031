"""fit.csv and test.csv from flight 9 of "Proto", a fixed-wing aircraft under PX4 whose geometry nobody states.

    python convert.py flight_data/Proto        # needs numpy; the folder of github.com/NorthStarUAS/insgnss_tools, commit 0b5f6b1, MIT licence

Every second sample of vehicle_attitude (43 Hz) is a row, with the airspeed nearest to it (83 Hz) and the command before it (49 Hz);
velocity and altitude stand in the row next to their own sample (10 Hz), and nowhere else. Nothing is interpolated.
"""

import csv
import sys
from pathlib import Path

import numpy as np

PARTS = {"fit.csv": (150.0, 270.0), "test.csv": (290.0, 410.0)}


def topic(name):
    with open(Path(sys.argv[1]) / f"Proto_FLT09_{name}_0.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    return {key: np.array([float(row[key] or "nan") for row in rows]) for key in rows[0]}


attitude, airspeed, commands, place = (
    topic(name) for name in ("vehicle_attitude", "airspeed", "actuator_controls_0", "vehicle_local_position"))
start = airspeed["timestamp"][np.argmax(airspeed["true_airspeed_m_s"] > 10.0)]
clock = lambda t: (t["timestamp"] - start) * 1e-6
rows = np.arange(0, len(attitude["timestamp"]), 2)
time = clock(attitude)[rows]
w, x, y, z = (attitude[f"q[{k}]"][rows] for k in range(4))
nearest = np.clip(np.searchsorted(clock(airspeed), time), 1, len(airspeed["timestamp"]) - 1)
nearest -= time - clock(airspeed)[nearest - 1] < clock(airspeed)[nearest] - time
before = np.clip(np.searchsorted(clock(commands), time, "right") - 1, 0, None)
columns = {
    "time_s": (time, 3),
    "roll_rad": (np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)), 5),
    "pitch_rad": (np.arcsin(2 * (w * y - z * x)), 5),
    "yaw_rad": (np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)), 5),
    "p_radps": (attitude["rollspeed"][rows], 4), "q_radps": (attitude["pitchspeed"][rows], 4),
    "r_radps": (attitude["yawspeed"][rows], 4),
    "airspeed_mps": (airspeed["true_airspeed_m_s"][nearest], 3),
    "aileron_cmd": (commands["control[0]"][before], 4),
    # PX4's pitch command is positive with the nose up
    "elevator_cmd": (-commands["control[1]"][before], 4),
    "rudder_cmd": (-commands["control[2]"][before], 4),
    "throttle_cmd": (commands["control[3]"][before], 4),
}
own = np.unique(np.clip(np.searchsorted(time, clock(place)), 0, len(time) - 1), return_index=True)
for name, values in (("vn_mps", place["vx"]), ("ve_mps", place["vy"]), ("vd_mps", place["vz"]), ("altitude_m", place["ref_alt"] - place["z"])):
    column = np.full(len(time), np.nan)
    column[own[0]] = values[own[1]]
    columns[name] = (column, 3)
for name, (first, last) in PARTS.items():
    with open(name, "w", newline="") as out:
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(columns)
        for k in np.flatnonzero((time >= first) & (time < last)):
            writer.writerow("" if np.isnan(v[k]) else f"{v[k]:.{digits}f}" for v, digits in columns.values())
