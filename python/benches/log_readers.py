"""Compares processor time and peak memory of `greylag logs info` with those of common log readers on the same files.

    pip install numpy pyulog pymavlink mavparser polars
    python python/benches/log_readers.py [--greylag target/release/greylag] [--minutes 30] [--large 1000]

Writes a synthetic flight as ULog, DataFlash .bin, .tlog and CSV to a temporary folder. As in real logs, two thirds of the ULog and
of the .bin are topics that no reader uses. Each reader runs in a separate process with one thread; the operating system measures its
time and memory. `--large` is the size in MB of two further files, which only `logs info` reads; 0 omits them. The other readers only
read a file, while `logs info` also checks its channels.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

# The peak memory of a child process includes that of its parent at the start. This process therefore stays small, and a
# separate process writes the files.
if len(sys.argv) > 1 and sys.argv[1] == "write":
    import numpy as np

# Topics that Greylag reads from a ULog. pyulog reads the same topics.
ULOG_TOPICS = [
    "vehicle_attitude", "vehicle_angular_velocity", "vehicle_acceleration", "airspeed_validated", "vehicle_air_data",
    "vehicle_local_position", "vehicle_status", "actuator_servos", "vehicle_torque_setpoint", "vehicle_thrust_setpoint",
]

READERS = {
    "pyulog": f"from pyulog import ULog; ULog(PATH, {ULOG_TOPICS!r})",
    "mavparser": "import mavparser; mavparser.parse(PATH)",
    "pymavlink .bin": "from pymavlink import DFReader as d\nlog = d.DFReader_binary(PATH)\n"
    "while log.recv_match(type=['ATT', 'IMU', 'ARSP', 'AOA', 'BARO', 'XKF1', 'POS', 'AETR']): pass",
    "pymavlink .tlog": "from pymavlink import mavutil\nlog = mavutil.mavlink_connection(PATH)\nwhile log.recv_match(): pass",
    "polars": "import polars; polars.read_csv(PATH)",
}


def flight(t: np.ndarray) -> dict[str, np.ndarray]:
    """Columns of a synthetic flight with alternating turns at the times `t` in s. SI units and radians."""
    v, g, w = 18.0, 9.80665, 1.1
    roll, pitch = 0.6 * np.sin(w * t), 0.05 * np.sin(0.5 * t)
    turn = g * np.tan(roll) / v
    yaw = np.mod(np.cumsum(turn) * (t[1] - t[0]) + np.pi, 2 * np.pi) - np.pi
    noise = np.random.default_rng(1).normal(size=(8, t.size))
    return {
        "time_s": t, "roll_rad": roll, "pitch_rad": pitch, "yaw_rad": yaw,
        "p_radps": 0.6 * w * np.cos(w * t) + 0.01 * noise[0], "q_radps": turn * np.sin(roll) + 0.01 * noise[1],
        "r_radps": turn * np.cos(roll) + 0.01 * noise[2], "airspeed_mps": v + 0.3 * noise[3],
        "ax_mps2": 0.1 * noise[4], "ay_mps2": 0.1 * noise[5], "az_mps2": -g / np.cos(roll) + 0.1 * noise[6],
        "vn_mps": v * np.cos(yaw), "ve_mps": v * np.sin(yaw), "vd_mps": -v * np.sin(pitch),
        "altitude_m": 500 + 5 * np.sin(0.1 * t), "air_density_kgpm3": 1.16 + 0 * t,
        "aileron_cmd": 0.3 * np.cos(w * t), "elevator_cmd": 0.05 + 0.1 * np.sin(0.5 * t),
        "throttle_cmd": 0.4 + 0.1 * np.sin(0.4 * t),
    }


def interleaved(path: Path, head: bytes, seconds: int, topics: list[tuple[int, np.ndarray]]) -> None:
    """Writes the records of the topics (rate in Hz, records) in the order of a logger, second by second."""
    with path.open("wb") as out:
        out.write(head)
        for s in range(seconds):
            for rate, records in topics:
                out.write(records[s * rate : (s + 1) * rate].tobytes())


def quaternion(f: dict[str, np.ndarray]) -> np.ndarray:
    half = [f[k] / 2 for k in ("roll_rad", "pitch_rad", "yaw_rad")]
    (sr, sp, sy), (cr, cp, cy) = [np.sin(h) for h in half], [np.cos(h) for h in half]
    parts = [cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy]
    return np.stack(parts, axis=1)


def ulog(path: Path, seconds: int) -> None:
    """Writes a ULog with topics of the present PX4. Two thirds of the file are topics that no reader uses."""
    topics: list[tuple[int, str, str, list]] = []
    of = lambda rate: flight(np.arange(seconds * rate) / rate + 1.0)
    fast, mid, slow = of(250), of(100), of(10)
    stack = lambda f, *names: np.stack([f[n] for n in names], axis=1)
    topics.append((250, "vehicle_angular_velocity", "float[3] xyz", [stack(fast, "p_radps", "q_radps", "r_radps")]))
    topics.append((250, "vehicle_acceleration", "float[3] xyz", [stack(fast, "ax_mps2", "ay_mps2", "az_mps2")]))
    topics.append((100, "vehicle_attitude", "float[4] q", [quaternion(mid)]))
    torque = np.stack([mid["aileron_cmd"], -mid["elevator_cmd"], 0 * mid["aileron_cmd"]], axis=1)
    topics.append((100, "vehicle_torque_setpoint", "float[3] xyz", [torque]))
    thrust = np.stack([mid["throttle_cmd"], 0 * mid["throttle_cmd"], 0 * mid["throttle_cmd"]], axis=1)
    topics.append((100, "vehicle_thrust_setpoint", "float[3] xyz", [thrust]))
    topics.append((10, "airspeed_validated", "float true_airspeed_m_s", [slow["airspeed_mps"][:, None]]))
    topics.append((10, "vehicle_air_data", "float rho;float baro_alt_meter", [slow["air_density_kgpm3"][:, None], slow["altitude_m"][:, None]]))
    topics.append((10, "vehicle_local_position", "float vx;float vy;float vz", [slow[k][:, None] for k in ("vn_mps", "ve_mps", "vd_mps")]))
    topics.append((200, "estimator_states", "float[25] states", [np.random.default_rng(2).normal(size=(seconds * 200, 25))]))
    topics.append((250, "sensor_gyro_fifo", "float[16] x", [np.random.default_rng(3).normal(size=(seconds * 250, 16))]))
    head = bytearray(b"\x55\x4c\x6f\x67\x01\x12\x35\x01" + bytes(8))
    record = lambda kind, body: len(body).to_bytes(2, "little") + kind + body
    made = []
    for i, (rate, name, fields, values) in enumerate(topics):
        head += record(b"F", f"{name}:uint64_t timestamp;{fields};".encode())
        width = sum(v.shape[1] for v in values)
        kind = np.dtype([("size", "<u2"), ("kind", "S1"), ("id", "<u2"), ("t", "<u8"), ("x", "<f4", (width,))])
        rows = np.zeros(seconds * rate, kind)
        rows["size"], rows["kind"], rows["id"] = kind.itemsize - 3, b"D", i
        rows["t"] = ((np.arange(seconds * rate) / rate + 1.0) * 1e6).astype("u8")
        rows["x"] = np.concatenate(values, axis=1)
        made.append((rate, rows))
    for i, (_, name, _, _) in enumerate(topics):
        head += record(b"A", bytes([0]) + i.to_bytes(2, "little") + name.encode())
    interleaved(path, bytes(head), seconds, made)


def dataflash(path: Path, seconds: int) -> None:
    """Writes a DataFlash log with the usual records of ArduPlane. Two thirds of the file are records that no reader uses."""
    of = lambda rate: flight(np.arange(seconds * rate) / rate + 1.0)
    fast, mid, slow = of(200), of(50), of(10)
    degrees = [np.degrees(mid[k]) for k in ("roll_rad", "pitch_rad")] + [np.degrees(mid["yaw_rad"]) % 360]
    noise = lambda rate, width: list(np.random.default_rng(rate).normal(size=(width, seconds * rate)))
    pressure = slow["air_density_kgpm3"] * 287.053 * 288.15
    inertial = [fast[k] for k in ("p_radps", "q_radps", "r_radps", "ax_mps2", "ay_mps2", "az_mps2")]
    eas = slow["airspeed_mps"] * np.sqrt(1.16 / 1.225)
    commands = [4500 * mid["aileron_cmd"], -4500 * mid["elevator_cmd"], 100 * mid["throttle_cmd"]]
    topics = [
        (1, 50, "ATT", "Roll,Pitch,Yaw", degrees, None),
        (2, 200, "IMU", "GyrX,GyrY,GyrZ,AccX,AccY,AccZ", inertial, "I"),
        (3, 10, "ARSP", "Airspeed", [eas], "I"),
        (5, 10, "BARO", "Alt,Press,Temp", [slow["altitude_m"], pressure, 15 + 0 * eas], "I"),
        (6, 10, "XKF1", "VN,VE,VD", [slow[k] for k in ("vn_mps", "ve_mps", "vd_mps")], "C"),
        (7, 10, "POS", "Lat,Lng,Alt", [0 * eas, 0 * eas, slow["altitude_m"]], None),
        (8, 50, "AETR", "Ail,Elev,Thr", commands, None),
        (9, 200, "RATE", "A,B,C,D,E,F,G,H,J,K,L,M", noise(200, 12), None),
        (10, 100, "XKF4", "A,B,C,D,E,F,G,H,J,K", noise(100, 10), "C"),
    ]
    head = bytearray()
    pad = lambda text, width: text.encode().ljust(width, b"\0")
    made = []
    for kind, rate, name, labels, values, instance in topics:
        letters = "Q" + ("B" if instance else "") + "f" * len(values)
        labels = ",".join(["TimeUS"] + ([instance] if instance else []) + labels.split(","))
        fields = [("magic", "S2"), ("kind", "u1"), ("t", "<u8")] + ([("i", "u1")] if instance else []) + [("x", "<f4", (len(values),))]
        layout = np.dtype(fields)
        head += b"\xa3\x95\x80" + bytes([kind, layout.itemsize]) + pad(name, 4) + pad(letters, 16) + pad(labels, 64)
        rows = np.zeros(seconds * rate, layout)
        rows["magic"], rows["kind"] = b"\xa3\x95", kind
        rows["t"] = ((np.arange(seconds * rate) / rate + 1.0) * 1e6).astype("u8")
        rows["x"] = np.stack(values, axis=1)
        made.append((rate, rows))
    interleaved(path, bytes(head), seconds, made)


def tlog(path: Path, seconds: int) -> None:
    """Writes a telemetry log of ArduPlane with the message rates of a fast link."""
    os.environ["MAVLINK20"] = "1"
    from pymavlink.dialects.v20 import ardupilotmega as m

    sender = m.MAVLink(None, srcSystem=1, srcComponent=1)
    f = flight(np.arange(seconds * 50) / 50 + 1.0)
    at = lambda k, i: float(f[k][i])
    with path.open("wb") as out:

        def send(i: int, message: object) -> None:
            out.write(int(1.6e15 + i * 20_000).to_bytes(8, "big") + message.pack(sender))

        for i in range(seconds * 50):
            ms = 1000 + 20 * i
            send(i, m.MAVLink_attitude_message(ms, *(at(k, i) for k in ("roll_rad", "pitch_rad", "yaw_rad", "p_radps", "q_radps", "r_radps"))))
            accelerations = [int(at(k, i) / 9.80665 * 1000) for k in ("ax_mps2", "ay_mps2", "az_mps2")]
            send(i, m.MAVLink_raw_imu_message(ms * 1000, *accelerations, 0, 0, 0, 0, 0, 0))
            pulses = [int(1500 + 500 * at("aileron_cmd", i)), int(1500 + 500 * at("elevator_cmd", i)), int(1000 + 1000 * at("throttle_cmd", i))]
            send(i, m.MAVLink_servo_output_raw_message(ms * 1000, 0, *pulses, 0, 0, 0, 0, 0))
            if i % 5 == 0:
                send(i, m.MAVLink_vfr_hud_message(at("airspeed_mps", i), 18.0, 0, 40, at("altitude_m", i), 0.0))
                velocity = [int(100 * at(k, i)) for k in ("vn_mps", "ve_mps", "vd_mps")]
                send(i, m.MAVLink_global_position_int_message(ms, 0, 0, int(1000 * at("altitude_m", i)), 0, *velocity, 0))
            if i % 50 == 0:
                send(i, m.MAVLink_heartbeat_message(1, 3, 0, 10, 4, 3))


def csv(path: Path, seconds: int) -> None:
    f = flight(np.arange(seconds * 100) / 100)
    np.savetxt(path, np.stack(list(f.values()), axis=1), fmt="%.8g", delimiter=",", header=",".join(f), comments="")


def charged(command: list[str]) -> tuple[float, float]:
    """Runs a command and returns its processor time in s and its peak memory in MB."""
    env = {**os.environ, "POLARS_MAX_THREADS": "1", "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "RAYON_NUM_THREADS": "1"}
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, env=env)
    said = process.stderr.read().decode()
    _, status, usage = os.wait4(process.pid, 0)
    # The exit status of `logs info` is 3 if it reports problems of the log.
    if os.waitstatus_to_exitcode(status) not in (0, 3):
        sys.exit(f"{command}: {said}")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1000


def least(command: list[str], rounds: int) -> tuple[float, float]:
    all_of_them = [charged(command) for _ in range(rounds)]
    return min(t for t, _ in all_of_them), min(m for _, m in all_of_them)


def written(path: Path, write: Callable[[Path, int], None], seconds: int) -> None:
    """Writes a file in a separate process."""
    subprocess.run([sys.executable, __file__, "write", write.__name__, str(path), str(seconds)], check=True)


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--greylag", default="target/release/greylag")
    asked.add_argument("--minutes", type=int, default=30, help="length of the flight")
    asked.add_argument("--large", type=int, default=1000, help="size of the large files, MB; 0: none")
    asked.add_argument("--rounds", type=int, default=3, help="the least of so many runs counts")
    a = asked.parse_args()
    seconds = 60 * a.minutes
    plan = [
        ("flight.ulg", ulog, "pyulog", 0.20, 0.8),
        ("flight.bin", dataflash, "mavparser", 0.20, None),
        ("flight.bin", dataflash, "pymavlink .bin", 0.20, None),
        ("flight.tlog", tlog, "pymavlink .tlog", 0.04, None),
        ("flight.csv", csv, "polars", 0.6, None),
    ]
    print(f"{'file':<12} {'MB':>6}  {'reader':<16} {'s':>7} {'peak MB':>8}  {'greylag s':>9} {'peak MB':>8}  time ratio (must)  memory ratio (must)")
    with tempfile.TemporaryDirectory() as folder:
        for name, write, other, must_time, must_memory in plan:
            path = Path(folder) / name
            if not path.exists():
                written(path, write, seconds)
            own = least([a.greylag, "logs", "info", str(path)], a.rounds)
            its = least([sys.executable, "-c", READERS[other].replace("PATH", repr(str(path)))], a.rounds)
            memory = f"({must_memory})" if must_memory else ""
            print(
                f"{name:<12} {path.stat().st_size / 1e6:6.0f}  {other:<16} {its[0]:7.2f} {its[1]:8.0f}  {own[0]:9.2f} {own[1]:8.0f}"
                f"  {own[0] / its[0]:10.3f} ({must_time}) {own[1] / its[1]:12.2f} {memory}",
                flush=True,
            )
        for name, write in [("large.ulg", ulog), ("large.bin", dataflash)]:
            if a.large == 0:
                break
            path = Path(folder) / name
            written(path, write, 60)
            written(path, write, int(60 * a.large * 1e6 / path.stat().st_size))
            own = charged([a.greylag, "logs", "info", str(path)])
            print(f"{name:<12} {path.stat().st_size / 1e6:6.0f}  {'-':<16} {'':>7} {'':>8}  {own[0]:9.2f} {own[1]:8.0f}  (must: 150 MB)", flush=True)
            path.unlink()


if __name__ == "__main__" and sys.argv[1:2] == ["write"]:
    globals()[sys.argv[2]](Path(sys.argv[3]), int(sys.argv[4]))
elif __name__ == "__main__":
    main()
