//! Catalogue of flight-test manoeuvres by name. A manoeuvre consists of steps. In a step a controller holds a target, and
//! excitations such as pulses are added to its commands or its targets.

use crate::excitation::Axis::{self, Aileron, Elevator, Pitch, Roll, Throttle};
use crate::{Excitation, Schedule, Shape, Step};

/// Airspeeds of the manoeuvres that excite effects that depend on airspeed, m/s.
const SPEEDS: [f64; 3] = [15.0, 19.0, 24.0];

/// A manoeuvre of the menu.
#[derive(Clone, Copy, Debug)]
pub struct Manoeuvre {
    /// Name of the manoeuvre.
    pub name: &'static str,
    /// Purpose in one sentence.
    pub description: &'static str,
    steps: fn() -> Vec<Step>,
}

impl Manoeuvre {
    /// The manoeuvre as a schedule. A step with wings level is added at the end.
    pub fn schedule(&self) -> Schedule {
        let mut steps = (self.steps)();
        steps.push(Step::hold(2.0, 0.0, 2.0, 18.0));
        Schedule { name: self.name.into(), description: self.description.into(), steps }
    }
}

/// A turn onto the opposite heading, for use between manoeuvres.
pub const TURN: Manoeuvre = Manoeuvre {
    name: "turn",
    description: "A turn onto the opposite heading.",
    // at a bank of 45° and 19 m/s the turn rate is 30 °/s, so a turn of 180° takes 6 s
    steps: || vec![Step::hold(6.5, 45.0, 5.0, 19.0)],
};

/// The manoeuvre called `name`. `None` if the menu has no such manoeuvre.
pub fn named(name: &str) -> Option<&'static Manoeuvre> {
    MENU.iter().find(|m| m.name == name)
}

