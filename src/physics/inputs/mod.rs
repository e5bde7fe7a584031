//! Effects between the actuators' measured positions and what acts on the air: one file each.
//!
//! They have memory and are not linear in their constant. Several of one model act one after the other in
//! the order of the list at the end of this file. To add one: write its file beside these and name it
//! there.
//!
//! They take part wherever a model is stepped: free runs, imagined flights, the planner (which takes the
//! surfaces and the throttle to have been at rest, as it does not observe what acted before). Trim needs none of them but
//! for the dead zone, which it leaves out; the linear model, and so the design of the
//! LQI, leaves out all. The LQI's integrators take up what is constant in them; what a lag or delay costs
//! is shown in `tests/effects_lqi.rs`.

use crate::Controls;
use crate::actuators::LAGS;
use crate::effects::{Coefficient, Description, Entry};
use greylag_num::Real;

/// Time between two calls of [`InputEffect::act`], s.
pub const STEP: f64 = 0.01;

/// Past deflections that an effect may remember.
pub const PAST: usize = 24;

/// Effects that one model may have.
pub const MOST: usize = 3;

/// What an input effect acts on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Acts {
    /// On aileron and elevator, rad.
    OnSurfaces,
    /// On the throttle, 0 to 1.
    OnThrottle,
}

/// An effect on what the surfaces or the throttle do, with one constant.
pub trait InputEffect {
    /// The id of parameter files, JSON and the command line.
    const ID: &'static str;
    /// What it is, in one sentence.
    const DESCRIPTION: &'static str;
    /// What it does to a deflection or throttle u, in textbook letters.
    const FORMULA: &'static str;
    /// Where the formula comes from.
    const SOURCE: &'static str;
    /// Its constant.
    const COEFFICIENTS: &'static [Coefficient; 1];
    /// Its entry in the catalogue of effects.
    const ENTRY: Entry;
    /// What it acts on.
    const ACTS: Acts = Acts::OnSurfaces;

    /// The deflection (rad) or throttle (0 to 1) that acts now, `input` being its measured position, `constant`
    /// the effect's. Called once every [`STEP`].
    fn act<R: Real>(constant: f64, memory: &mut Past<R>, input: R) -> R;
}

/// What an effect remembers of one surface (rad) or of the throttle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Past<R = f64> {
    /// The value that acted last.
    pub output: R,
    /// Earlier inputs, newest first.
    pub inputs: [R; PAST],
}

impl<R: Real> Past<R> {
    /// A surface or throttle that has been at `position` for long.
    #[inline(always)]
    pub fn at_rest(position: R) -> Self {
        Past { output: position, inputs: [position; PAST] }
    }

    /// Puts `input` at the front of the inputs.
    #[inline(always)]
    pub fn push(&mut self, input: R) {
        self.inputs.copy_within(0..PAST - 1, 1);
        self.inputs[0] = input;
    }
}

/// What a model remembers of its controls' past; `GreyBox::at_rest` of the crate `greylag-model` makes it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InputMemory<R = f64> {
    /// What its input effects remember of aileron, elevator and throttle; on a rudder they do not act.
    inputs: [[Past<R>; 3]; MOST],
    /// What its formulas remember of what they lag or delay.
    pub formulas: [Past<R>; LAGS],
}

impl<R: Real> InputMemory<R> {
    /// Surfaces and throttle that have been at `controls` for long, and what formulas lag, which has been at `lagged`.
    #[inline(always)]
    pub fn at_rest(controls: &Controls<R>, lagged: [R; LAGS]) -> Self {
        let Controls { aileron, elevator, throttle, .. } = *controls;
        InputMemory {
            inputs: [[aileron, elevator, throttle].map(Past::at_rest); MOST],
            formulas: lagged.map(Past::at_rest),
        }
    }

    /// What `then` remembers where `chosen` is above zero, else this.
    pub fn replaced(&self, chosen: R, then: &Self) -> Self {
        let one = |old: R, new: R| R::where_less(R::zero(), chosen, new, old);
        let past = |old: &Past<R>, new: &Past<R>| Past {
            output: one(old.output, new.output),
            inputs: std::array::from_fn(|k| one(old.inputs[k], new.inputs[k])),
        };
        InputMemory {
            inputs: std::array::from_fn(|k| {
                std::array::from_fn(|control| {
                    past(&self.inputs[k][control], &then.inputs[k][control])
                })
            }),
            formulas: std::array::from_fn(|k| past(&self.formulas[k], &then.formulas[k])),
        }
    }

    /// What acts now through the effect in `place` (below [`MOST`]) of a model's list.
    #[inline(always)]
    pub fn act(&mut self, place: usize, kind: Kind, constant: f64, z: &Controls<R>) -> Controls<R> {
        let [aileron, elevator, throttle] = &mut self.inputs[place];
        match kind.acts() {
            Acts::OnSurfaces => Controls {
                aileron: kind.act(constant, aileron, z.aileron),
                elevator: kind.act(constant, elevator, z.elevator),
                ..*z
            },
            Acts::OnThrottle => {
                Controls { throttle: kind.act(constant, throttle, z.throttle), ..*z }
            }
        }
    }
}

macro_rules! inputs {
    ($($module:ident :: $type:ident),* $(,)?) => {
        $(mod $module; pub use $module::$type;)*

        /// One of the input effects of the list.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum Kind { $(
            #[doc = concat!("See [`", stringify!($type), "`].")]
            $type,
        )* }

        impl Kind {
            /// Every input effect there is.
            pub const ALL: &'static [Kind] = &[$(Kind::$type),*];

            /// What is known of the effect.
            pub const fn describe(self) -> Description {
                match self { $(Kind::$type => Description {
                    id: $type::ID,
                    description: $type::DESCRIPTION,
                    formula: $type::FORMULA,
                    source: $type::SOURCE,
                    coefficients: $type::COEFFICIENTS,
                    shape: 1,
                    table: None,
                    grid: None,
                    replaces: &[],
                    entry: Some($type::ENTRY),
                },)* }
            }

            /// What the effect acts on.
            pub const fn acts(self) -> Acts {
                match self { $(Kind::$type => $type::ACTS,)* }
            }

            /// [`InputEffect::act`] of this effect.
            #[inline(always)]
            pub fn act<R: Real>(self, constant: f64, memory: &mut Past<R>, input: R) -> R {
                match self { $(Kind::$type => $type::act(constant, memory, input),)* }
            }
        }
    };
}

impl Kind {
    /// The input effect of that id.
    pub fn from_id(id: &str) -> Option<Kind> {
        Kind::ALL.iter().copied().find(|kind| kind.describe().id == id)
    }
}

inputs! {
    actuator_lag::ActuatorLag,
    time_delay::TimeDelay,
    dead_zone::DeadZone,
    backlash::Backlash,
    rate_limit::RateLimit,
    thrust_lag::ThrustLag,
}
