"""Test flights drawn at random: steps, doublets, 3-2-1-1, sines, rolls, pulls, skids, stalls.

A plan is an array with one row a command: target roll, pitch (rad) and airspeed (m/s), the share of the loops'
gains, and what is added to the commands of aileron, elevator and throttle.
"""

import numpy as np

from pilot import PERIOD

FLIGHT = 50.0
"""Length of a flight, s."""
SETTLE = 1.0
"""Time before the log begins, s."""
ROLL, PITCH, SPEED, GAIN, AILERON, ELEVATOR, THROTTLE = range(7)


class Plan:
    """A plan that grows by one leg after the other."""

    def __init__(self, random, scale):
        self.random, self.scale, self.legs = random, scale, []

    def about(self, nominal):
        """`nominal`, give or take a fifth."""
        return nominal * self.random.uniform(0.8, 1.2)

    def side(self):
        """-1 or 1."""
        return self.random.choice((-1.0, 1.0))

    def leg(self, duration, roll_deg, pitch_deg, speed):
        """A new leg; later inputs count from its begin."""
        rows = np.zeros((round(duration / PERIOD), 7))
        rows[:, :4] = np.radians(roll_deg), np.radians(pitch_deg), speed, 1.0
        self.legs.append(rows)
        return self

    def put(self, column, shape, begin, gain=1.0):
        """Adds `shape` (values at the commands' period) to a column of the latest leg."""
        rows, first = self.legs[-1], round(begin / PERIOD)
        last = min(first + len(shape), len(rows))
        rows[first:last, column] += self.scale * shape[: last - first]
        rows[first:last, GAIN] = np.minimum(rows[first:last, GAIN], gain)
        return self

    def pulse(self, column, amplitude, begin, width, gain=1.0):
        """A rectangular pulse."""
        return self.put(column, np.full(round(width / PERIOD), amplitude), begin, gain)

    def doublet(self, column, amplitude, begin, width):
        """Two pulses, one to each side, with weak loops."""
        self.pulse(column, amplitude, begin, width, 0.4)
        return self.pulse(column, -amplitude, begin + round(width / PERIOD) * PERIOD, width, 0.4)

    def three211(self, column, amplitude, begin, width):
        """Pulses of 3, 2, 1 and 1 widths to alternating sides, with weak loops."""
        n = round(width / PERIOD)
        signs = np.repeat((1.0, -1.0, 1.0, -1.0), (3 * n, 2 * n, n, n))
        return self.put(column, amplitude * signs, begin, 0.4)

    def sines(self, column, amplitude, low, high, gain=1.0):
        """Six sines between two frequencies (Hz) over the latest leg; `amplitude` is the largest sum."""
        rows = self.legs[-1]
        t, total = PERIOD * np.arange(len(rows)), np.zeros(len(rows))
        for f in np.geomspace(low, high, 6):
            total += np.sin(2.0 * np.pi * (f * self.random.uniform(0.95, 1.05) * t + self.random.random()))
        return self.put(column, amplitude * total / max(np.abs(total).max(), 1e-9), 0.0, gain)

    def rows(self, duration):
        """The whole plan, filled up by level flight, with small sines under everything."""
        flown = sum(len(leg) for leg in self.legs) * PERIOD
        self.leg(max(duration - flown, PERIOD), 0.0, 2.0, 18.0)
        for k, leg in enumerate(self.legs):
            self.legs.append(leg)
            for column, amplitude, high in ((AILERON, 0.035, 4.0), (ELEVATOR, 0.03, 4.0), (THROTTLE, 0.08, 1.0)):
                self.sines(column, amplitude, 0.2, high)
            self.legs.pop()
            self.legs[k] = leg
        return np.concatenate(self.legs)[: round(duration / PERIOD)]


def stall(plan):
    """Slow with the nose up and the motor off until beyond the stall, then the nose down."""
    up = plan.random.uniform(4.4, 5.2) * plan.scale
    plan.leg(up, 0.0, plan.random.uniform(16.0, 18.0), 11.0).pulse(THROTTLE, -1.0 / plan.scale, 0.0, up)
    plan.leg(1.6, 0.0, -18.0, 18.0)
    plan.leg(2.4, 0.0, 0.0, 20.0)


def push(plan):
    """Pushes to negative angles of attack."""
    plan.leg(4.0, 0.0, 8.0, 18.0)
    plan.pulse(ELEVATOR, plan.about(0.3), 1.2, 0.35, 0.5).pulse(ELEVATOR, plan.about(0.24), 2.8, 0.4, 0.5)


def test_inputs(plan, column, speed):
    """A 3-2-1-1, then a small and a large doublet on one control."""
    r, large = plan.random, 0.26 if column == AILERON else 0.22
    plan.leg(3.5, 0.0, r.uniform(2.0, 5.0), speed)
    plan.three211(column, plan.about(large) * plan.side(), 0.6, r.uniform(0.2, 0.3))
    plan.leg(4.5, 0.0, r.uniform(2.0, 5.0), speed)
    plan.doublet(column, plan.about(0.05) * plan.side(), 0.5, r.uniform(0.25, 0.4))
    plan.doublet(column, plan.about(0.35) * plan.side(), 2.0, r.uniform(0.2, 0.3))