/// All manoeuvres of the menu.
pub const MENU: &[Manoeuvre] = &[
    Manoeuvre {
        name: "elevator-3211",
        description: "3-2-1-1 on the elevator at two speeds: pitch dynamics.",
        steps: || SPEEDS[..2].iter().map(|&v| step_3211(Elevator, 0.22, 0.25, 5.0, v)).collect(),
    },
    Manoeuvre {
        name: "aileron-3211",
        description: "3-2-1-1 on the aileron at two speeds: roll with its adverse yaw.",
        steps: || SPEEDS[..2].iter().map(|&v| step_3211(Aileron, 0.25, 0.25, 5.0, v)).collect(),
    },
    Manoeuvre {
        name: "slow-multisine",
        description: "Sines of 0.1 to 1.5 Hz on every control at once.",
        steps: || multisines(12.0, 0.1, 1.5, [0.12, 0.10, 0.15]),
    },
    Manoeuvre {
        name: "fast-multisine",
        description: "Sines of 2 to 6 Hz on the surfaces: distinguishes lags from delays.",
        steps: || multisines(8.0, 2.0, 6.0, [0.20, 0.20, 0.0]),
    },
    Manoeuvre {
        name: "throttle-steps",
        description: "Steps of the throttle at three speeds: thrust, its decay, its wash.",
        steps: || {
            let up_down = |v: f64| {
                let step = Step::hold(6.0, 0.0, 2.0, v);
                step.with(pulse(Throttle, 0.6, 0.5, 2.0)).with(pulse(Throttle, -0.6, 3.0, 2.0))
            };
            SPEEDS.map(up_down).to_vec()
        },
    },
    Manoeuvre {
        name: "throttle-with-surfaces",
        description: "Doublets of both surfaces at full and at no throttle: propeller wash.",
        steps: || {
            let at = |throttle: f64| {
                let step =
                    Step::hold(5.0, 0.0, 3.0, 18.0).with(pulse(Throttle, throttle, 0.0, 5.0));
                step.with(doublet(Elevator, 0.2, 1.0, 0.35)).with(doublet(Aileron, 0.2, 2.8, 0.35))
            };
            vec![at(0.7), at(-0.7), at(0.7)]
        },
    },
    Manoeuvre {
        name: "level-acceleration",
        description: "From slow to fast and back, near level: drag over speed.",
        steps: || {
            vec![
                Step::hold(5.0, 0.0, 4.0, 14.0),
                Step::hold(8.0, 0.0, 0.0, 28.0).with(pulse(Throttle, 1.0, 0.0, 5.0)),
                Step::hold(7.0, 0.0, 0.0, 14.0).with(pulse(Throttle, -1.0, 0.0, 6.0)),
            ]
        },
    },
    Manoeuvre {
        name: "stall-and-push",
        description: "Slow to beyond the stall, push, and push to negative angles of attack.",
        steps: || {
            vec![
                stall(1.0),
                Step::hold(4.0, 0.0, 0.0, 19.0),
                push(1.0),
                Step::hold(3.0, 0.0, 4.0, 18.0),
            ]
        },
    },
    Manoeuvre {
        name: "roll-and-pull",
        description: "Roll rate with pull at once: rate effects against those of incidence.",
        steps: || {
            let one = |side: f64| {
                let step = Step::hold(4.0, 30.0 * side, 4.0, 19.0);
                step.with(firm(Aileron, 0.3 * side, 0.6, 0.5)).with(pulse(Elevator, -0.3, 0.6, 0.5))
            };
            vec![one(1.0), one(-1.0), one(1.0)]
        },
    },
    Manoeuvre {
        name: "bank-to-bank",
        description: "Fast rolls from bank to bank: products of inertia, roll damping.",
        steps: || {
            let one = |side: f64| {
                Step::hold(2.5, 40.0 * side, 4.0, 21.0).with(firm(Aileron, 0.35 * side, 0.1, 0.4))
            };
            [1.0, -1.0, 1.0, -1.0, 1.0, -1.0].map(one).to_vec()
        },
    },
    Manoeuvre {
        name: "skid",
        description: "Aileron sines at the yaw mode's pace (0.5 to 1.1 Hz), wings near level: sideslip without a rudder.",
        steps: || {
            let sway =
                |v: f64| Step::hold(8.0, 0.0, 3.0, v).with(sines(Aileron, 0.35, 0.5, 1.1, 5));
            vec![sway(15.0), sway(20.0)]
        },
    },
    Manoeuvre {
        name: "pull-in-bank",
        description: "Pulls in a steep turn to both sides: sideways centre of gravity, side force.",
        steps: || {
            let one = |side: f64| {
                let step = Step::hold(6.0, 50.0 * side, 4.0, 21.0);
                step.with(doublet(Elevator, -0.25, 2.5, 0.5)).with(pulse(Elevator, -0.2, 4.5, 0.5))
            };
            vec![one(1.0), one(-1.0)]
        },
    },
    Manoeuvre {
        name: "two-headings",
        description: "The same doublets on opposite headings: what turns with the wind.",
        steps: || {
            let shake = Step::hold(4.0, 0.0, 3.0, 19.0).with(doublet(Elevator, 0.15, 1.0, 0.4));
            vec![shake.clone(), Step::hold(7.0, 45.0, 5.0, 19.0), shake]
        },
    },
    Manoeuvre {
        name: "two-altitudes",
        description: "The same doublets before and after a climb: what depends on air density.",
        steps: || {
            let shake = Step::hold(4.0, 0.0, 3.0, 19.0).with(doublet(Elevator, 0.15, 1.0, 0.4));
            vec![shake.clone(), Step::hold(20.0, 0.0, 25.0, 19.0), shake]
        },
    },
    Manoeuvre {
        name: "small-doublets",
        description: "Small doublets of both surfaces: dead zone and backlash.",
        steps: || doublets(0.03),
    },
    Manoeuvre {
        name: "large-doublets",
        description: "Large doublets of both surfaces: saturation and limited rate.",
        steps: || doublets(0.4),
    },
    Manoeuvre {
        name: "roll-at-two-alphas",
        description: "Aileron pulses and steady rolls, slow and fast: what changes with incidence.",
        steps: || {
            let at = |v: f64, pitch: f64| {
                let step = Step::hold(6.0, 0.0, pitch, v);
                step.with(doublet(Aileron, 0.25, 1.0, 0.3)).with(doublet(Aileron, 0.25, 3.5, 0.8))
            };
            vec![at(14.0, 7.0), at(24.0, 0.0)]
        },
    },
    Manoeuvre {
        name: "elevator-with-throttle",
        description: "Elevator sines while the throttle steps: incidence rate against pitch rate.",
        steps: || {
            let step = Step::hold(10.0, 0.0, 3.0, 17.0);
            let step = step.with(sines(Elevator, 0.18, 0.5, 3.0, 6));
            vec![step.with(pulse(Throttle, 0.6, 2.0, 3.0)).with(pulse(Throttle, -0.5, 6.0, 3.0))]
        },
    },
    Manoeuvre {
        name: "push-over",
        description: "Pitch targets up and down with the elevator quiet between: drag over incidence.",
        steps: || {
            let step = Step::hold(10.0, 0.0, 2.0, 19.0);
            vec![step.with(doublet(Pitch, 0.2, 1.0, 2.0)).with(doublet(Pitch, -0.25, 5.5, 1.5))]
        },
    },
];

