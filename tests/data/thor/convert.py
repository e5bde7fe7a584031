"""fit.csv and test.csv from the flight of the University of Minnesota's Ultra Stick 25e "Thor", flight 75 of 10 October 2012.

    python convert.py thor_flight75_WaypointTracker_150squareWaypointNew_2012_10_10.mat      # needs scipy

Source: github.com/NorthStarUAS/insgnss_tools, commit 0b5f6b1, folder flight_data, MIT licence (LICENSE). The autopilot flies (mode 2)
from 234.6 to 533.0 s; fit.csv and test.csv are two parts of that, without a row in common. Nothing is filtered or resampled. Surfaces
are the autopilot's commands by 25 degrees, in our signs; airspeed is made true by the standard density at the altitude of the log.
"""

import csv
import sys

import numpy as np
import scipy.io

PARTS = {"fit.csv": (236.0, 356.0), "test.csv": (400.0, 520.0)}
TRAVEL = np.radians(25.0)

data = scipy.io.loadmat(sys.argv[1], squeeze_me=True)["flight_data"]
get = lambda name: np.asarray(data[name].item(), dtype=float)
density = (1 - 2.25577e-5 * get("navalt")) ** 4.2561
columns = {
    "time_s": (get("time"), 3),
    "roll_rad": (get("phi"), 5), "pitch_rad": (get("theta"), 5), "yaw_rad": (get("psi"), 5),
    "p_radps": (get("p"), 4), "q_radps": (get("q"), 4), "r_radps": (get("r"), 4),
    "airspeed_mps": (get("ias") / np.sqrt(density), 3),
    "alpha_rad": (get("aoa"), 4), "beta_rad": (get("aos"), 4),
    "ax_mps2": (get("ax"), 3), "ay_mps2": (get("ay"), 3), "az_mps2": (get("az"), 3),
    "vn_mps": (get("navvn"), 3), "ve_mps": (get("navve"), 3), "vd_mps": (get("navvd"), 3), "altitude_m": (get("navalt"), 2),
    "aileron_cmd": (get("da_l") / TRAVEL, 4), "elevator_cmd": (get("de") / TRAVEL, 4),
    "rudder_cmd": (get("dr") / TRAVEL, 4), "throttle_cmd": (get("dthr"), 4),
}
time = columns["time_s"][0]
for name, (start, end) in PARTS.items():
    with open(name, "w", newline="") as out:
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(columns)
        for k in np.flatnonzero((time >= start) & (time < end)):
            writer.writerow(f"{values[k]:.{digits}f}" for values, digits in columns.values())