def throttle_steps(plan, speed):
    """The throttle up and down."""
    plan.leg(4.0, 0.0, plan.random.uniform(1.0, 5.0), speed)
    plan.pulse(THROTTLE, plan.about(0.6), 0.4, 1.6).pulse(THROTTLE, -plan.about(0.5), 2.4, 1.4)


def rolls(plan, speeds):
    """Fast rolls from bank to bank."""
    side = plan.side()
    for speed in speeds:
        plan.leg(2.5, side * plan.random.uniform(30.0, 45.0), plan.random.uniform(2.0, 6.0), speed)
        plan.pulse(AILERON, side * plan.about(0.28), plan.random.uniform(0.0, 0.4), 0.4, 0.6)
        side = -side


def pull(plan, side):
    """Pulls in a bank, the second one while rolling."""
    plan.leg(4.5, side * plan.random.uniform(38.0, 50.0), 5.0, plan.random.uniform(20.0, 23.0))
    plan.pulse(ELEVATOR, -plan.about(0.22), 1.0, 0.4, 0.6).pulse(ELEVATOR, -plan.about(0.22), 2.8, 0.4, 0.6)
    plan.pulse(AILERON, -0.2 * side, 2.8, 0.4)


def skid(plan, speed):
    """Sideslip by slow sines of the aileron."""
    plan.leg(5.0, 0.0, 4.0, speed).sines(AILERON, plan.about(0.32), 0.45, 1.1, 0.6)


def along(plan):
    """Pitch, thrust, drag over speed, stall."""
    speed = plan.random.uniform(16.0, 18.0)
    test_inputs(plan, ELEVATOR, speed)
    throttle_steps(plan, speed)
    stall(plan)
    push(plan)
    throttle_steps(plan, 23.0)
    plan.leg(4.0, 0.0, -4.0, 27.0).pulse(THROTTLE, 1.0, 0.0, 3.0)
    plan.leg(3.5, 0.0, 2.0, 25.0).three211(ELEVATOR, plan.about(0.14), 0.5, plan.random.uniform(0.2, 0.3))
    plan.leg(4.0, 0.0, 5.0, 15.0).pulse(THROTTLE, -1.0, 0.0, 3.0)


def across(plan):
    """Roll, yaw, sideslip, side force."""
    side = plan.side()
    test_inputs(plan, AILERON, 18.0)
    skid(plan, 15.0)
    rolls(plan, (20.0, 21.0, 22.0, 22.0))
    pull(plan, side)
    pull(plan, -side)
    skid(plan, 21.0)
    plan.leg(4.0, 0.0, 3.0, 24.0).three211(AILERON, plan.about(0.2) * side, 0.6, plan.random.uniform(0.2, 0.3))
    throttle_steps(plan, 19.0)


def mixed(plan):
    """Everything at once at three speeds."""
    side = plan.side()
    for duration, roll, pitch, speed in ((7.0, 0.0, 5.0, 15.0), (5.0, 38.0, 5.0, 19.0), (7.0, -30.0, 2.0, 24.0)):
        plan.leg(duration, roll * side, pitch, speed)
        plan.sines(AILERON, plan.about(0.12), 0.2, 2.5).sines(ELEVATOR, plan.about(0.10), 0.3, 3.5)
        plan.sines(THROTTLE, plan.about(0.2), 0.1, 0.8)
    plan.leg(4.0, 30.0 * side, 5.0, 20.0)
    plan.pulse(AILERON, 0.28 * side, 1.0, 0.5, 0.6).pulse(ELEVATOR, -0.26, 1.0, 0.5, 0.6)
    throttle_steps(plan, 20.0)
    stall(plan)
    pull(plan, -side)
    test_inputs(plan, ELEVATOR, 17.0)


def other(plan):
    """Legs of random bank, pitch and speed with inputs at random: flights to test on."""
    r = plan.random
    for _ in range(3):
        plan.leg(5.0, r.uniform(-40.0, 40.0), r.uniform(-5.0, 9.0), r.uniform(15.0, 24.0))
        plan.doublet(AILERON, plan.about(0.2) * plan.side(), r.uniform(0.8, 1.2), r.uniform(0.2, 0.45))
        plan.doublet(ELEVATOR, plan.about(0.18) * plan.side(), r.uniform(2.8, 3.4), r.uniform(0.2, 0.45))
        plan.pulse(THROTTLE, r.uniform(-0.5, 0.5), 1.5, 2.0)
        plan.leg(4.0, r.uniform(-30.0, 30.0), r.uniform(0.0, 6.0), r.uniform(16.0, 23.0))
        plan.sines(AILERON, plan.about(0.12), 0.3, 3.0).sines(ELEVATOR, plan.about(0.1), 0.3, 3.0)
    stall(plan)
    push(plan)
    rolls(plan, (21.0, 21.0))


FLIGHTS = {"train-1": along, "train-2": across, "train-3": mixed, "test-1": other, "test-2": other}
"""The flights of a case, by the names of their logs."""


def plan_of(flight, random, scale, duration=FLIGHT):
    """The plan of a flight, its inputs scaled by `scale`, with the time to settle before it."""
    plan = Plan(random, scale).leg(SETTLE, 0.0, 3.0, 18.0)
    FLIGHTS[flight](plan)
    return plan.rows(duration + SETTLE)
