//! The attitude reference that a plan follows: a path to the target that the aircraft can fly.
//!
//! Each axis is driven by a cascade with limited rate and acceleration, like the attitude and rate loops of a flight
//! controller. The load factor n limits the pitch rate. In coordinated flight θ̇ = (g / V) (n cos φ − cos θ), from the rigid
//! body's force equations with V and α constant. Each tick (control cycle of 10 ms) continues the path of the previous tick.
//! The path waits while the aircraft lags behind it.
//!
//! A steep bank uses up the load factor that a pitch-up needs. If the target combines both, the path may therefore first go
//! to an intermediate bank, a fraction of the target bank.

use super::STEPS;
use crate::envelope::G0;
use greylag_model::{GreyBox, STEP};
use greylag_physics::State;
use std::f64::consts::TAU;

/// Largest bank (rad) that is inserted into the formula for the path's body rates, which is singular at 90°.
const STEEP: f64 = 1.4;
/// Upper limits of the roll and pitch rates, rad/s: 70 and 60 °/s, the defaults of PX4's FW_R_RMAX and FW_P_RMAX_POS.
const MOST: [f64; 2] = [1.22, 1.05];
/// Largest lead of the path over the aircraft in each axis, rad.
const AHEAD: f64 = 0.02;
/// Intermediate banks that are compared, as fractions of the target bank. Each is combined with every duration in `TICKS`
/// (ticks).
const PARTS: [f64; 3] = [0.0, 0.35, 0.7];
const TICKS: [usize; 6] = [30, 60, 100, 150, 210, 300];
/// Duration of the simulation by which intermediate banks are compared, ticks. `COARSE` is its integration step, ticks.
const TRIAL: usize = 600;
const COARSE: usize = 5;
/// A new intermediate bank replaces the present one only if its cost is below this fraction of the present one's cost.
const BETTER: f64 = 0.97;
/// Smallest target bank for which an intermediate bank is considered, rad. `UP_ENOUGH` is the smallest pitch-up from the
/// present pitch, rad.
const STEEP_ENOUGH: f64 = 0.5;
const UP_ENOUGH: f64 = 0.1;
/// Fraction of the largest acceleration that is used for braking.
const BRAKING: f64 = 0.7;

/// Limits and gains with which a path approaches its target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Approach {
    /// Ratio of the commanded rate to the angle error close to the target, 1/s.
    gain: f64,
    /// Largest roll and pitch rates, rad/s.
    rates: [f64; 2],
    /// Largest roll and pitch accelerations, rad/s².
    accelerations: [f64; 2],
    /// Fraction of the largest roll rate that is still used when a steep bank needs all of the load factor.
    steep: f64,
    /// Scale of the roll deviation from the path in the cost function, rad.
    pub roll: f64,
}

impl Approach {
    /// The approach of an aircraft that rolls at `full` rad/s with full aileron. Without a rudder, adverse yaw disturbs pitch,
    /// and the load-factor limit may leave no room for a correction. Such an aircraft therefore rolls slowly, and its roll
    /// errors cost less. The values without a rudder were chosen with attitude steps of the Skywalker X8, the values with a
    /// rudder with attitude steps of the Aerosonde. `results/flight-quality.txt` has results of other steps.
    pub fn of(model: &GreyBox, full: f64) -> Approach {
        if model.has_rudder() {
            let rates = [full, MOST[1]];
            Approach {
                gain: 6.0,
                rates,
                accelerations: rates.map(|r| 6.0 * r),
                steep: 1.0,
                roll: 0.05,
            }
        } else {
            let rates = [(0.4 * full).min(MOST[0]), MOST[1]];
            let accelerations = [4.0 * rates[0], 6.0 * rates[1]];
            Approach { gain: 3.0, rates, accelerations, steep: 0.7, roll: 0.1 }
        }
    }

    /// Angle (rad) and rate (rad/s) of an axis after `span` seconds, on the way to an angle that is `error` (rad) away. `at` is
    /// the angle and rate at the start. `least` and `most` limit the commanded rate.
    fn step(
        &self,
        axis: usize,
        at: [f64; 2],
        error: f64,
        [least, most]: [f64; 2],
        span: f64,
    ) -> [f64; 2] {
        let [angle, rate] = at;
        let acceleration = self.accelerations[axis];
        let braking = (2.0 * BRAKING * acceleration * error.abs()).sqrt();
        let wanted = error.signum() * (self.gain * error.abs()).min(braking);
        // at a bank that the load factor cannot hold, both limits of the pitch rate are negative
        let wanted = wanted.max(least).min(most);
        // a rate gain of four times the attitude gain is critically damped
        let change = (wanted - rate) * (4.0 * self.gain);
        let rate = rate + change.clamp(-acceleration, acceleration) * span;
        [angle + rate * span, rate]
    }
}

/// A point of the path: attitude and its rates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Point {
    /// Roll and pitch, rad.
    pub attitude: [f64; 2],
    /// Rates of roll and pitch, rad/s.
    rates: [f64; 2],
}