/// Slows down into the stall with the nose up and the throttle closed, then lowers the nose. The nose is held up for 3.2 s +
/// 0.8 s · `depth`. The menu uses a `depth` of 1. Randomly drawn flights use 1.7 to 2.3.
pub(super) fn stall(depth: f64) -> Step {
    let up = 3.2 + 0.8 * depth;
    let step = Step::hold(up + 2.8, 0.0, 14.0, 12.0).with(pulse(Throttle, -1.0, 0.0, up));
    step.with(pulse(Pitch, (-20.0_f64).to_radians(), up, 1.2))
}

/// Pushes the nose down to a clearly negative angle of attack. `depth` (0..1) scales the elevator pulses.
pub(super) fn push(depth: f64) -> Step {
    let step = Step::hold(4.0, 0.0, 10.0, 18.0);
    step.with(pulse(Elevator, 0.35 * depth, 1.2, 0.35)).with(pulse(
        Elevator,
        0.25 * depth,
        2.8,
        0.4,
    ))
}

/// A 3-2-1-1 on `axis`: four steps of alternating sign, which last 3, 2, 1 and 1 times `width` (s). The aircraft flies near
/// level at the airspeed `v` (m/s).
fn step_3211(axis: Axis, amplitude: f64, width: f64, pitch_deg: f64, v: f64) -> Step {
    let shape = Shape::ThreeTwoOneOne { width };
    Step::hold(7.0 * width + 4.0, 0.0, pitch_deg - 2.0, v).with(loose(axis, amplitude, 1.5, shape))
}

/// Multisines from `low` to `high` (Hz) on aileron, elevator and throttle at once, and slow changes of the roll target. The
/// last argument holds the three amplitudes.
fn multisines(duration: f64, low: f64, high: f64, [a, e, t]: [f64; 3]) -> Vec<Step> {
    let step = Step::hold(duration, 0.0, 3.0, 18.0);
    let step = step.with(sines(Aileron, a, low, high, 1)).with(sines(Elevator, e, low, high, 2));
    let step = if t > 0.0 { step.with(sines(Throttle, t, low, high, 3)) } else { step };
    vec![step.with(sines(Roll, 0.2, 0.1, 0.25, 4))]
}

/// Doublets (a positive and a negative pulse) of three widths, first on the elevator, then on the aileron.
fn doublets(amplitude: f64) -> Vec<Step> {
    let on = |axis: Axis| {
        let step = Step::hold(6.0, 0.0, 3.0, 18.0);
        step.with(doublet(axis, amplitude, 0.8, 0.15))
            .with(doublet(axis, amplitude, 2.0, 0.3))
            .with(doublet(axis, amplitude, 3.8, 0.5))
    };
    vec![on(Elevator), on(Aileron)]
}

/// Fraction of the controller's reaction that is applied to a surface while it is excited.
const LOOSE: f64 = 0.25;

/// The excitation `shape` on `axis`. On aileron and elevator the controller's reaction is reduced to the fraction [`LOOSE`].
pub(super) fn loose(axis: Axis, amplitude: f64, start: f64, shape: Shape) -> Excitation {
    let authority = if matches!(axis, Aileron | Elevator) { LOOSE } else { 1.0 };
    Excitation::new(axis, amplitude, start, shape).against(authority)
}

/// The same pulse as [`pulse`], but with the controller's full reaction on every axis.
pub(super) fn firm(axis: Axis, amplitude: f64, start: f64, width: f64) -> Excitation {
    Excitation::new(axis, amplitude, start, Shape::Step { width })
}

/// A pulse of `amplitude` for `width` (s) from `start` (s) on, with the reduced reaction of [`loose`].
pub(super) fn pulse(axis: Axis, amplitude: f64, start: f64, width: f64) -> Excitation {
    loose(axis, amplitude, start, Shape::Step { width })
}

/// A doublet from `start` (s) on: +`amplitude`, then −`amplitude`, each for `width` (s), with the reduced reaction of
/// [`loose`].
pub(super) fn doublet(axis: Axis, amplitude: f64, start: f64, width: f64) -> Excitation {
    loose(axis, amplitude, start, Shape::Doublet { width })
}

/// A multisine from `low` to `high` (Hz) during the whole step, with the controller's full reaction. `seed` determines its
/// frequencies and phases.
pub(super) fn sines(axis: Axis, amplitude: f64, low: f64, high: f64, seed: u64) -> Excitation {
    Excitation::new(axis, amplitude, 0.0, Shape::multisine(low, high, seed))
}
