//! Complete test flights drawn from a seed: three for training and two for validation.

use rand::RngExt;

use crate::excitation::Axis::{self, Aileron, Elevator, Throttle};
use crate::menu::{doublet, firm, loose, pulse, push, sines, stall};
use crate::{Schedule, Shape, Step};
use greylag_num::stream::{Stream, stream};

/// Length of each flight, s. A flight is longer if its drawn steps take longer.
pub const FLIGHT_S: f64 = 50.0;

/// The three training flights of `seed`. The first excites pitch, the second roll and yaw, the third all axes at once.
pub fn training(seed: u64) -> [Schedule; 3] {
    let flight = |k: u64, steps: fn(&mut Draw) -> Vec<Step>| {
        let name = format!("train-{k}");
        drawn(&name, "A training flight: excites everything.", seed, &[1, k], steps)
    };
    [flight(1, along), flight(2, across), flight(3, mixed)]
}

/// The two test flights of `seed`. Their manoeuvres, times and amplitudes differ from those of the training flights.
pub fn testing(seed: u64) -> [Schedule; 2] {
    [1, 2].map(|k| {
        let name = format!("test-{k}");
        drawn(&name, "A test flight: never used in fitting.", seed, &[2, k], other)
    })
}

/// Source of the random variations of the steps.
struct Draw(Stream);

impl Draw {
    /// A uniformly distributed value between `low` and `high`.
    fn within(&mut self, low: f64, high: f64) -> f64 {
        self.0.random_range(low..high)
    }

    /// A uniformly distributed value within 20 % of `nominal`.
    fn about(&mut self, nominal: f64) -> f64 {
        nominal * self.within(0.8, 1.2)
    }

    /// A random sign, −1 or 1.
    fn side(&mut self) -> f64 {
        if self.0.random::<bool>() { 1.0 } else { -1.0 }
    }

    fn seed(&mut self) -> u64 {
        self.0.random::<u32>().into()
    }
}

fn drawn(
    name: &str,
    about: &str,
    seed: u64,
    path: &[u64],
    steps: fn(&mut Draw) -> Vec<Step>,
) -> Schedule {
    let mut draw = Draw(stream(seed, &[[50].as_slice(), path].concat()));
    let mut steps: Vec<Step> = steps(&mut draw);
    steps.iter_mut().for_each(|step| shake(step, &mut draw));
    let flown: f64 = steps.iter().map(|s| s.duration).sum();
    steps.push(Step::hold((FLIGHT_S - flown).max(1.0), 0.0, 2.0, 18.0));
    Schedule { name: name.into(), description: about.into(), steps }
}

/// Adds small multisines on aileron, elevator and throttle to a step.
fn shake(step: &mut Step, draw: &mut Draw) {
    let amplitudes = [(Aileron, 0.035), (Elevator, 0.03), (Throttle, 0.08)];
    for (axis, amplitude) in amplitudes {
        let high = if axis == Throttle { 1.0 } else { 4.0 };
        step.excitations.push(sines(axis, amplitude, 0.2, high, draw.seed()));
    }
}

/// A step with a 3-2-1-1 manoeuvre on `axis` at the airspeed `v` (m/s).
fn three211(draw: &mut Draw, axis: Axis, amplitude: f64, v: f64) -> Step {
    let shape = Shape::ThreeTwoOneOne { width: draw.within(0.2, 0.3) };
    let amplitude = draw.about(amplitude) * draw.side();
    Step::hold(4.0, 0.0, draw.within(2.0, 5.0), v).with(loose(axis, amplitude, 0.8, shape))
}

/// A step with a small and a large doublet on `axis` at the airspeed `v` (m/s).
fn two_sizes(draw: &mut Draw, axis: Axis, v: f64) -> Step {
    let (small, large) = (draw.about(0.05), draw.about(0.38));
    let step = Step::hold(4.5, 0.0, draw.within(2.0, 5.0), v);
    step.with(doublet(axis, small * draw.side(), 0.5, draw.within(0.25, 0.4))).with(doublet(
        axis,
        large * draw.side(),
        2.0,
        draw.within(0.2, 0.3),
    ))
}

/// A step with a positive and a negative throttle pulse at the airspeed `v` (m/s).
fn throttle(draw: &mut Draw, v: f64) -> Step {
    let (up, down) = (draw.about(0.6), draw.about(0.5));
    let step = Step::hold(4.0, 0.0, draw.within(1.0, 5.0), v);
    step.with(pulse(Throttle, up, 0.4, 1.6)).with(pulse(Throttle, -down, 2.4, 1.4))
}

/// A fast roll to a bank of 32° to 45° on `side` (±1) at the airspeed `v` (m/s), with an aileron pulse in the same direction.
fn roll(draw: &mut Draw, side: f64, v: f64) -> Step {
    let (bank, amplitude) = (draw.within(32.0, 45.0), draw.about(0.3));
    let step = Step::hold(2.6, side * bank, draw.within(2.0, 6.0), v);
    step.with(firm(Aileron, side * amplitude, draw.within(0.1, 0.5), 0.4))
}

/// A banked turn to `side` (±1) with two nose-up elevator pulses. An aileron pulse against the bank accompanies the second.
fn pull(draw: &mut Draw, side: f64) -> Step {
    let (bank, amplitude) = (draw.within(40.0, 52.0), draw.about(0.25));
    let step = Step::hold(4.5, side * bank, 5.0, draw.within(20.0, 23.0));
    let step = step.with(pulse(Elevator, -amplitude, 1.0, 0.4));
    step.with(pulse(Elevator, -amplitude, 2.8, 0.4)).with(firm(Aileron, -0.2 * side, 2.8, 0.4))
}

