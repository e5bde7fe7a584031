//! The oscillation guard detects a limit cycle of the control loop.
//!
//! A loop whose delay exceeds its delay margin can enter a limit cycle that the surface's slew limit sustains. The simulated
//! Skywalker X8, commanded through ArduPlane's RC channels, oscillated for 50 s at 2.6 Hz with pitch rates up to 228 °/s. Every
//! state was fresh and every command was in range, so no other check detected it. The guard looks for a roll or pitch rate that
//! changes sign repeatedly. In each half period the surface command must be at its slew limit or at its stop for a fifth of the
//! time, or sweep over half of its travel. In a manoeuvre this happens in up to three half periods. Turbulence does not move a
//! command this far.

use super::limits::TICK_S;
use greylag_link::vehicle::Axis;
use greylag_physics::{Command, State, Time};

/// Time constant of the high-pass filter of the rate, s. The filter removes the pitch rate of a steady turn.
const SLOW_S: f64 = 0.5;
/// Shortest and longest half period of a limit cycle, s (8 and 1 Hz). Slower motion is flight dynamics. Faster motion is
/// structural vibration or noise.
const HALF_SWING_S: [f64; 2] = [0.06, 0.5];
/// Smallest peak of the filtered rate in a half period, rad/s (23 °/s). It is three times the peak in light turbulence and a
/// quarter of the peak in the mildest observed limit cycle (90 °/s, from 4° rms of pitch at 2.6 Hz).
const PEAK: f64 = 0.4;
/// Dead band for the sign of the filtered rate, rad/s (3 °/s): ten times the noise of a gyro.
const NO_SIGN: f64 = 0.05;
/// Smallest fraction of a half period for which the command must be at its slew limit or stop: a fifth, less a tolerance for
/// rounding.
const LIMITED: f64 = 0.2 - 1e-6;
/// Sweep of the command that suffices if the command does not reach a limit: half of the travel from −1 to 1. In a limit cycle
/// due to a delay of 60 ms the command hardly reaches its limits.
const SWEPT: f64 = 1.0;
/// Smallest number of consecutive half periods of an oscillation, and their smallest total duration, s. The response to a step
/// from 60° of bank to the other side has three half periods.
const SWINGS: u32 = 4;
const LONG_S: f64 = 0.6;
/// Fraction of the slew limit or of full travel from which on a command counts as at its limit.
const ALL: f64 = 0.999;

/// Detector of one axis.
#[derive(Clone, Copy, Debug)]
struct Swings {
    /// Low-pass filtered rate, rad/s. It is subtracted from the rate.
    mean: Option<f64>,
    /// Sign of the rate in the present half period; 0 before the first.
    sign: f64,
    /// Duration of the present half period, and the part of it with the command at a limit, s.
    lasts: f64,
    limited: f64,
    /// Largest magnitude of the filtered rate in the present half period, rad/s.
    peak: f64,
    /// Smallest and largest command of the present half period.
    range: [f64; 2],
    /// Number of consecutive half periods that met the conditions, and their total duration, s.
    row: u32,
    row_s: f64,
}

/// The range of a half period without a command yet.
const NONE: [f64; 2] = [f64::INFINITY, f64::NEG_INFINITY];

impl Default for Swings {
    fn default() -> Self {
        let (mean, sign, peak, range) = (None, 0.0, 0.0, NONE);
        Swings { mean, sign, lasts: 0.0, limited: 0.0, peak, range, row: 0, row_s: 0.0 }
    }
}

/// Detectors of roll and pitch.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Oscillation {
    axes: [Swings; 2],
    last: Option<Time>,
}

impl Oscillation {
    /// Processes the tick (control cycle) at `time`. `before` and `now` are the commands of the previous tick and of this one.
    /// `step` is the largest permitted change of a surface command per tick. Returns the oscillating axis and the duration of the
    /// oscillation, s; `None` without an oscillation. Durations come from the times of the ticks, because an overloaded processor
    /// skips ticks.
    pub(super) fn see(
        &mut self,
        time: Time,
        state: &State,
        before: &Command,
        now: &Command,
        step: f64,
    ) -> Option<(Axis, f64)> {
        let limited =
            |before: f64, now: f64| (now - before).abs() >= ALL * step || now.abs() >= ALL;
        let passed = self.last.map_or(TICK_S, |last| time.since(last).as_secs_f64()).max(TICK_S);
        self.last = Some(time);
        let [roll, pitch] = &mut self.axes;
        let rolls = roll.see(passed, state.p, now.aileron, limited(before.aileron, now.aileron));
        let pitches =
            pitch.see(passed, state.q, now.elevator, limited(before.elevator, now.elevator));
        let pitches = pitches.map(|lasted_s| (Axis::Pitch, lasted_s));
        pitches.or(rolls.map(|lasted_s| (Axis::Roll, lasted_s)))
    }
}

impl Swings {
    /// Processes a tick that is `passed` s after the previous one. `limited` states whether the command is at a limit. Returns
    /// the duration of the oscillation, s; `None` without an oscillation.
    fn see(&mut self, passed: f64, rate: f64, command: f64, limited: bool) -> Option<f64> {
        if !rate.is_finite() {
            return None;
        }
        let mean = self.mean.get_or_insert(rate);
        *mean += (rate - *mean) * (passed / SLOW_S).min(1.0);
        let swing = rate - *mean;
        if swing.abs() > NO_SIGN && swing.signum() != self.sign {
            self.close();
            self.sign = swing.signum();
        }
        self.lasts += passed;
        self.limited += if limited { passed } else { 0.0 };
        self.range = [self.range[0].min(command), self.range[1].max(command)];
        self.peak = self.peak.max(swing.abs());
        (self.row >= SWINGS && self.row_s >= LONG_S).then_some(self.row_s)
    }

