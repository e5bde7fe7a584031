"""What the weak form leaves of exact data under the exact model, by the rate of the log and by the truth.

    python tests/truth/quadrature.py

No noise, no wrong coefficient, all sensors at instants: what is left is the sums that stand for integrals over the
0.37 s window (trapezoids of the moment, the kernel's slope on the rates), and the truth's own integrator. Printed: root
mean square residual of l, m, n in % of the channel's standard deviation; the lag of the moments that fits best and what is
then left; what is left when a cubic through four samples takes the place of the trapezoid.
"""

import numpy as np

import aircraft as x8
import continuous
import localise
import make_cases
import manoeuvres

SEED = 52731


def kernel(dt):
    """Hann weights on samples, and on samples for the slope, as `src/sysid/weak_form/kernel.rs` has them."""
    n = max(round(localise.KERNEL_S / dt), 2)
    k = 1.0 - np.cos(2.0 * np.pi * (np.arange(n) + 0.5) / n)
    k /= k.sum()
    left, right = np.concatenate(([0.0], k)), np.concatenate((k, [0.0]))
    return 0.5 * (left + right), (left - right) / dt


def weak_form(rows, dt):
    """Measured and predicted moments in windows."""
    e = continuous.vector()
    moment = np.array([continuous.wrench(localise.body(r), (*r[16:19], 0.0), e)[3:6] for r in rows])
    inertia = np.array([[x8.JX, 0.0, -x8.JXZ], [0.0, x8.JY, 0.0], [-x8.JXZ, 0.0, x8.JZ]])
    rate = rows[:, 3:6]
    turning = np.cross(rate, rate @ inertia)
    sample, slope = kernel(dt)
    n = len(sample)
    starts = range(0, len(rows) - n, n // 2)
    measured = np.array([slope @ rate[k : k + n] @ inertia + sample @ turning[k : k + n] for k in starts])
    change = np.gradient(moment - turning, dt, axis=0)
    late = np.array([-(sample @ change[k : k + n]) for k in starts])
    all_of = moment - turning
    padded = np.vstack((all_of[:1], all_of, all_of[-1:]))
    steps = (-padded[:-3] + 13.0 * padded[1:-2] + 13.0 * padded[2:-1] - padded[3:]) / 24.0
    weights = np.cumsum(-slope * dt)[:-1]  # the kernel on steps, whose difference the slope is
    cubic = np.array([slope @ rate[k : k + n] @ inertia - weights @ steps[k : k + n - 1] for k in starts])
    return measured, np.array([sample @ moment[k : k + n] for k in starts]), late, cubic


def main():
    """Prints the table."""
    print("| truth | rate, Hz | l, % | m, % | n, % | lag, ms | l, % | m, % | n, % | l, cubic, % | m, % | n, % |")
    print("|---|---|---|---|---|---|---|---|---|---|---|---|")
    for kind in ("continuous", "official-adams", "official"):
        fly, step = make_cases.truth_of(kind)
        truth, _, _ = make_cases.fly_within_bounds(fly, f"{kind}-quadrature", SEED, "train-1", None, 0.0, manoeuvres.FLIGHT)
        truth = truth[round(manoeuvres.SETTLE / step) :]
        for rate in (100, 50, 25):
            dt = 1.0 / rate
            measured, predicted, late, cubic = weak_form(truth[:: round(dt / step)], dt)
            left, size = measured - predicted, measured.std(axis=0)
            unit, column = (left / size).ravel(), (late / size).ravel()
            lag = unit @ column / (column @ column)
            shares = [100.0 * np.sqrt(np.mean(x**2, axis=0)) / size for x in (left, left - lag * late, cubic)]
            plain, lagged, cubic = (" | ".join(f"{s:.2f}" for s in share) for share in shares)
            print(f"| {kind} | {rate} | {plain} | {1e3 * lag:.2f} | {lagged} | {cubic} |")


if __name__ == "__main__":
    main()