impl Point {
    /// The point at the measured attitude, with the measured attitude rates.
    fn of(s: &State) -> Point {
        let (sin, cos) = s.roll.sin_cos();
        let turn = s.q * sin + s.r * cos;
        let rates = [s.p + s.pitch.tan() * turn, s.q * cos - s.r * sin];
        Point { attitude: [s.roll, s.pitch], rates }
    }

    /// Body rates p, q, r in a coordinated turn along the path, rad/s. `turn` is g / V, 1/s.
    fn body_rates(&self, turn: f64) -> [f64; 3] {
        let [roll, pitch] = self.attitude;
        let (sin, cos) = roll.clamp(-STEEP, STEEP).sin_cos();
        let r = turn * pitch.cos() * sin;
        let q = (self.rates[1] + r * sin) / cos;
        [self.rates[0] - pitch.tan() * (q * sin + r * cos), q, r]
    }
}

/// An intermediate bank, which is flown before the target bank.
#[derive(Clone, Copy, Debug, PartialEq)]
struct First {
    /// The intermediate bank as a fraction of the target bank.
    part: f64,
    /// Number of ticks for which it is still flown.
    ticks: usize,
}

impl First {
    const NONE: First = First { part: 1.0, ticks: 0 };

    /// The same intermediate bank, flown for one tick less.
    fn later(self) -> First {
        First { ticks: self.ticks.saturating_sub(1), ..self }
    }

    /// The commanded bank after `tick` ticks, rad.
    fn bank(self, tick: usize, target: f64) -> f64 {
        if tick < self.ticks { self.part * target } else { target }
    }
}

/// Target and limits of a path.
struct Task<'a> {
    /// g / V, 1/s.
    turn: f64,
    /// Target roll and pitch, rad.
    target: [f64; 2],
    /// Smallest and largest load factor.
    load: [f64; 2],
    approach: &'a Approach,
}

impl Task<'_> {
    /// The point of the path `span` seconds after `from`, on the way to `bank` (rad) and the target pitch.
    fn step(&self, from: &Point, bank: f64, span: f64) -> Point {
        let Point { attitude: [roll, pitch], rates: [rolling, pitching] } = *from;
        let approach = self.approach;
        let spare = (self.load[1] * roll.cos() - pitch.cos()) / (self.load[1] - pitch.cos());
        let fastest = approach.rates[0] * spare.clamp(approach.steep, 1.0);
        let by_load = self.load.map(|n| self.turn * (n * roll.cos() - pitch.cos()));
        let most = approach.rates[1];
        let limits = [by_load[0].max(-most), by_load[1].min(most)];
        let around = wrapped(bank - roll);
        let roll = approach.step(0, [roll, rolling], around, [-fastest, fastest], span);
        let up = self.target[1] - pitch;
        let pitch = approach.step(1, [pitch, pitching], up, limits, span);
        Point { attitude: [roll[0], pitch[0]], rates: [roll[1], pitch[1]] }
    }

    /// Integral of the absolute errors of roll and pitch with the intermediate bank `first`, rad s.
    fn cost(&self, from: &Point, first: First) -> f64 {
        let span = COARSE as f64 * STEP;
        let mut now = *from;
        let mut sum = 0.0;
        for tick in (0..TRIAL).step_by(COARSE) {
            now = self.step(&now, first.bank(tick, self.target[0]), span);
            let [roll, pitch] = now.attitude;
            sum += (wrapped(self.target[0] - roll).abs() + (self.target[1] - pitch).abs()) * span;
        }
        sum
    }

    /// Returns the intermediate bank with the smallest cost. It replaces the present one, `flown`, only if its cost is below the
    /// fraction `BETTER` of the cost of `flown`.
    fn choose(&self, from: &Point, flown: First) -> First {
        let [bank, pitch] = self.target;
        if bank.abs() < STEEP_ENOUGH || pitch - from.attitude[1] < UP_ENOUGH {
            return First::NONE;
        }
        let mut best = (flown, BETTER * self.cost(from, flown));
        let held =
            PARTS.iter().flat_map(|&part| TICKS.iter().map(move |&ticks| First { part, ticks }));
        for first in held.chain([First::NONE]) {
            let cost = self.cost(from, first);
            if cost < best.1 {
                best = (first, cost);
            }
        }
        best.0
    }
}

/// The path of the present tick, and the point from which the next tick continues it.
#[derive(Clone, Debug)]
pub(super) struct Course {
    points: Vec<Point>,
    /// Roll, pitch and yaw rates of the body at each point, rad/s.
    turning: Vec<[f64; 3]>,
    next: Option<Point>,
    first: First,
}

impl Course {
    pub fn new() -> Course {
        let point = Point { attitude: [0.0; 2], rates: [0.0; 2] };
        Course {
            points: vec![point; STEPS + 1],
            turning: vec![[0.0; 3]; STEPS + 1],
            next: None,
            first: First::NONE,
        }
    }

    /// Restarts the path at the aircraft's attitude.
    pub fn reset(&mut self) {
        self.next = None;
        self.first = First::NONE;
    }

    /// The point of the path after `step` steps.
    pub fn at(&self, step: usize) -> &Point {
        &self.points[step]
    }

