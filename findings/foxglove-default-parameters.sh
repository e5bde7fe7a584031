#!/usr/bin/env bash
# @foxglove/ulog 2.3.2 and @lichtblick/ulog 1.0.0 (npm), the ULog readers of Foxglove and Lichtblick: header.parameters holds the default of every parameter that was set to something else, and the true value only of
# those that were left alone. PX4 writes all values, and then the defaults of those that differ; the reader puts both in one table, so that the default, which comes last, remains. Of the two kinds of default it keeps
# that which came last too, here the one of the airframe, with `defaultTypes` other than 0 as the only trace: the value that was flown is nowhere in what is returned. pyulog 1.3.0 keeps the three apart.
# Why it matters: the gains that were tuned, the sensors that were calibrated and the surfaces that were reversed are those that differ. A controller that is rebuilt from such a table is the factory's, and looks plausible.
# The packages' pages do not speak of defaults. (A log of PX4 1.17 in simulation has 933 values and then 122 defaults.) Instead: pyulog, or read the records of kind P.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv v && v/bin/pip -q install pyulog==1.3.0 numpy==2.2.6
npm init -y >/dev/null && npm install --silent --no-audit --no-fund @foxglove/ulog@2.3.2 @lichtblick/ulog@1.0.0 >/dev/null
cat > log.py <<'PYTHON'
"""Writes a log in PX4's order, and what pyulog reads of its parameters."""
import struct
from importlib.metadata import version

from pyulog import ULog

def record(kind, body):
    return struct.pack("<HB", len(body), ord(kind)) + body

def parameter(name, value, kinds=b""):
    key = ("int32_t " if isinstance(value, int) else "float ").encode() + name.encode()
    return record("Q" if kinds else "P", kinds + bytes([len(key)]) + key + struct.pack("<i" if isinstance(value, int) else "<f", value))

out = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 1_000_000) + record("B", bytes(40))
out += record("F", b"vehicle_attitude:uint64_t timestamp;float[4] q;")
for name, value in {"FW_AIRSPD_TRIM": 15.0, "FW_PR_P": 0.14, "FW_RR_P": 0.11, "PWM_MAIN_REV": 6}.items():
    out += parameter(name, value)
SYSTEM, AIRFRAME = b"\x01", b"\x02"
for kinds, name, value in ((SYSTEM, "FW_PR_P", 0.08), (SYSTEM, "FW_RR_P", 0.05), (AIRFRAME, "FW_RR_P", 0.09), (SYSTEM, "PWM_MAIN_REV", 0)):
    out += parameter(name, value, kinds)
out += record("A", struct.pack("<BH", 0, 0) + b"vehicle_attitude")
for k in range(100):
    out += record("D", struct.pack("<HQ4f", 0, 1_000_000 + 10_000 * k, 1.0, 0.0, 0.0, 0.0))
open("flight.ulg", "wb").write(out)

u = ULog("flight.ulg")
rounded = lambda table: {k: round(v, 4) for k, v in sorted(table.items())}
print("pyulog", version("pyulog"), rounded(u.initial_parameters), "defaults", rounded(u.get_default_parameters(0)), "airframe's", rounded(u.get_default_parameters(1)))
assert rounded(u.initial_parameters) == {"FW_AIRSPD_TRIM": 15.0, "FW_PR_P": 0.14, "FW_RR_P": 0.11, "PWM_MAIN_REV": 6}
assert rounded(u.get_default_parameters(0)) == {"FW_PR_P": 0.08, "FW_RR_P": 0.05, "PWM_MAIN_REV": 0} and rounded(u.get_default_parameters(1)) == {"FW_RR_P": 0.09}
PYTHON
v/bin/python log.py
cat > read.cjs <<'JS'
const assert = require("node:assert");
(async () => {
  for (const name of ["@foxglove/ulog", "@lichtblick/ulog"]) {
    const { ULog } = require(name), { FileReader } = require(name + "/node");
    const log = new ULog(new FileReader("flight.ulg"));
    await log.open();
    const seen = {}, kinds = {};
    for (const [key, { value, defaultTypes }] of log.header.parameters) {
      seen[key] = Math.round(value * 1e4) / 1e4;
      kinds[key] = defaultTypes;
    }
    console.log(name, require(`./node_modules/${name}/package.json`).version, JSON.stringify(seen), "defaultTypes", JSON.stringify(kinds));
    assert.deepStrictEqual(seen, { FW_AIRSPD_TRIM: 15, FW_PR_P: 0.08, FW_RR_P: 0.09, PWM_MAIN_REV: 0 });
    assert.deepStrictEqual(kinds, { FW_AIRSPD_TRIM: 0, FW_PR_P: 1, FW_RR_P: 2, PWM_MAIN_REV: 1 });
    let later = 0;
    for await (const message of log.readMessages()) later += message.type !== 68 && message.type !== 65;
    assert.strictEqual(later, 0);
  }
})();
JS
node read.cjs