/// A step in which slow aileron sines excite sideslip at the airspeed `v` (m/s).
fn skid(draw: &mut Draw, v: f64) -> Step {
    let amplitude = draw.about(0.35);
    Step::hold(5.5, 0.0, 4.0, v).with(sines(Aileron, amplitude, 0.45, 1.1, draw.seed()))
}

/// Steps that excite pitch, thrust and stall.
fn along(draw: &mut Draw) -> Vec<Step> {
    let v = draw.within(16.0, 18.0);
    vec![
        Step::hold(1.5, 0.0, 3.0, v),
        three211(draw, Elevator, 0.22, v),
        throttle(draw, v),
        stall(draw.within(1.9, 2.3)),
        Step::hold(2.5, 0.0, 0.0, 20.0),
        push(draw.within(0.85, 1.0)),
        two_sizes(draw, Elevator, 19.0),
        throttle(draw, 23.0),
        Step::hold(4.0, 0.0, -4.0, 27.0).with(pulse(Throttle, 1.0, 0.0, 3.0)),
        three211(draw, Elevator, 0.15, 25.0),
        Step::hold(4.0, 0.0, 6.0, 15.0).with(pulse(Throttle, -1.0, 0.0, 3.0)),
    ]
}

/// Steps that excite roll, yaw and sideslip.
fn across(draw: &mut Draw) -> Vec<Step> {
    let side = draw.side();
    vec![
        Step::hold(1.5, 0.0, 3.0, 18.0),
        three211(draw, Aileron, 0.25, 17.0),
        skid(draw, 15.0),
        roll(draw, side, 20.0),
        roll(draw, -side, 21.0),
        roll(draw, side, 22.0),
        roll(draw, -side, 22.0),
        two_sizes(draw, Aileron, 19.0),
        pull(draw, side),
        pull(draw, -side),
        skid(draw, 21.0),
        three211(draw, Aileron, 0.2, 24.0),
    ]
}

/// Steps that excite all axes at three airspeeds and several banks.
fn mixed(draw: &mut Draw) -> Vec<Step> {
    let side = draw.side();
    let mut all = |duration: f64, roll: f64, pitch: f64, v: f64| {
        let low = Step::hold(duration, roll * side, pitch, v);
        low.with(sines(Aileron, draw.about(0.12), 0.2, 2.0, draw.seed()))
            .with(sines(Elevator, draw.about(0.10), 0.3, 3.0, draw.seed()))
            .with(sines(Throttle, draw.about(0.2), 0.1, 0.8, draw.seed()))
    };
    let mut steps = vec![
        Step::hold(1.5, 0.0, 3.0, 18.0),
        all(7.0, 0.0, 5.0, 15.0),
        all(5.0, 40.0, 5.0, 19.0),
        all(7.0, -30.0, 2.0, 24.0),
    ];
    let bank = 30.0 * side;
    steps.extend([
        Step::hold(4.0, bank, 5.0, 20.0)
            .with(firm(Aileron, 0.3 * side, 1.0, 0.5))
            .with(pulse(Elevator, -0.3, 1.0, 0.5)),
        throttle(draw, 20.0),
        stall(draw.within(1.7, 2.1)),
        Step::hold(2.0, 0.0, 0.0, 20.0),
        pull(draw, -side),
        two_sizes(draw, Elevator, 17.0),
    ]);
    steps
}

/// Six random legs, alternately with doublets and with sines. A stall, a push-over and two rolls follow.
fn other(draw: &mut Draw) -> Vec<Step> {
    let mut steps = vec![Step::hold(1.5, 0.0, 3.0, 18.0)];
    for _ in 0..3 {
        let (roll_deg, pitch_deg) = (draw.within(-40.0, 40.0), draw.within(-6.0, 10.0));
        let leg = Step::hold(5.0, roll_deg, pitch_deg, draw.within(15.0, 24.0));
        let [a, e] = [draw.about(0.2), draw.about(0.18)].map(|x| x * draw.side());
        let leg = leg.with(doublet(Aileron, a, draw.within(1.6, 2.0), draw.within(0.2, 0.45)));
        let leg = leg.with(doublet(Elevator, e, draw.within(3.1, 3.6), draw.within(0.2, 0.45)));
        steps.push(leg.with(pulse(Throttle, draw.within(-0.5, 0.5), 1.5, 2.0)));
        let leg = Step::hold(
            4.0,
            draw.within(-30.0, 30.0),
            draw.within(0.0, 6.0),
            draw.within(16.0, 23.0),
        );
        let (fast, slow) = (draw.about(0.12), draw.about(0.10));
        let leg = leg.with(sines(Aileron, fast, 0.3, 3.0, draw.seed()));
        steps.push(leg.with(sines(Elevator, slow, 0.3, 3.0, draw.seed())));
    }
    steps.push(stall(draw.within(1.7, 2.1)));
    steps.push(Step::hold(2.0, 0.0, 0.0, 20.0));
    steps.push(push(draw.within(0.7, 0.9)));
    let side = draw.side();
    steps.push(roll(draw, side, 21.0));
    steps.push(roll(draw, -side, 21.0));
    steps
}
