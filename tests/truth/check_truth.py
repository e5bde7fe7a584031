"""Checks the continuous truth against official JSBSim: the largest differences over whole flights.

    python tests/truth/check_truth.py

JSBSim flies; at every tenth step the continuous truth is given JSBSim's state and the positions that act, and
its forces, moments and accelerations are set beside those that JSBSim has at that moment. JSBSim's earth turns
and is round, which the flat earth here leaves out.
Every hidden effect that is a force, a moment or a mass is compared likewise.

Then perfect sensors log a flight of each truth at 100 Hz: over any second, velocity must be the integral of
specific force and gravity, and attitude that of the rates, so that what is logged belongs to one instant.
"""

import math
import sys

import numpy as np

import aircraft as x8
import continuous
import hidden
import manoeuvres
import official
import sensors

KINEMATICS_MAX = {"continuous": (2e-3, 2e-4), "official": (5e-3, 4e-3)}
"""m/s and rad within one second. Of official JSBSim, Coriolis alone is 3e-3 m/s, and its Euler steps lag by half
of 2.5 ms: 3e-3 rad while a rate changes by 2.5 rad/s. Attitude one sample late would be off by 2.5e-2 rad."""
FORCE_MAX, MOMENT_MAX, ACCELERATION_MAX, RATE_MAX = 1e-5, 1e-6, 5e-3, 1e-3
"""Largest differences allowed: N and N m, of some 100; m/s2 and rad/s2, of which the turning earth takes 3e-3
(twice its rate, 7.3e-5 rad/s, times 20 m/s) and 5e-4 (its rate times some rad/s, through the X8's small inertia)."""
UNSTEADY_MAX = 0.05
"""N, of an effect of several: JSBSim's rate of alpha is one step of 2.5 ms old."""
READ = {
    "forces/fbx-total-lbs": official.POUND, "forces/fby-total-lbs": official.POUND,
    "forces/fbz-total-lbs": official.POUND, "moments/l-total-lbsft": official.TORQUE,
    "moments/m-total-lbsft": official.TORQUE, "moments/n-total-lbsft": official.TORQUE,
    "accelerations/udot-ft_sec2": official.FOOT, "accelerations/vdot-ft_sec2": official.FOOT,
    "accelerations/wdot-ft_sec2": official.FOOT, "accelerations/pdot-rad_sec2": 1.0,
    "accelerations/qdot-rad_sec2": 1.0, "accelerations/rdot-rad_sec2": 1.0,
}  # fmt: skip


def state_of(sim):
    """The state of `continuous` that JSBSim is in."""
    foot = official.FOOT
    u, v, w = (sim[f"velocities/{n}-aero-fps"] * foot for n in "uvw")
    p, q, r = (sim[f"velocities/{n}-rad_sec"] for n in "pqr")
    half = [0.5 * sim[f"attitude/{n}-rad"] for n in ("phi", "theta", "psi")]
    (cr, cp, cy), (sr, sp, sy) = map(math.cos, half), map(math.sin, half)
    attitude = (
        cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )  # fmt: skip
    return (u, v, w, p, q, r, *attitude, sim["position/h-sl-meters"])


def differences(effect, amount, seed, seconds=12.0):
    """Largest differences of force, moment, acceleration and angular acceleration in one flight."""
    sim = official.simulator(effect, amount)
    official.start(sim, (0.0, 0.0, 0.0), 0.4)
    plan = manoeuvres.plan_of("train-3", hidden.random_of(seed, "check"), 1.0)
    e, memory, worst = continuous.vector(effect, amount), (0.0, 0.0, 0.0), np.zeros(4)
    if effect == "lift_stall":
        e = continuous.vector()  # JSBSim's is the table
    names = [name for name, _ in official.SEEN[:7]]
    for k, target in enumerate(plan[: round(seconds / official.PERIOD)].tolist()):
        seen = [sim[names[j]] * official.SEEN[j][1] for j in (0, 1, 3, 4, 5, 6)]
        given, memory = official.command(tuple(seen), tuple(target), memory)
        for name, value in zip(("aileron", "elevator", "throttle"), given):
            sim[f"fcs/{name}-cmd-norm"] = value
        for _ in range(official.PER_COMMAND):
            sim.run()
        if k > 5:
            worst = np.maximum(worst, difference(sim, e))
    return worst


