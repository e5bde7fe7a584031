"""Reads flight.ulg, .bin and .tlog of a folder by pyulog and pymavlink, compares with flight.csv."""

import csv
import math
import os
import sys

os.environ["MAVLINK20"] = "1"
os.environ["MAVLINK_DIALECT"] = "ardupilotmega"

from pymavlink import mavutil
from pyulog import ULog

folder = sys.argv[1]
with open(os.path.join(folder, "flight.csv")) as file:
    rows = [{k: float(v) for k, v in row.items() if v} for row in csv.DictReader(file)]


def check(name, values, expected, tolerance):
    assert len(values) == len(expected), f"{name}: {len(values)} of {len(expected)} samples"
    worst = max(abs(a - b) for a, b in zip(values, expected))
    print(f"{name}: {len(values)} samples, largest difference {worst:.2e}")
    assert worst < tolerance, name


def column(name):
    return [row[name] for row in rows]


log = ULog(os.path.join(folder, "flight.ulg"))
rates = log.get_dataset("vehicle_angular_velocity").data
check("ulog p", rates["xyz[0]"], column("p_radps"), 1e-6)
check("ulog time", [t * 1e-6 for t in rates["timestamp"]], column("time_s"), 1e-9)
q = [log.get_dataset("vehicle_attitude").data[f"q[{i}]"] for i in range(4)]
roll = [math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)) for w, x, y, z in zip(*q)]
check("ulog roll", roll, column("roll_rad"), 2e-6)
check("ulog airspeed", log.get_dataset("airspeed_validated").data["true_airspeed_m_s"], column("airspeed_mps"), 1e-5)


def messages(file, kind):
    link = mavutil.mavlink_connection(os.path.join(folder, file))
    while (message := link.recv_match(type=kind)) is not None:
        yield message


check("bin roll", [math.radians(m.Roll) for m in messages("flight.bin", "ATT")], column("roll_rad"), 2e-6)
imu = [m for m in messages("flight.bin", "IMU") if m.I == 0]
check("bin r", [m.GyrZ for m in imu], column("r_radps"), 1e-6)
check("bin time", [m.TimeUS * 1e-6 for m in imu], column("time_s"), 1e-9)
check("bin elevator", [-m.Elev / 4500 for m in messages("flight.bin", "AETR")], column("elevator_cmd"), 1e-6)
check("tlog q", [m.pitchspeed for m in messages("flight.tlog", "ATTITUDE_QUATERNION")], column("q_radps"), 1e-6)
check("tlog alpha", [math.radians(m.AOA) for m in messages("flight.tlog", "AOA_SSA")], column("alpha_rad"), 1e-6)
