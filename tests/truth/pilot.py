"""Attitude loops: PID on roll and pitch, PI on airspeed, with test inputs added."""

from compiled import compiled

PERIOD = 0.01
"""Time between two commands, s; a command is held in between."""


@compiled
def command(seen, wanted, memory):
    """Commands (aileron, elevator in -1..1, throttle 0..1), and the loops' memory.

    `seen`: roll, pitch, p, q, r, airspeed. `wanted`: roll, pitch, airspeed, share of the loops' gains, and the
    test inputs on aileron, elevator and throttle. `memory`: the integrals of roll, pitch and speed.
    """
    roll, pitch, p, q, r, airspeed = seen
    roll_target, pitch_target, speed_target, gain, add_a, add_e, add_t = wanted
    sum_roll, sum_pitch, sum_speed = memory
    off_roll, off_pitch, off_speed = roll_target - roll, pitch_target - pitch, speed_target - airspeed
    aileron = gain * (0.9 * off_roll - 0.05 * p) + sum_roll
    elevator = gain * (-2.0 * off_pitch + 0.25 * q) - sum_pitch
    throttle = 0.16 + 0.08 * off_speed + sum_speed
    sum_roll = min(max(sum_roll + PERIOD * gain * 0.4 * off_roll, -0.3), 0.3)
    sum_pitch = min(max(sum_pitch + PERIOD * gain * 2.5 * off_pitch, -0.6), 0.6)
    sum_speed = min(max(sum_speed + PERIOD * 0.03 * off_speed, -0.3), 0.5)
    aileron = min(max(aileron + add_a, -1.0), 1.0)
    elevator = min(max(elevator + add_e, -1.0), 1.0)
    throttle = min(max(throttle + add_t, 0.0), 1.0)
    return (aileron, elevator, throttle), (sum_roll, sum_pitch, sum_speed)
