"""Flight logs of MIT's "Dawn One" from the topics that ulog2csv writes: convert.py FOLDER OUT_DIR

The files of FOLDER are those of github.com/peterdsharpe/aircraft-polar-reconstruction-from-flight-test, commit
d2f3ca83 (MIT licence, see LICENSE). Rows come at the gyros' 50 Hz; a slower sensor fills a field only in the row
that follows its sample, so no value is interpolated or repeated.
"""

import csv
import math
import sys
from pathlib import Path

IDLE_V, FULL_V = 16.0, 12.5  # the battery's voltage with the motor at rest and at its hardest in this flight
FLIGHT_S = (1113.0, 1378.0)  # on the log's clock: from the climb to the last approach
SPLIT_S = 1245.0  # before it the flight to fit, after it the flight to test
COLUMNS = (
    "time_s,roll_rad,pitch_rad,yaw_rad,p_radps,q_radps,r_radps,airspeed_mps,ax_mps2,ay_mps2,az_mps2,"
    "vn_mps,ve_mps,vd_mps,altitude_m,air_density_kgpm3,aileron_cmd,elevator_cmd,rudder_cmd,throttle_cmd"
).split(",")


def topic(folder: Path, name: str) -> list[dict[str, str]]:
    with open(folder / f"flight3_{name}_0.csv", newline="") as file:
        return list(csv.DictReader(file))


def seconds(row: dict[str, str]) -> float:
    return int(row.get("timestamp_sample") or row["timestamp"]) * 1e-6


def euler(row: dict[str, str]) -> list[float]:
    w, x, y, z = (float(row[f"q[{i}]"]) for i in range(4))
    return [
        math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
        math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x)))),
        math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
    ]


def floats(row: dict[str, str], *names: str) -> list[float]:
    return [float(row[name]) for name in names]


SOURCES = {
    "vehicle_attitude": (["roll_rad", "pitch_rad", "yaw_rad"], euler),
    "airspeed_validated": (["airspeed_mps"], lambda r: floats(r, "true_airspeed_m_s")),
    "vehicle_acceleration": (
        ["ax_mps2", "ay_mps2", "az_mps2"],
        lambda r: floats(r, "xyz[0]", "xyz[1]", "xyz[2]"),
    ),
    "vehicle_local_position": (
        ["vn_mps", "ve_mps", "vd_mps", "altitude_m"],
        lambda r: floats(r, "vx", "vy", "vz") + [float(r["ref_alt"]) - float(r["z"])],
    ),
    "vehicle_air_data": (["air_density_kgpm3"], lambda r: floats(r, "rho")),
    # PX4: positive controls raise the nose and turn it right, positive elevator and rudder do the reverse
    "actuator_controls_0": (
        ["aileron_cmd", "elevator_cmd", "rudder_cmd"],
        lambda r: [float(r["control[0]"]), -float(r["control[1]"]), -float(r["control[2]"])],
    ),
    # the throttle channel is empty and the current sensor silent: the sag of the battery stands for the motor
    "battery_status": (
        ["throttle_cmd"],
        lambda r: [max(0.0, min(1.0, (IDLE_V - float(r["voltage_v"])) / (IDLE_V - FULL_V)))],
    ),
}


def rows(folder: Path) -> list[dict[str, float]]:
    gyros = topic(folder, "vehicle_angular_velocity")
    table = [
        dict(zip(["time_s", "p_radps", "q_radps", "r_radps"], [seconds(r)] + floats(r, "xyz[0]", "xyz[1]", "xyz[2]")))
        for r in gyros
    ]
    times = [row["time_s"] for row in table]
    for name, (columns, read) in SOURCES.items():
        at = 0
        for r in topic(folder, name):
            while at < len(times) and times[at] < seconds(r):
                at += 1
            if at < len(times):
                table[at].update(zip(columns, read(r)))
    return table


def write(path: Path, table: list[dict[str, float]]) -> None:
    with open(path, "w") as file:
        file.write(",".join(COLUMNS) + "\n")
        for row in table:
            fields = (f"{row[c]:.6g}" if c in row else "" for c in COLUMNS[1:])
            file.write(f"{row['time_s']:.3f}," + ",".join(fields) + "\n")


def main() -> None:
    folder, out = Path(sys.argv[1]), Path(sys.argv[2])
    table = [row for row in rows(folder) if FLIGHT_S[0] <= row["time_s"] < FLIGHT_S[1]]
    write(out / "fit.csv", [row for row in table if row["time_s"] < SPLIT_S])
    write(out / "test.csv", [row for row in table if row["time_s"] >= SPLIT_S])


if __name__ == "__main__":
    main()
