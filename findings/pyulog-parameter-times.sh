#!/usr/bin/env bash
# pyulog 1.3.0: at what time a parameter was changed, and where the log has a gap, depends on which topics are asked for. ULog gives neither a time: a reader takes that of the records around them, and pyulog takes
# the latest stamp it has kept so far. With a list of topics only theirs are kept: a gain that was changed at 7.5 s reads 7.0 s beside a topic of 1 Hz and the start of the log, 0.0 s, beside one that is logged
# only later. The latest stamp, not the last: one record with the stamp of another boot, as PX4 writes of a stored mission (pyulog's own sample log has one), puts all changes and gaps
# after it to that time, here twenty minutes after the end of the log, unless that topic is left out. write_ulog(), with which a log is cut down to a few topics, then moves the change in the file, where every reader finds it.
# Why it matters: a flight in which gains were tuned is cut at changed_parameters, and the halves are fitted with each other's gains; the list of topics is given for speed, and nothing says that it is more than that.
# Instead: read all topics for the times, and take the median or the last stamp of the attitude.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/v" && "$folder/v/bin/pip" -q install pyulog==1.3.0 numpy==2.2.6
"$folder/v/bin/python" - <<'PYTHON'
import io
import struct
from importlib.metadata import version

from pyulog import ULog

START = 100_000_000
TOPICS = {"vehicle_attitude": 0, "battery_status": 1, "vehicle_land_detected": 2, "mission": 3}

def record(kind, body):
    return struct.pack("<HB", len(body), ord(kind)) + body

def parameter(name, value):
    key = f"float {name}".encode()
    return record("P", bytes([len(key)]) + key + struct.pack("<f", value))

def log(mission):
    """20 s: attitude at 100 Hz, battery at 1 Hz, landed at 18 s, a gain changed at 7.505 s, 40 ms lost at 12.305 s; with a stored mission of another boot logged at 5.005 s, or without."""
    out = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", START) + record("B", bytes(40))
    for name in TOPICS:
        out += record("F", f"{name}:uint64_t timestamp;float value;".encode())
    out += parameter("FW_RR_P", 0.05)
    for name, number in TOPICS.items():
        out += record("A", struct.pack("<BH", 0, number) + name.encode())
    data = lambda topic, us: record("D", struct.pack("<HQf", TOPICS[topic], us, 0.0))
    for k in range(2000):
        us = START + 10_000 * k
        out += data("vehicle_attitude", us)
        out += data("battery_status", us) if k % 100 == 0 else b""
        out += data("vehicle_land_detected", us) if k == 1800 else b""
        out += data("mission", 1_300_000_000) if k == 500 and mission else b""
        out += parameter("FW_RR_P", 0.08) if k == 750 else b""
        out += record("O", struct.pack("<H", 40)) if k == 1230 else b""
    return out

def times(raw, topics=None):
    """Seconds since the start of the log at which pyulog puts the change and the gap."""
    u = ULog(io.BytesIO(raw), topics)
    (changed, name, value), = u.changed_parameters
    assert name == "FW_RR_P" and abs(value - 0.08) < 1e-6 and u.dropouts[0].duration == 40 and not u.file_corruption
    return u, ((changed - START) / 1e6, (u.dropouts[0].timestamp - START) / 1e6)

print("pyulog", version("pyulog"), "- seconds from the start of the log: gain changed, gap (true: 7.50, 12.30; the log ends at 19.99)")
found = {}
for mission in (False, True):
    for topics in (None, ["vehicle_attitude"], ["battery_status"], ["vehicle_land_detected"]):
        u, seen = times(log(mission), topics)
        found[mission, topics and topics[0]] = seen
        print(f"{'with' if mission else 'no  '} mission of another boot, {topics[0] if topics else 'all topics':22} {seen[0]:8.2f} {seen[1]:8.2f}")
for mission in (False, True):
    assert found[mission, "vehicle_attitude"] == (7.5, 12.3) and found[mission, "battery_status"] == (7.0, 12.0)
    assert found[mission, "vehicle_land_detected"] == (0.0, 0.0)
assert found[False, None] == (7.5, 12.3) and found[True, None] == (1200.0, 1200.0)

cut = io.BytesIO()
times(log(False), ["battery_status", "vehicle_land_detected"])[0].write_ulog(cut)
raw, kinds = cut.getvalue(), []
at = 16
while at < len(raw):
    size, kind = struct.unpack_from("<HB", raw, at)
    if kind == ord("D"):
        kinds.append((struct.unpack_from("<Q", raw, at + 5)[0] - START) / 1e6)
    elif kind in b"PO" and kinds:
        kinds.append(chr(kind))
    at += 3 + size
where = kinds.index("P")
print("cut to two topics and written: the change stands between the records of", kinds[where - 1], "and", kinds[where + 1], "s")
whole = io.BytesIO()
times(log(True))[0].write_ulog(whole)
u, again = times(whole.getvalue(), ["vehicle_attitude"])
print(f"all topics written, then read beside the attitude alone: {again[0]:.2f} and {again[1]:.2f} s")
assert (kinds[where - 1], kinds[where + 1]) == (7.0, 8.0) and again == (19.99, 19.99)
PYTHON
