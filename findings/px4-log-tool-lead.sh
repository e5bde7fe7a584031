#!/usr/bin/env bash
# px4-log-tool 0.6.4 (2026): ulog2csv --merge --resample puts each value at the beginning of the interval in which it was last logged. A topic of 250 Hz is so moved ahead by 96 ms at the rate of the template, 10 Hz, and one
# of 10 Hz by whatever remains of its phase, here 1.5 ms: in the table the gyro turns 94 ms before the actuator moves. At 50 Hz it is 16 ms, at 100 Hz 6 and 8 ms in turn. What is between two values is filled along a line, from the moved ones.
# Not the mean: `num_method: mean` stands in the template and is not used as long as `interpolate_numerical` is true, as it is there too. The period is rounded to whole milliseconds: who asks for 400 Hz gets 500 Hz.
# Why it matters: an aircraft that answers before its surfaces move is fitted with a delay that is too short or negative, and with an actuator that is faster than it is. The tables of single topics, as ulog2csv
# writes them without these options, are right. The help says "resample data to a given frequency". Instead: interpolate each topic at common times, with what changes faster than that filtered before.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv v && v/bin/pip -q install px4-log-tool==0.6.4 setuptools==75.8.0
cat > log.py <<'PYTHON'
"""`write`: a log of 6 s in which every value is the second at which it was logged. `read RATE`: by how much the table's values are later than its stamps."""
import struct
import sys
from importlib.metadata import version

import pandas as pd

START = 10_000_000

def record(kind, body):
    return struct.pack("<HB", len(body), ord(kind)) + body

if sys.argv[1] == "write":
    out = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", START) + record("B", bytes(40))
    out += record("F", b"sensor_combined:uint64_t timestamp;float[3] gyro_rad;")
    out += record("F", b"actuator_outputs:uint64_t timestamp;uint32_t noutputs;float[16] output;")
    out += record("A", struct.pack("<BH", 0, 0) + b"sensor_combined") + record("A", struct.pack("<BH", 0, 1) + b"actuator_outputs")
    at = sorted([(4_000 * k, 0) for k in range(1500)] + [(100_000 * k + 1_500, 1) for k in range(60)])
    for us, topic in at:
        values = struct.pack("<3f", *[us * 1e-6] * 3) if topic == 0 else struct.pack("<I16f", 4, *[us * 1e-6] * 16)
        out += record("D", struct.pack("<HQ", topic, START + us) + values)
    open("logs/flight.ulg", "wb").write(out)
else:
    wanted, table = float(sys.argv[2]), pd.read_csv("unified.csv")
    stamps = (pd.to_datetime(table["timestamp"], format="mixed") - pd.Timestamp(START, unit="us")).dt.total_seconds()
    table, stamps = table[stamps.between(0.5, 5.5)], stamps[stamps.between(0.5, 5.5)]
    lead = {name: 1000 * (table[column] - stamps) for name, column in (("gyro", "SensorCombined_gyro_rad_0"), ("actuator", "ActuatorOutputs_output_0"))}
    rate = 1 / stamps.diff().median()
    print(f"px4-log-tool {version('px4-log-tool')}, {wanted:3.0f} Hz asked, {rate:5.1f} Hz got: early by", *(f"{name} {x.mean():5.1f} ms ({x.min():.1f} to {x.max():.1f})" for name, x in lead.items()))
    first = {10: 96, 50: 16, 100: 7}.get(wanted)
    if first:
        assert abs(lead["gyro"].mean() - first) < 0.6 and abs(lead["actuator"] - 1.5).max() < 0.3 and abs(rate - wanted) < 0.5
    else:
        assert abs(rate - 500) < 2
PYTHON
mkdir logs; v/bin/python log.py write
for rate in 10 50 100 400; do
  v/bin/px4-log-tool generate-filter-template >/dev/null
  grep -q "target_frequency_hz: 10$" filter.yaml && grep -q "num_method: mean" filter.yaml && grep -q "interpolate_numerical: true" filter.yaml
  sed -i "s/target_frequency_hz: 10$/target_frequency_hz: $rate/" filter.yaml
  v/bin/px4-log-tool ulog2csv logs --merge --resample --filter filter.yaml --output_dir "out$rate" >/dev/null 2>&1
  v/bin/python log.py read $rate
  rm -f unified.csv
done
# the same topics as the tool writes them without resampling: stamps and values agree
v/bin/python - <<'PYTHON'
import pandas as pd
plain = pd.read_csv("out10/logs/flight/sensor_combined.csv")
assert abs(plain["gyro_rad_0"] - (plain["timestamp"] - 10_000_000) * 1e-6).max() < 1e-6
PYTHON