    /// Ends the present half period: counts it if it meets the conditions, and otherwise restarts the count.
    fn close(&mut self) {
        let is_swing = (HALF_SWING_S[0]..=HALF_SWING_S[1]).contains(&self.lasts)
            && self.peak >= PEAK
            && (self.limited >= LIMITED * self.lasts || self.range[1] - self.range[0] >= SWEPT);
        if is_swing {
            (self.row, self.row_s) = (self.row + 1, self.row_s + self.lasts);
        } else {
            (self.row, self.row_s) = (0, 0.0);
        }
        (self.lasts, self.limited, self.peak, self.range) = (0.0, 0.0, 0.0, NONE);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Largest change of a command in a tick at the X8's slew limit of 20 /s.
    const STEP: f64 = 0.2;

    /// Time (s) at which the guard detects an oscillation; `None` if it does not. `rate` is the pitch rate (rad/s) and `wanted`
    /// the elevator command before the slew limit, as functions of time (s).
    fn trips(seconds: f64, rate: impl Fn(f64) -> f64, wanted: impl Fn(f64) -> f64) -> Option<f64> {
        let mut guard = Oscillation::default();
        let mut before = Command::IDLE;
        (0..(seconds / TICK_S) as usize).find_map(|i| {
            let at = i as f64 * TICK_S;
            let elevator = wanted(at).clamp(before.elevator - STEP, before.elevator + STEP);
            let now = Command { elevator: elevator.clamp(-1.0, 1.0), ..before };
            let state = State { q: rate(at), ..State::NEUTRAL };
            let axis = guard.see(Time::from_micros((1e6 * at) as u64), &state, &before, &now, STEP);
            before = now;
            axis.map(|(axis, lasted_s)| {
                assert!(
                    axis == Axis::Pitch && (LONG_S..=at).contains(&lasted_s),
                    "{lasted_s} at {at}"
                );
                at
            })
        })
    }

    #[test]
    fn the_limit_cycle_that_was_recorded_is_found_within_a_second() {
        // 2.6 Hz, q up to 228 °/s, the elevator between its stops; also in a turn with a constant pitch rate.
        for turn in [0.0, 0.7] {
            let q = |t: f64| turn + 3.98 * (TAU * 2.6 * t).sin();
            let at = trips(5.0, q, |t| -10.0 * (TAU * 2.6 * t + 0.5).sin()).unwrap();
            assert!((0.6..1.2).contains(&at), "{at}");
        }
        // The mildest observed limit cycle had 4° rms of pitch. An elevator that alternates between ±0.2 is at its slew limit too
        // briefly. One that alternates between ±0.4 is at its slew limit for long enough.
        let q = |t: f64| 1.6 * (TAU * 2.6 * t).sin();
        let mild = |t: f64| 0.2 * (TAU * 2.6 * t).sin().signum();
        assert_eq!(trips(5.0, q, mild), None, "two ticks of twenty are no limit");
        let at = trips(5.0, q, |t| 2.0 * mild(t)).unwrap();
        assert!((0.6..1.2).contains(&at), "{at}");
    }

    #[test]
    fn a_swing_over_half_of_the_travel_is_found_without_the_limit() {
        // The elevator command changes by at most 0.15 per tick (the slew limit is 0.2) and reaches at most 0.8.
        let q = |t: f64| 2.5 * (TAU * 3.0 * t).sin();
        let elevator = |part: f64| move |t: f64| -part * (TAU * 3.0 * t + 0.6).sin();
        let at = trips(5.0, q, elevator(0.8)).unwrap();
        assert!((0.6..1.2).contains(&at), "{at}");
        assert_eq!(trips(5.0, q, elevator(0.4)), None);
    }

    #[test]
    fn a_free_swing_with_the_command_inside_its_limits_is_flight() {
        // A phugoid, a damped short-period oscillation, and a fast oscillation of small amplitude are not limit cycles.
        assert_eq!(trips(60.0, |t| 0.3 * (TAU * 0.1 * t).sin(), |_| 0.1), None);
        assert_eq!(trips(60.0, |t| 2.0 * (-t).exp() * (TAU * 2.0 * t).sin(), |_| 0.1), None);
        assert_eq!(trips(60.0, |t| 0.1 * (TAU * 6.0 * t).sin(), |t| 9.0 * (40.0 * t).sin()), None);
    }

    #[test]
    fn steps_of_a_second_with_the_surface_at_its_stops_are_manoeuvres() {
        // Full elevator in alternating directions at 0.8 Hz: a half period of 0.63 s is too long for an oscillation.
        let q = |t: f64| 3.0 * (TAU * 0.8 * t).sin();
        assert_eq!(trips(30.0, q, |t| 10.0 * (TAU * 0.8 * t).sin()), None);
    }

    #[test]
    fn a_fast_swing_is_not_said_before_its_time_has_passed() {
        // Four half periods of 7 Hz take 0.29 s, less than the required 0.6 s.
        let swing = |t: f64| (TAU * 7.0 * t).sin();
        let at = trips(5.0, |t| 4.0 * swing(t), |t| -10.0 * swing(t + 0.02)).unwrap();
        assert!((0.6..1.2).contains(&at), "{at}");
    }
}
