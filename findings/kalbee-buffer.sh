#!/usr/bin/env bash
# kalbee 1.0.0 (September 2026), Kalman filters in Python: AsyncSensorBuffer, its buffer for measurements that come late, begins again at the take-off with each measurement. It keeps the last buffer_capacity of them, 50 unless told
# otherwise, and computes these anew from the state given to initialize(); what falls out of the buffer is not carried into that state, it is forgotten. All in order and at an even rate, it is the plain filter to the last digit up to the
# 50th measurement. After half a minute at 10 Hz, with the package's KalmanFilter, an aircraft that slowed from 20 to 15 m/s has 24 m/s, claimed to 0.1, and is 15 m ahead: the 25 s between take-off and the buffer are one step of the
# transition matrix to it. An ExtendedKalmanFilter, which is told the 25 s, takes them in one prediction with the process noise of one step and has 16.3 m/s, claimed to 0.07, drawn to the mean speed since take-off.
# And time passes between measurements of the same time: the second of two has the step dt_default before it. Two receivers at 10 Hz, both exact, halve the speed: 10 m/s of 20, claimed to 0.07.
# Why it matters: a test of the five seconds for which such a buffer is written passes, late measurements included (checked here); the error afterwards grows with the flight and is hidden in a window that fits its own measurements.
# The documentation: the buffer brings "the filter up to the latest timestamp"; capacity is the "maximum number of historical measurements to store". Instead: a buffer_capacity for the whole flight, whose time per measurement grows
# with it, an ExtendedKalmanFilter whose process noise is for an even rate, and simultaneous measurements as one vector; or checkpoints of your own, moved on with what leaves the window.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/v" && "$folder/v/bin/pip" -q install --no-compile kalbee==1.0.0 numpy==2.2.6 scipy==1.15.3
OPENBLAS_NUM_THREADS=1 "$folder/v/bin/python" - <<'PYTHON'
from importlib.metadata import version

import numpy as np
from kalbee import AsyncSensorBuffer, ExtendedKalmanFilter, KalmanFilter

DT, NOISE = 0.1, 1.0
H, R, Q = np.array([[1.0, 0.0]]), np.array([[NOISE**2]]), np.diag([1e-6, 1e-4])
START, SPREAD = np.array([[0.0], [20.0]]), np.eye(2)     # position and speed at take-off
moved = lambda dt: np.array([[1.0, dt], [0.0, 1.0]])

def linear():
    return KalmanFilter(START.copy(), SPREAD.copy(), moved(DT), Q, H, R)

def extended():
    return ExtendedKalmanFilter(START.copy(), SPREAD.copy(), Q, R, lambda x, dt: moved(dt) @ x, lambda x: H @ x, lambda x, dt: moved(dt), lambda x: H)

def buffered(filter_, **options):
    buffer = AsyncSensorBuffer(filter_, dt_default=DT, **options)
    buffer.initialize(0.0, START.copy(), SPREAD.copy())
    return buffer

def written_out(measured):
    """The Kalman filter at an even rate; each row of `measured` has the measurements of one time."""
    x, P = START, SPREAD
    for row in measured:
        x, P = moved(DT) @ x, moved(DT) @ P @ moved(DT).T + Q
        for z in row:
            gain = P @ H.T / (P[0, 0] + NOISE**2)
            x, P = x + gain * (z - x[0, 0]), P - gain @ H @ P
    return x.ravel(), np.sqrt(np.diag(P))

print("kalbee", version("kalbee"))
times = DT * np.arange(1, 301)
truth = 20 * np.minimum(times, 10) + 15 * np.maximum(times - 10, 0)
measured = truth + np.random.default_rng(0).normal(0, NOISE, len(times))
seen = {}
for make in (linear, extended):
    for label, options in (("capacity 50", {}), ("capacity 1000", {"buffer_capacity": 1000})):
        buffer = buffered(make(), **options)
        for k, (t, z) in enumerate(zip(times, measured), 1):
            x, P = buffer.add_measurement(t, np.array([[z]]))
            if k in (50, 300):
                right, sigma = written_out(measured[:k, None])
                seen[make, label, k] = x[1, 0]
                print(f"{make.__name__:8} {label:13} after {k:3}: position {x[0, 0]:7.1f}, speed {x[1, 0]:5.2f} +- {np.sqrt(P[1, 1]):.2f}; written out {right[0]:6.1f}, {right[1]:5.2f} +- {sigma[1]:.2f}; true {truth[k - 1]:6.1f}, {20 if k == 50 else 15}")
                if k == 50 or label == "capacity 1000":
                    assert np.allclose(x.ravel(), right, atol=1e-6) and np.allclose(np.sqrt(np.diag(P)), sigma, atol=1e-6)
assert abs(seen[linear, "capacity 50", 300] - 24.15) < 0.1 and abs(seen[extended, "capacity 50", 300] - 16.28) < 0.1 and abs(seen[linear, "capacity 1000", 300] - 15) < 0.2

late = buffered(extended())
for k in [*range(10), *range(19, 9, -1), *range(20, 40)]:
    late.add_measurement(times[k], np.array([[measured[k]]]))
assert np.allclose(late.latest_state.ravel(), written_out(measured[:40, None])[0])
print("ten measurements in reverse order, within the capacity: as written out")

for sensors in (1, 2):
    buffer = buffered(extended(), buffer_capacity=1000)
    for t in times[:100]:
        for _ in range(sensors):
            x, P = buffer.add_measurement(t, np.array([[20.0 * t]]))
    right, sigma = written_out(np.repeat(20 * times[:100, None], sensors, axis=1))
    print(f"{sensors} exact receivers, 10 s at 20 m/s: speed {x[1, 0]:.2f} +- {np.sqrt(P[1, 1]):.2f}; written out {right[1]:.2f} +- {sigma[1]:.2f}")
    assert abs(x[1, 0] - 20 / sensors) < 0.1 and abs(right[1] - 20) < 1e-6 and np.sqrt(P[1, 1]) < 0.1
PYTHON
