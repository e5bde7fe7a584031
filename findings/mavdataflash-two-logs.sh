#!/usr/bin/env bash
# MAVdataflash 3.0.0 (September 2025), logs of ArduPilot as data frames: two logs that are open at a time are one. The frames belong to the class, not to the object: each kind of record is read from the log that is asked first, and
# is then the answer for both. before.GetData("ATT") and after.GetData("ATT") are the same flight; read and opened in turn both are right, until the first is asked again and answers with the second.
# GetPARAM(), which goes another way, tells them apart; GetPARAMS() does not: of the second log the one gives 0.35 s and the other 0.5 s for the same gain.
# GetModes() names the modes of a copter, whatever flew: a plane's FBWA is LOITER, its ACRO GUIDED, its FBWB RTL, its GUIDED AUTOTUNE, and its AUTO and LOITER are UNKNOWN. What is in the log is a number; the message that names the vehicle is not read.
# Why it matters: gains before and after a change, or a model on the flight it was not fitted to, are compared with themselves and agree to the last digit; a plane's manual flight passes for an automatic one.
# The documentation begins with "Create a new instance". Instead: pymavlink's DFReader, which this package is built on; or one process for each log, and ModeNum.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/v" && "$folder/v/bin/pip" -q install --no-compile mavdataflash==3.0.0 pymavlink==2.4.50 polars==1.35.2 pandas==2.2.3 numpy==2.2.6 pyarrow==22.0.0
cd "$folder" && "$folder/v/bin/python" - <<'PYTHON'
import struct
from importlib.metadata import version

from MAVdataflash import DataFlash

CODES = {"B": "B", "f": "f", "Q": "Q", "M": "B", "N": "16s", "n": "4s", "Z": "64s"}
KINDS = {128: ("FMT", "BBnNZ", "Type,Length,Name,Format,Columns"), 10: ("ATT", "Qff", "TimeUS,Roll,Pitch"), 11: ("MODE", "QMBB", "TimeUS,Mode,ModeNum,Rsn"),
         12: ("PARM", "QNff", "TimeUS,Name,Value,Default"), 13: ("MSG", "QZ", "TimeUS,Message")}
PLANE = {0: "MANUAL", 4: "ACRO", 5: "FBWA", 6: "FBWB", 10: "AUTO", 12: "LOITER", 15: "GUIDED"}

def write(name, bank, gain):
    """A log as ArduPilot writes it: formats, the vehicle, a parameter, modes, one second of attitude."""
    out = bytearray()
    layout = lambda kind: "<" + "".join(CODES[c] for c in KINDS[kind][1])
    record = lambda kind, *values: out.extend(bytes((0xA3, 0x95, kind)) + struct.pack(layout(kind), *values))
    for kind, (label, form, columns) in KINDS.items():
        out.extend(bytes((0xA3, 0x95, 128)) + struct.pack("<BB4s16s64s", kind, 89 if kind == 128 else 3 + struct.calcsize(layout(kind)), label.encode(), form.encode(), columns.encode()))
    record(13, 1000, b"ArduPlane V4.6.3")
    record(12, 2000, b"RLL2SRV_TCONST", gain, 0.5)
    for k, mode in enumerate(PLANE):
        record(11, 100_000 * (k + 1), mode, mode, 1)
    for k in range(10):
        record(10, 1_000_000 + 100_000 * k, bank, 2.0)
    with open(name, "wb") as file:
        file.write(out)

write("before.bin", 10.0, 0.5)
write("after.bin", 40.0, 0.35)
bank = lambda log: sorted(set(log.GetData("ATT")["Roll"]))
listed = lambda log: round(float(log.GetPARAMS()["Value"].iloc[0]), 3)
asked = lambda log: round(float(log.GetPARAM("RLL2SRV_TCONST")), 3)
print("MAVdataflash", version("mavdataflash"), "- banks of 10 and 40 degrees, gains of 0.5 and 0.35")
before, after = DataFlash("before.bin"), DataFlash("after.bin")
both = bank(before), bank(after), listed(before), listed(after), asked(before), asked(after)
print(f"both open: banks {both[0]} and {both[1]}; GetPARAMS {both[2]} and {both[3]}; GetPARAM {both[4]} and {both[5]}")
before = DataFlash("before.bin")
first = bank(before)
after = DataFlash("after.bin")
turn = first, bank(after), bank(before)
print(f"in turn: before {turn[0]}, after {turn[1]}, before again {turn[2]}")
named = dict(zip(after.GetModes()["ModeNum"], after.GetModes()["ModeName"].str.strip()))
print("modes of a plane:", ", ".join(f"{PLANE[number]} {name}" for number, name in named.items()))
assert both == ([10.0], [10.0], 0.5, 0.5, 0.5, 0.35)
assert turn == ([10.0], [40.0], [40.0])
assert named == {0: "STABILIZE", 4: "GUIDED", 5: "LOITER", 6: "RTL", 10: "UNKNOWN", 12: "UNKNOWN", 15: "AUTOTUNE"}
PYTHON
