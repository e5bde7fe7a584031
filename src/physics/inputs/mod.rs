//! Input effects, such as a lag or backlash: they act between the actuators' measured positions and the acting deflections.
//! Each has its own file.
//!
//! Most input effects have memory and are nonlinear in their constant. The curves of servos have no memory, and the acting
//! deflection is linear in their constant. Several effects of one model act one after the other in the order of the list at the
//! end of this file. A new effect needs a file in this folder and its name in that list.
//!
//! Input effects apply wherever a model is stepped: open-loop simulations, simulated flights and the planner. The planner
//! does not observe the acting deflections and assumes surfaces and throttle at rest before its plan. Trim neglects input
//! effects; in steady flight only the dead zone and the curve of a servo would matter. The linear model, and thus the design of
//! the LQI, neglects all of them. The LQI's integrators compensate constant errors caused by this.
//! `tests/model/effects_lqi.rs` measures how much a lag or delay degrades the LQI.

use crate::Controls;
use crate::actuators::LAGS;
use crate::effects::{Coefficient, Description, Entry};
use greylag_num::Real;

/// Time between two calls of [`InputEffect::act`], s.
pub const STEP: f64 = 0.01;

/// Number of past inputs that an effect stores, one per `STEP`.
pub const PAST: usize = 24;

/// Largest number of input effects of a model.
pub const MOST: usize = 3;

/// Controls on which an input effect acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Acts {
    /// Aileron and elevator, rad.
    OnSurfaces,
    /// The aileron, rad.
    OnAileron,
    /// The elevator, rad.
    OnElevator,
    /// The throttle, 0 to 1.
    OnThrottle,
}

/// An effect on the surfaces or the throttle, with one constant.
pub trait InputEffect {
    /// Identifier in parameter files, JSON and the command line.
    const ID: &'static str;
    /// Description of the effect, in one sentence.
    const DESCRIPTION: &'static str;
    /// Formula for a deflection or throttle u, in textbook notation.
    const FORMULA: &'static str;
    /// Source of the formula.
    const SOURCE: &'static str;
    /// The effect's single constant. It is a shape constant, unless the acting value is linear in it.
    const COEFFICIENTS: &'static [Coefficient; 1];
    /// Entry in the catalogue of effects. Its starting values are empty if the acting value is linear in the constant.
    const ENTRY: Entry;
    /// Controls on which the effect acts.
    const ACTS: Acts = Acts::OnSurfaces;

    /// Returns the acting deflection (rad) or throttle (0 to 1) for the measured position `input` and the effect's
    /// `constant`. To be called once every [`STEP`].
    fn act<R: Real>(constant: f64, memory: &mut Past<R>, input: R) -> R;
}

/// Memory of an effect for one surface or the throttle. Values are in rad for a surface, 0..1 for the throttle.
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

    /// Stores `input` as the newest input.
    #[inline(always)]
    pub fn push(&mut self, input: R) {
        self.inputs.copy_within(0..PAST - 1, 1);
        self.inputs[0] = input;
    }
}

/// Memory of a model's past controls. `GreyBox::at_rest` of the crate `greylag-model` creates it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InputMemory<R = f64> {
    /// Memories of the model's input effects for aileron, elevator and throttle. Input effects do not act on a rudder.
    inputs: [[Past<R>; 3]; MOST],
    /// Memories of the lags and delays in the model's formulas.
    pub formulas: [Past<R>; LAGS],
}

impl<R: Real> InputMemory<R> {
    /// Memory of surfaces and throttle at rest at `controls`, and of lags and delays whose arguments are at rest at `lagged`.
    #[inline(always)]
    pub fn at_rest(controls: &Controls<R>, lagged: [R; LAGS]) -> Self {
        let Controls { aileron, elevator, throttle, .. } = *controls;
        InputMemory {
            inputs: [[aileron, elevator, throttle].map(Past::at_rest); MOST],
            formulas: lagged.map(Past::at_rest),
        }
    }

    /// Returns a memory with the values of `then` in the SIMD lanes in which `chosen` is above zero, and with those of this
    /// memory in the other lanes.
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

    /// Applies the effect at index `place` (below [`MOST`]) of the model's list to the controls `z`, and returns the result.
    #[inline(always)]
    pub fn act(&mut self, place: usize, kind: Kind, constant: f64, z: &Controls<R>) -> Controls<R> {
        let [aileron, elevator, throttle] = &mut self.inputs[place];
        match kind.acts() {
            Acts::OnSurfaces => Controls {
                aileron: kind.act(constant, aileron, z.aileron),
                elevator: kind.act(constant, elevator, z.elevator),
                ..*z
            },
            Acts::OnAileron => Controls { aileron: kind.act(constant, aileron, z.aileron), ..*z },
            Acts::OnElevator => {
                Controls { elevator: kind.act(constant, elevator, z.elevator), ..*z }
            }
            Acts::OnThrottle => {
                Controls { throttle: kind.act(constant, throttle, z.throttle), ..*z }
            }
        }
    }
}

macro_rules! inputs {
    ($($module:ident :: $type:ident),* $(,)?) => {
        $(mod $module; pub use $module::$type;)*

        /// Identifies an input effect of the list in this file.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum Kind { $(
            #[doc = concat!("See [`", stringify!($type), "`].")]
            $type,
        )* }

        impl Kind {
            /// All input effects, in the order of the list.
            pub const ALL: &'static [Kind] = &[$(Kind::$type),*];

            /// Description of the effect.
            pub const fn describe(self) -> Description {
                match self { $(Kind::$type => Description {
                    id: $type::ID,
                    description: $type::DESCRIPTION,
                    formula: $type::FORMULA,
                    source: $type::SOURCE,
                    coefficients: $type::COEFFICIENTS,
                    // an effect without starting values is linear in its constant
                    shape: if $type::ENTRY.starts.is_empty() { 0 } else { 1 },
                    table: None,
                    grid: None,
                    replaces: &[],
                    entry: Some($type::ENTRY),
                },)* }
            }

            /// Controls on which the effect acts.
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
    /// The input effect `id`. `None` if there is no such effect.
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
    servo_aileron::ServoAileron,
    servo_elevator::ServoElevator,
    servo_aileron_curve::ServoAileronCurve,
    servo_elevator_curve::ServoElevatorCurve,
}
