#!/usr/bin/env bash
# flightdx 0.1.0 (August 2026), incidents out of ArduPilot's logs: clipping of an accelerometer is found in no log since October 2020. Since then VIBE is a record for each IMU, with its counter in the field Clip; the detector adds up Clip0,
# Clip1 and Clip2, which are the names before, and takes what is not there for zero. One thousand clipped samples in 20 s are "critical" in the old layout, and no incident in the new one: the report says [NOMINAL]. On a live link it is found,
# since the MAVLink message still has three counters, and VIBE counts as present: the list of missing signals does not have it.
# A plane instead gets an incident that it has not: its outputs are taken for motors. "Only genuine motors" are meant by SERVOn_FUNCTION 33 to 44; where the list has none of these, as a plane's, all channels are taken, as if there were
# no list. A throttle above the surfaces is then a motor imbalance, and at full throttle a critical one, for as long as it climbs.
# Why it matters: clipping is the cause to be excluded before an estimator is looked at, and no incident is read as an exclusion; the alarm that comes at each climb is soon not read at all.
# The documentation: "VIBE (Vibration & Accelerometer Clipping)"; the source cites 72 real logs. Instead: the largest rise of VIBE.Clip of each IMU, in a program of your own.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/v" && "$folder/v/bin/pip" -q install --no-compile flightdx==0.1.0 pymavlink==2.4.50 pyulog==1.3.0 numpy==2.2.6 pydantic==2.14.4
cd "$folder" && "$folder/v/bin/python" - <<'PYTHON'
import struct
import subprocess
import sys
from importlib.metadata import version

from flightdx import analyze_log, parse_dataflash

CODES = {"B": "B", "H": "H", "I": "I", "f": "f", "Q": "Q", "N": "16s", "n": "4s", "Z": "64s"}
KINDS = {"FMT": ("BBnNZ", "Type,Length,Name,Format,Columns"), "MSG": ("QZ", "TimeUS,Message"), "PARM": ("QNff", "TimeUS,Name,Value,Default"), "RCOU": ("QHHHH", "TimeUS,C1,C2,C3,C4")}
VIBE = {"one record for each IMU": ("QBfffI", "TimeUS,IMU,VibeX,VibeY,VibeZ,Clip"), "before October 2020": ("QfffIII", "TimeUS,VibeX,VibeY,VibeZ,Clip0,Clip1,Clip2")}
COPTER, PLANE = (b"ArduCopter V4.6.3", (33, 34, 35, 36), lambda t: (1500, 1510, 1490, 1500)), (b"ArduPlane V4.6.3", (4, 19, 70, 21), lambda t: (1500, 1470, 1960 if t < 30 else 1600, 1500))

def write(name, layout, vehicle, clipping):
    """A minute at 10 Hz; between 20 and 40 s the second accelerometer clips 50 times a second."""
    kinds, out = KINDS | {"VIBE": VIBE[layout]}, bytearray()
    number = {label: 128 - k for k, label in enumerate(kinds)}
    fields = lambda label: "<" + "".join(CODES[c] for c in kinds[label][0])
    record = lambda label, *values: out.extend(bytes((0xA3, 0x95, number[label])) + struct.pack(fields(label), *values))
    for label, (form, columns) in kinds.items():
        record("FMT", number[label], 89 if label == "FMT" else 3 + struct.calcsize(fields(label)), label.encode(), form.encode(), columns.encode())
    message, functions, outputs = vehicle
    record("MSG", 1000, message)
    for n, function in enumerate(functions, 1):
        record("PARM", 2000, f"SERVO{n}_FUNCTION".encode(), function, function)
    for k in range(600):
        us, clips = 1_000_000 + 100_000 * k, 5 * max(0, min(k - 200, 200)) if clipping else 0
        if layout == "before October 2020":
            record("VIBE", us, 10, 10, 12, 0, clips, 0)
        else:
            record("VIBE", us, 0, 10, 10, 12, 0), record("VIBE", us, 1, 10, 10, 12, clips)
        record("RCOU", us, *outputs(k / 10))
    with open(name, "wb") as file:
        file.write(out)

def incidents(layout, vehicle, clipping):
    write("log.bin", layout, vehicle, clipping)
    timeline = analyze_log(parse_dataflash("log.bin"))
    assert timeline.vehicle_type == vehicle[0].split()[0].decode() and "vibration" in timeline.quality.can_run_detectors
    return [(i.type, i.severity, round(i.t_start), round(i.t_end), [(e.metric, e.value) for e in i.evidence]) for i in timeline.incidents]

print("flightdx", version("flightdx"))
found = {layout: incidents(layout, COPTER, True) for layout in VIBE}
for layout, list_ in found.items():
    print(f"copter, 1000 clipped samples, VIBE {layout}: {list_ or 'no incident'}")
write("log.bin", "one record for each IMU", COPTER, True)
report = subprocess.run([sys.executable, "-m", "flightdx.cli", "log.bin"], capture_output=True, text=True, env={"PYTHONIOENCODING": "utf-8"}).stdout
print("its report:", [line.strip() for line in report.splitlines() if "Vibration" in line or "NOMINAL" in line])
plane = incidents("one record for each IMU", PLANE, False)
print("plane, nothing wrong, 30 s of climb:", plane)
assert found["one record for each IMU"] == [] and [i[:4] for i in found["before October 2020"]] == [("accel_clipping", "critical", 21, 41)]
assert [i[:4] for i in plane] == [("actuator_saturation", "critical", 1, 31)]
PYTHON
