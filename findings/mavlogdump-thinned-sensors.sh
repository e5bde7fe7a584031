#!/usr/bin/env bash
# pymavlink 2.4.50: mavlogdump.py --reduce 2 of a log with two IMUs is not half of each IMU but the whole of the second one and nothing of the first; so with GPS receivers and the lanes of the estimator.
# With --reduce 3 both remain. The counter, as the clock of --reduce-rate, is kept by the type of record, and the sensors of one type write in turn. With --reduce-rate 50 the two IMUs take turns, 20 and 30 ms apart,
# and the second GPS receiver is gone; --reduce-rate 100 takes about half of an attitude that was logged at exactly 100 Hz: times that lie 10 ms apart often differ by less as floating-point seconds since 1970.
# Why it matters: a log thinned for identification lacks the sensor the estimator flew on, or hops from one IMU's bias to the other's, and still is a valid log.
# The tool's help says "reduce streaming messages" and "reduce messages to maximum rate in Hz". ArduPilot writes the instance into each record (field I, in the estimator's C).
# Instead: take the records of one instance (--condition does not limit what --reduce has already taken), then every n-th of them, in a program of your own.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/v" && "$folder/v/bin/pip" -q install pymavlink==2.4.50
cat > "$folder/log.py" <<'PYTHON'
"""`write NAME`: a flight of 20 s. `read NAME`: the number of records of each type and instance."""
import struct
import sys
from collections import Counter

from pymavlink import mavutil

CODES = {"Q": "Q", "B": "B", "H": "H", "I": "I", "f": "f", "L": "i", "e": "i", "n": "4s", "N": "16s", "Z": "64s"}
TYPES = {
    "FMT": (128, "BBnNZ", "Type,Length,Name,Format,Columns"),
    "IMU": (140, "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"),
    "GPS": (141, "QBBIHBLLeff", "TimeUS,I,Status,GMS,GWk,NSats,Lat,Lng,Alt,Spd,GCrs"),
    "XKF1": (142, "QBfff", "TimeUS,C,Roll,Pitch,Yaw"),
    "ATT": (143, "Qfff", "TimeUS,Roll,Pitch,Yaw"),
}

def packed(name, *values):
    kind, form, _ = TYPES[name]
    return struct.pack("<BBB" + "".join(CODES[c] for c in form), 0xA3, 0x95, kind, *values)

def flight():
    for name, (kind, form, columns) in TYPES.items():
        size = struct.calcsize("<BBB" + "".join(CODES[c] for c in form))
        yield packed("FMT", kind, size, name.encode(), form.encode(), columns.encode())
    for k in range(2000):
        us = 10_000_000 + 10_000 * k
        for sensor in (0, 1):
            yield packed("IMU", us + 100 * sensor, sensor, 0.01 * sensor, 0.0, 0.0, 0.0, 0.0, -9.81)
        for lane in (0, 1):
            yield packed("XKF1", us + 300 + 100 * lane, lane, 1.0, 2.0, 3.0)
        yield packed("ATT", us + 600, 1.0, 2.0, 3.0)
        for receiver in (0, 1) if k % 20 == 0 else ():
            yield packed("GPS", us + 700 + 100 * receiver, receiver, 3, 200_000_000 + 10 * k, 2400, 15, 471234567, 85432101, 45600, 15.0, 90.0)

if sys.argv[1] == "write":
    open(sys.argv[2], "wb").writelines(flight())
else:
    log, found = mavutil.mavlink_connection(sys.argv[2]), Counter()
    while (m := log.recv_match(type=["IMU", "GPS", "XKF1", "ATT"])) is not None:
        found[m.get_type() + "".join(str(getattr(m, label, "")) for label in "IC")] += 1
    print(*(f"{name} {found[name]}" for name in ("IMU0", "IMU1", "XKF10", "XKF11", "GPS0", "GPS1", "ATT")))
PYTHON
py="$folder/v/bin/python"; whole="$folder/whole.bin"
"$py" "$folder/log.py" write "$whole"
thinned() { "$py" "$folder/v/bin/mavlogdump.py" -q "$@" -o "$folder/thin.bin" "$whole" >/dev/null; "$py" "$folder/log.py" read "$folder/thin.bin"; }
echo "pymavlink $("$py" -c 'import importlib.metadata as m; print(m.version("pymavlink"))')"
all=$("$py" "$folder/log.py" read "$whole"); echo "logged            $all"
two=$(thinned --reduce 2); echo "--reduce 2        $two"
three=$(thinned --reduce 3); echo "--reduce 3        $three"
fifty=$(thinned --reduce-rate 50); echo "--reduce-rate 50  $fifty"
hundred=$(thinned --reduce-rate 100); echo "--reduce-rate 100 $hundred"
test "$all" = "IMU0 2000 IMU1 2000 XKF10 2000 XKF11 2000 GPS0 100 GPS1 100 ATT 2000"
test "$two" = "IMU0 0 IMU1 2000 XKF10 0 XKF11 2000 GPS0 0 GPS1 100 ATT 1000"
read -r _ a _ b _ _ _ _ _ _ _ _ _ att <<<"$three"; ((a > 650 && b > 650 && att > 650 && a < 680 && b < 680 && att < 680))
read -r _ a _ b _ _ _ _ _ _ _ _ _ att <<<"$fifty"; ((a > 200 && b > 200 && a + b < 1000 && att < 900))
read -r _ a _ b _ _ _ _ _ g _ h _ att <<<"$hundred"; ((a > 400 && b > 400 && att > 800 && att < 1400))
