#!/usr/bin/env bash
# pymavlink 2.4.50, mavpose 0.4.0 and signalviewer-lite 1.14.0 (both of 2026): in the telemetry of a PX4 every integer parameter is read as a number next to zero, or as not a number. PX4 puts the four bytes of an
# integer into the field of a float, and says so twice: by the type in each PARAM_VALUE and by a bit of AUTOPILOT_VERSION. None of the three looks at either. pymavlink's own tool, mavparms.py, lists 0.000000 for the
# airframe's number, for the reversed outputs and for the sensors' identities, and nan for -1; mavparmdiff.py then finds two aircraft of different airframes alike. Floats are right, and so is all of ArduPilot's.
# Why it matters: a zero is a valid value of most of these: no output reversed, no sensor calibrated, no airframe chosen. What is checked against such a list (a mixer, an orientation of the board) passes or fails for nothing.
# MAVLink's guide of the parameter protocol describes both encodings. Instead: pack the value as a float and unpack it by param_type, when the autopilot has the bit; or the parameters of the ULog of the same flight.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv v && v/bin/pip -q install pymavlink==2.4.50 mavpose==0.4.0 signalviewer-lite==1.14.0
cat > log.py <<'PYTHON'
"""Writes the telemetry of two aircraft."""
import struct

from pymavlink.dialects.v20 import common as wire

INT32, REAL32 = wire.MAV_PARAM_TYPE_INT32, wire.MAV_PARAM_TYPE_REAL32
FIRST = {"CAL_BARO0_PRIO": -1, "COM_RC_LOSS_T": 0.5, "FW_AIRSPD_TRIM": 15.0, "PWM_MAIN_REV": 6, "SENS_BOARD_ROT": 2, "SYS_AUTOSTART": 2106}
SECOND = FIRST | {"PWM_MAIN_REV": 0, "SYS_AUTOSTART": 13013}
for name, parameters in (("first.tlog", FIRST), ("second.tlog", SECOND)):
    mav, us = wire.MAVLink(None, 1, 1), 1_790_000_000_000_000
    with open(name, "wb") as log:
        def put(message):
            global us
            us += 20_000
            log.write(struct.pack(">Q", us) + message.pack(mav))
        beat = mav.heartbeat_encode(wire.MAV_TYPE_FIXED_WING, wire.MAV_AUTOPILOT_PX4, 81, 4 << 16 | 4 << 24, wire.MAV_STATE_ACTIVE)
        put(beat)
        able = wire.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE | wire.MAV_PROTOCOL_CAPABILITY_MAVLINK2
        put(mav.autopilot_version_encode(able, 0x01110000, 0, 0, 0, bytes(8), bytes(8), bytes(8), 0, 0, 0))
        for k, (key, value) in enumerate(parameters.items()):
            whole = isinstance(value, int)
            sent = struct.unpack("<f", struct.pack("<i", value))[0] if whole else value
            put(mav.param_value_encode(key.encode(), sent, INT32 if whole else REAL32, len(parameters), k))
        for k in range(100):
            put(mav.attitude_encode(20 * k, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0))
            put(beat)
PYTHON
v/bin/python log.py
echo "pymavlink 2.4.50, mavparms.py"; v/bin/python v/bin/mavparms.py first.tlog | tee first.parm
v/bin/python v/bin/mavparms.py second.tlog > second.parm
differing=$(v/bin/python v/bin/mavparmdiff.py first.parm second.parm | grep -c "^[A-Z0-9_]*  *[-0-9.n]" || true)
echo "pymavlink 2.4.50, mavparmdiff.py: two aircraft with other airframes and reversed outputs differ in $differing parameters"
test "$differing" = 0
for name in PWM_MAIN_REV SENS_BOARD_ROT SYS_AUTOSTART; do grep -q "^$name  *0.000000$" first.parm; done
grep -q "^CAL_BARO0_PRIO  *-\?nan$" first.parm && grep -q "^FW_AIRSPD_TRIM  *15.000000$" first.parm
cat > read.py <<'PYTHON'
import math
import struct
import sys
from importlib.metadata import version
from pathlib import Path

import mavpose
import signalviewer
from pymavlink import mavutil

log = mavutil.mavlink_connection("first.tlog")
while log.recv_match() is not None:
    pass
rows = mavpose.load("first.tlog").frame("PARAM_VALUE")
sys.path.insert(0, str(Path(signalviewer.__file__).parent / "_core"))
from svcore.tlog_loader import load_tlog
shown = {p["name"]: p["value"] for p in load_tlog("first.tlog", "first")[0]._flightlog.log_info()["params"]}
for name, read in (("pymavlink", dict(log.params)), ("mavpose", dict(zip(rows["param_id"], rows["param_value"]))), ("signalviewer-lite", shown)):
    print(name, version(name), {k: float(f"{v:.4g}") for k, v in sorted(read.items())})
    assert all(0 < read[k] < 1e-38 for k in ("PWM_MAIN_REV", "SENS_BOARD_ROT", "SYS_AUTOSTART")) and math.isnan(read["CAL_BARO0_PRIO"])
    assert read["FW_AIRSPD_TRIM"] == 15.0 and read["COM_RC_LOSS_T"] == 0.5
# what was sent is in the log
assert struct.unpack("<i", struct.pack("<f", log.params["SYS_AUTOSTART"]))[0] == 2106
PYTHON
v/bin/python read.py
