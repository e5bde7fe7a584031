#!/usr/bin/env bash
# fast-kalman 0.2.4 (May 2026), Kalman filters in C++ for Python: its ensemble filter has one correction in Python, correct_deterministic(), and this leaves out the measurement's noise: every member moves by the full gain to the
# same measurement, so that the covariance becomes (I-KH)P(I-KH)' and lacks KRK'. Ensemble filters without perturbed measurements take half the gain or a square root for the members for just this reason; the C++ side has a correction
# with noise, which is not bound. Of a prior variance of 4 and a measurement's of 1 there remains 0.16; it is 0.8, and the mean of this first step is right. The package's linear filter is exact here, and so are its EKF and UKF.
# From the second step on the mean is wrong too, since the gain follows from that covariance: a constant that is known to 10 and measured with 1 stays near its first measurement. After 100 measurements the error is 0.55 at a claimed 0.06;
# the right one is 0.10. From an even start it converges, at a rate of its own, with half the variance claimed.
# Why it matters: a bias of a sensor, a wind, or a derivative is such a constant; the estimate is smooth, plausible, and the first sample. A wider start makes it worse.
# The documentation names the method and does not say it. correct_deterministic_batch() does the same. Instead: the package's UnscentedKalmanFilter, with the same two functions and without their derivatives.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/v" && "$folder/v/bin/pip" -q install --no-compile fast-kalman==0.2.4 numpy==2.2.6
OPENBLAS_NUM_THREADS=1 "$folder/v/bin/python" - <<'PYTHON'
from importlib.metadata import version

import kalman
import numpy as np

rng = np.random.default_rng(0)
first = lambda x: np.array([x[0]])

def ensemble(mean, covariance):
    """Eight members whose mean and covariance are exactly these."""
    members = rng.normal(size=(8, len(mean)))
    members -= members.mean(0)
    members = members @ np.linalg.inv(np.linalg.cholesky(np.cov(members.T).reshape(len(mean), -1))).T @ np.linalg.cholesky(covariance).T + mean
    assert np.allclose(members.mean(0), mean) and np.allclose(np.cov(members.T), covariance)
    return members.tolist()

print("fast-kalman", version("fast-kalman"))
P = np.array([[4.0, 1.0], [1.0, 2.0]])
enkf = kalman.EnsembleKalmanFilter(2, 1, members=ensemble([0.0, 0.0], P), R=[1.0])
linear = kalman.LinearKalmanFilter(2, 1, x=[0.0, 0.0], P=P.ravel(), F=[1, 0, 0, 1], Q=[0] * 4, H=[1, 0], R=[1.0])
enkf.correct_deterministic([1.5], first), linear.correct([1.5])
gain = P[:, 0] / 5.0
got, right = np.array(enkf.P), np.array(linear.P)
lost = (np.eye(2) - np.outer(gain, [1, 0])) @ P @ (np.eye(2) - np.outer(gain, [1, 0])).T
print(f"one measurement: mean {np.round(enkf.x, 4)}, the linear filter {np.round(linear.x, 4)}; covariance {got.round(4)}, the linear filter {right.round(4)}, without the measurement's noise {lost.ravel().round(4)}")
assert np.allclose(enkf.x, linear.x) and np.allclose(right, (P - 5 * np.outer(gain, gain)).ravel())
assert np.allclose(got, lost.ravel()) and abs(got[0] / right[0] - 0.2) < 1e-9

def constant(start, count, runs=300):
    """A constant, known to `start` at first, measured `count` times with a standard deviation of 1: rms error and claim of both filters."""
    squares, claims = np.zeros(2), np.zeros(2)
    for _ in range(runs):
        truth = rng.normal(0, start)
        a = kalman.EnsembleKalmanFilter(1, 1, members=ensemble([0.0], np.array([[start**2]])), R=[1.0])
        b = kalman.LinearKalmanFilter(1, 1, x=[0.0], P=[start**2], F=[1], Q=[0], H=[1], R=[1.0])
        for z in truth + rng.normal(size=count):
            a.correct_deterministic([z], first), b.correct([z])
        squares += (a.x[0] - truth)**2, (b.x[0] - truth)**2
        claims += a.P[0], b.P[0]
    return np.sqrt(squares / runs), np.sqrt(claims / runs)

for start in (1.0, 10.0):
    for count in (1, 10, 100):
        error, claim = constant(start, count)
        exact = 1 / np.sqrt(count + 1 / start**2)
        print(f"start {start:4}, {count:3} measurements: ensemble rms error {error[0]:.3f}, claimed {claim[0]:.3f}; linear filter {error[1]:.3f}, claimed {claim[1]:.3f}, exact {exact:.3f}")
        assert abs(error[1] / exact - 1) < 0.15 and abs(claim[1] / exact - 1) < 1e-6
        assert error[0] > 1.35 * claim[0] and (start < 10 or error[0] > 7 * claim[0])
PYTHON
