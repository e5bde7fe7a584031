//! Input effects, between the actuators' measured positions and the acting deflections: one file each.
//!
//! They have memory and are not linear in their constant. Several of one model act one after the other in
//! the order of the list at the end of this file. To add one: write its file beside these and name it
//! there.
//!
//! They apply wherever a model is stepped: free runs, imagined flights, the planner (which assumes surfaces and
//! throttle at rest before, since it does not observe the acting deflections). In trim only the dead zone would
//! matter, and trim neglects it; the linear model, and thus the design of the LQI, neglects all. The LQI's integrators
//! compensate their constant part; the cost of a lag or delay is measured in `tests/model/effects_lqi.rs`.

use crate::Controls;
use crate::actuators::LAGS;
use crate::effects::{Coefficient, Description, Entry};
use greylag_num::Real;

/// Time between two calls of [`InputEffect::act`], s.
pub const STEP: f64 = 0.01;

/// Number of past deflections that an effect may use.
pub const PAST: usize = 24;

/// Largest number of input effects of a model.
pub const MOST: usize = 3;

/// Controls that an input effect acts on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Acts {
    /// Aileron and elevator, rad.
    OnSurfaces,
    /// The throttle, 0 to 1.
    OnThrottle,
}

/// An effect on the surfaces or the throttle, with one constant.
pub trait InputEffect {
    /// Identifier in parameter files, JSON and the command line.
    const ID: &'static str;
    /// Description of the effect, in one sentence.
    const DESCRIPTION: &'static str;
    /// Formula of its effect on a deflection or throttle u, in textbook notation.
    const FORMULA: &'static str;
    /// Source of the formula.
    const SOURCE: &'static str;
    /// The effect's single constant.
    const COEFFICIENTS: &'static [Coefficient; 1];
    /// Entry in the catalogue of effects.
    const ENTRY: Entry;
    /// Controls that it acts on.
    const ACTS: Acts = Acts::OnSurfaces;

    /// Acting deflection (rad) or throttle (0 to 1) at the measured position `input`, with the effect's `constant`.
    /// Must be called once every [`STEP`].
    fn act<R: Real>(constant: f64, memory: &mut Past<R>, input: R) -> R;
}

/// Memory of an effect for one surface (rad) or for the throttle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Past<R = f64> {
    /// Previous acting value.
    pub output: R,
    /// Earlier inputs, newest first.
    pub inputs: [R; PAST],
}

impl<R: Real> Past<R> {
    /// Memory of a surface or throttle at rest at `position`.
    #[inline(always)]
    pub fn at_rest(position: R) -> Self {
        Past { output: position, inputs: [position; PAST] }
    }

    /// Prepends `input` to the inputs.
    #[inline(always)]
    pub fn push(&mut self, input: R) {
        self.inputs.copy_within(0..PAST - 1, 1);
        self.inputs[0] = input;
    }
}

/// Memory of a model's past controls; `GreyBox::at_rest` of the crate `greylag-model` creates it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InputMemory<R = f64> {
    /// Memories of its input effects for aileron, elevator and throttle; they do not act on a rudder.
    inputs: [[Past<R>; 3]; MOST],
    /// Memories of its formulas' lags and delays.
    pub formulas: [Past<R>; LAGS],
}

impl<R: Real> InputMemory<R> {
    /// Memory of surfaces and throttle at rest at `controls`, with lagged arguments at rest at `lagged`.
    #[inline(always)]
    pub fn at_rest(controls: &Controls<R>, lagged: [R; LAGS]) -> Self {
        let Controls { aileron, elevator, throttle, .. } = *controls;
        InputMemory {
            inputs: [[aileron, elevator, throttle].map(Past::at_rest); MOST],
            formulas: lagged.map(Past::at_rest),
        }
    }

    /// Selects the memory `then` where `chosen` is above zero, else this one.
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

    /// Acting controls after the effect at index `place` (below [`MOST`]) of a model's list.
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

        /// Identifies one input effect of the list.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum Kind { $(
            #[doc = concat!("See [`", stringify!($type), "`].")]
            $type,
        )* }

        impl Kind {
            /// All input effects.
            pub const ALL: &'static [Kind] = &[$(Kind::$type),*];

            /// Description of the effect.
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

            /// Controls that the effect acts on.
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
    /// The input effect with the id `id`.
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