def difference(sim, e):
    """Differences at one moment."""
    z = (*(sim[name] for name in (*official.POSITIONS.values(), official.THROTTLE)), 0.0)
    x = state_of(sim)
    theirs = np.array([sim[name] * unit for name, unit in READ.items()])
    ours = np.array((*continuous.wrench(x, z, e)[:6], *continuous.rates(x, z, e)[:6]))
    return np.abs(ours - theirs).reshape(4, 3).max(axis=1)


def kinematics(truth):
    """Largest departures of velocity (m/s) and roll and pitch (rad) from their integrals over a second."""
    plan = manoeuvres.plan_of("train-3", hidden.random_of(1, "check"), 1.0)
    rows, commands = truth.fly(plan, None, 0.0, np.array((3.0, -2.0, 0.0)), 0.4)
    options = sensors.Options(noise=0.0, skew=0.0)
    _, table, _ = sensors.log(rows, truth.STEP, commands, manoeuvres.SETTLE, options, hidden.random_of(1, "check"))
    t, (phi, theta, psi) = table[:, 0], table[:, 1:4].T
    rates, force, velocity = table[:, 4:7], table[:, 10:13], table[:, 13:16]
    turn = np.sin(phi) * rates[:, 1] + np.cos(phi) * rates[:, 2]
    angles = np.column_stack((
        rates[:, 0] + np.tan(theta) * turn, np.cos(phi) * rates[:, 1] - np.sin(phi) * rates[:, 2]
    ))  # fmt: skip
    sf, cf, st, ct, sp, cp = (g(x) for x in (phi, theta, psi) for g in (np.sin, np.cos))
    x, y, z = force.T
    level = ct * x + sf * st * y + cf * st * z
    across = cf * y - sf * z
    down = -st * x + sf * ct * y + cf * ct * z + x8.GRAVITY
    acceleration = np.column_stack((cp * level - sp * across, sp * level + cp * across, down))
    return largest(t, velocity, acceleration), largest(t, np.column_stack((phi, theta)), angles)


def largest(t, values, rates):
    """Largest departure of `values` from the integral (Simpson) of `rates` over whole seconds."""
    n = round(1.0 / (t[1] - t[0]))
    weights = np.tile((2.0, 4.0), n // 2 + 1)[: n + 1] * (t[1] - t[0]) / 3.0
    weights[0] = weights[-1] = (t[1] - t[0]) / 3.0
    starts = range(0, len(t) - n - 1, n // 4)
    return max(np.abs(values[k + n] - values[k] - weights @ rates[k : k + n + 1]).max() for k in starts)


def main():
    """Compares without an effect, then with each."""
    effects = [None, *(x for x in hidden.AMPLITUDES if x not in hidden.INPUTS)]
    print(f"{'effect':26} {'force N':>10} {'moment N m':>11} {'m/s2':>10} {'rad/s2':>10}")
    failed = False
    for seed, effect in enumerate(effects):
        amount = hidden.amplitude(effect, "official", hidden.random_of(seed, effect)) if effect else 0.0
        worst = differences(effect, amount, seed)
        most = np.array((FORCE_MAX, MOMENT_MAX, ACCELERATION_MAX, RATE_MAX))
        print(f"{effect or 'none':26} {worst[0]:10.2e} {worst[1]:11.2e} {worst[2]:10.2e} {worst[3]:10.2e}", flush=True)
        failed |= effect != "unsteady_lift" and bool((worst > most).any())
        failed |= effect == "unsteady_lift" and bool(worst[0] > UNSTEADY_MAX)
    for truth in (continuous, official):
        off = kinematics(truth)
        print(f"{truth.__name__:12} over a second, velocity is off by {off[0]:.1e} m/s, attitude by {off[1]:.1e} rad")
        failed |= bool((np.array(off) > KINEMATICS_MAX[truth.__name__]).any())
    sys.exit(int(failed))


if __name__ == "__main__":
    main()