    /// Body rates p, q, r on the path after `step` steps, rad/s.
    pub fn turning(&self, step: usize) -> [f64; 3] {
        self.turning[step]
    }

    /// Replaces the path by the constant `target` (roll and pitch, rad).
    pub fn stay(&mut self, target: [f64; 2]) {
        self.points.fill(Point { attitude: target, rates: [0.0; 2] });
    }

    /// Computes the path from `seen` to `target` (roll and pitch, rad) within the load factors `load` (minimum, maximum).
    pub fn towards(&mut self, seen: &State, target: [f64; 2], load: [f64; 2], approach: &Approach) {
        let mut now = self.begin(seen);
        let task = Task { turn: G0 / seen.airspeed.max(1.0), target, load, approach };
        self.first = task.choose(&now, self.first.later());
        for step in 0..=STEPS {
            self.points[step] = now;
            self.turning[step] = now.body_rates(task.turn);
            if step == 1 {
                self.next = Some(now);
            }
            now = task.step(&now, self.first.bank(step, target[0]), STEP);
        }
    }

    /// The point at which the path continues, at most [`AHEAD`] from the aircraft in each axis.
    fn begin(&self, seen: &State) -> Point {
        let here = Point::of(seen);
        let Some(mut now) = self.next else { return here };
        for axis in 0..2 {
            let off = wrapped(now.attitude[axis] - here.attitude[axis]);
            if off.abs() > AHEAD {
                now.attitude[axis] = here.attitude[axis] + off.clamp(-AHEAD, AHEAD);
                now.rates[axis] = here.rates[axis];
            }
        }
        now
    }
}

/// Wraps the angle `x` (rad) to −π..π.
pub(super) fn wrapped(x: f64) -> f64 {
    (x + TAU / 2.0).rem_euclid(TAU) - TAU / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    const SLOW: Approach = Approach {
        gain: 3.0,
        rates: [1.2, 1.05],
        accelerations: [4.8, 6.3],
        steep: 0.7,
        roll: 0.1,
    };

    /// The points of a path from level flight that the aircraft follows exactly for `ticks` ticks.
    fn follow(target: [f64; 2], load: [f64; 2], ticks: usize) -> Vec<Point> {
        let mut course = Course::new();
        let mut state = State { airspeed: 20.0, ..State::NEUTRAL };
        let mut out = Vec::new();
        for _ in 0..ticks {
            course.towards(&state, target, load, &SLOW);
            let point = *course.at(1);
            [state.roll, state.pitch] = point.attitude;
            [state.p, state.q, state.r] = course.turning(1);
            out.push(point);
        }
        out
    }

    #[test]
    fn a_path_arrives_without_overshoot_and_within_the_load_factor() {
        for target in [[0.8, 0.3], [-0.9, -0.4], [0.2, 0.4]] {
            let path = follow(target, [-0.8, 2.1], 800);
            let last = path[799].attitude;
            for axis in 0..2 {
                assert!((last[axis] - target[axis]).abs() < 1e-3, "{target:?} {last:?}");
                let beyond = path.iter().map(|p| p.attitude[axis] / target[axis]);
                assert!(beyond.fold(0.0, f64::max) < 1.001, "{target:?}");
            }
            for point in &path {
                let [roll, pitch] = point.attitude;
                let n = (point.rates[1] * 20.0 / G0 + pitch.cos()) / roll.cos();
                assert!((-1.0..2.3).contains(&n), "{target:?}: {n} at {point:?}");
            }
        }
    }

    #[test]
    fn a_bank_that_the_load_factor_cannot_hold_lowers_the_nose() {
        let path = follow([1.3, 0.0], [-0.8, 2.1], 300);
        assert!(path[299].attitude[1] < -0.1, "{:?}", path[299]);
    }

    #[test]
    fn the_nose_comes_up_before_a_steep_bank() {
        let dive = Point { attitude: [-0.95, -0.47], rates: [0.0; 2] };
        let load = [-0.8, 2.1];
        let task = |target| Task { turn: G0 / 30.0, target, load, approach: &SLOW };
        let steep = task([1.0, 0.49]);
        let first = steep.choose(&dive, First::NONE);
        assert!(first.ticks > 0 && first.part < 1.0, "{first:?}");
        assert!(steep.cost(&dive, first) < BETTER * steep.cost(&dive, First::NONE));
        // the present intermediate bank is kept, and a target bank that uses little load factor is not delayed
        assert_eq!(steep.choose(&dive, first), first);
        assert_eq!(task([0.3, 0.49]).choose(&dive, First::NONE), First::NONE);
    }

    #[test]
    fn a_path_waits_for_an_aircraft_that_does_not_move() {
        let mut course = Course::new();
        let still = State { airspeed: 20.0, ..State::NEUTRAL };
        for _ in 0..100 {
            course.towards(&still, [0.8, 0.3], [-0.8, 2.1], &SLOW);
        }
        let [roll, pitch] = course.at(0).attitude;
        assert!(roll <= AHEAD && pitch <= AHEAD, "{roll} {pitch}");
    }
}
