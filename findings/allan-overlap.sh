#!/usr/bin/env bash
# allan_variance_analyzer 1.0.4 (July 2026), noise of gyros and accelerometers by the Allan deviation: with overlap, which is the default of compute_allan_variances() and what most of the literature recommends, neighbours that are
# one sample apart are subtracted, not windows that follow each other. White noise then falls with the averaging time itself and not with its root: of a gyro with 0.01 deg/s/sqrt(Hz) 0.001 remains at 1 s and 0.00001 at 100 s.
# The overlap, a fraction, is made into a number of samples by one function, and is taken for a fraction by the next, so that the stride is one sample whatever was asked for: 0.1 and 0.9 give the same. The imu.yaml for Kalibr, which the
# package is for, has a twentieth of the true noise density; the analyzer's own default, no overlap, is right.
# And the analyzer changes its argument: gyro columns are converted to degrees in place. Whoever runs the same array a second time, with another overlap for comparison, gets 57 times the noise.
# Why it matters: an estimator that is told a twentieth of its gyro's noise is overconfident from then on, and only that. The documentation: "overlap: The overlap between bins". Instead: overlap=0, data.copy(), or an Allan deviation
# of your own, in which windows one whole window apart are subtracted at whatever stride.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/v"
"$folder/v/bin/pip" -q install --no-compile numpy==2.2.6 scipy==1.15.3 matplotlib==3.10.3 pyyaml==6.0.2 loguru==0.7.3 tqdm==4.67.1
"$folder/v/bin/pip" -q install --no-compile --no-deps allan_variance_analyzer==1.0.4
cd "$folder"
OPENBLAS_NUM_THREADS=1 MPLBACKEND=Agg "$folder/v/bin/python" - 2>errors <<'PYTHON' || { cat errors; exit 1; }
import contextlib
import io
from importlib.metadata import version

import numpy as np
import yaml
from allan_variance_analyzer.base import AllanVarianceAnalyzer
from allan_variance_analyzer.statistics import compute_allan_variances

RATE, GYRO = 100, 0.01   # Hz; deg/s/sqrt(Hz)
record = np.random.default_rng(0).standard_normal((1800 * RATE, 6)) * GYRO * np.sqrt(RATE)
periods = np.array([0.1, 1.0, 10.0, 100.0])
theory = GYRO / np.sqrt(periods)

def right(windows, stride):
    """Allan deviation of the first column with overlapping windows."""
    total = np.concatenate(([0.0], np.cumsum(record[:, 0])))
    means = (total[windows:] - total[:-windows]) / windows
    return np.sqrt(np.mean((means[windows:] - means[:-windows])[::stride] ** 2) / 2)

print("allan_variance_analyzer", version("allan_variance_analyzer"), "- Allan deviation (deg/s) of white noise at", periods, "s")
print("theory                      ", theory)
print("overlapping, first principles", np.array([right(int(p * RATE), max(1, int(p * RATE) // 2)) for p in periods]))
seen = {}
for overlap in (0, 0.1, 0.5, 0.9):
    seen[overlap] = np.sqrt(compute_allan_variances(record, periods, RATE, overlap)[:, 0])
    print(f"package, overlap {overlap:3}         ", seen[overlap])
assert np.allclose(seen[0][:3], theory[:3], rtol=0.15) and np.allclose(seen[0][3], theory[3], rtol=0.5)
assert np.array_equal(seen[0.5], np.sqrt(compute_allan_variances(record, periods, RATE)[:, 0])), "the default is 0.5"
assert np.allclose(seen[0.5], GYRO / np.sqrt(RATE) / periods, rtol=0.05)   # slope -1: windows of one sample apart
assert np.array_equal(seen[0.5], seen[0.9]) and np.allclose(seen[0.1][2:], seen[0.9][2:])

with open("imu.cfg", "w") as file:
    yaml.safe_dump({"imu_rate": RATE, "measure_rate": RATE}, file)
given = np.column_stack((record[:, :3], np.radians(record[:, 3:])))
density = {}
for name, overlap, array in (("no overlap", 0, given.copy()), ("overlap 0.5", 0.5, given.copy()), ("no overlap", 0, given), ("the same array again", 0, given)):
    with contextlib.redirect_stdout(io.StringIO()):
        AllanVarianceAnalyzer("imu.cfg", ".", overlap=overlap, period_max=20).run(array)
    with open("imu.yaml") as file:
        density[name] = yaml.safe_load(file)["gyroscope_noise_density"] * 180 / np.pi
    print(f"imu.yaml, {name:20}: gyroscope_noise_density {density[name]:.5f} deg/s/sqrt(Hz), true {GYRO}")
assert abs(density["no overlap"] / GYRO - 1) < 0.1 and density["overlap 0.5"] < 0.25 * GYRO
assert abs(density["the same array again"] / density["no overlap"] - 180 / np.pi) < 0.1
PYTHON
