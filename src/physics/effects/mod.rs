//! Physical effects. An effect is a group of forces and moments with their coefficients. Each effect has its own file.
//!
//! A new effect needs a file in this folder and its name in the list at the end of this file. Its id is then available in
//! models, trim, linearisation, the planner, the parameter files, the search for missing effects and the report. Effects can
//! also be defined by formulas in effect files (TOML). Effects between actuator positions and acting deflections are in
//! [`inputs`](crate::inputs).

use crate::formula::{Written, register};
use crate::rigid_body::RigidBody;
use crate::{Channel, Point};
use greylag_num::{Grid, Real, Table};

/// A coefficient of an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coefficient {
    /// Name in parameter files.
    pub name: &'static str,
    /// Physical meaning, in words.
    pub meaning: &'static str,
    /// Unit of the value. Empty if it is dimensionless.
    pub unit: &'static str,
    /// Range of physically possible values.
    pub bounds: (f64, f64),
    /// Whether `bounds` are wider for an aircraft of more than 25 kg or 5 m of span. See [`Size`](crate::size::Size).
    pub grows: bool,
}

/// A coefficient whose bounds grow with the size of the aircraft.
pub const fn coefficient(
    name: &'static str,
    meaning: &'static str,
    unit: &'static str,
    bounds: (f64, f64),
) -> Coefficient {
    Coefficient { name, meaning, unit, bounds, grows: true }
}

impl Coefficient {
    /// The coefficient with bounds that do not grow with the size of the aircraft.
    pub(crate) const fn of_any_size(self) -> Coefficient {
        Coefficient { grows: false, ..self }
    }
}

/// Channels of aerodynamic forces and moments: all except thrust.
const AERODYNAMIC: [Channel; 6] =
    [Channel::Drag, Channel::Lift, Channel::Side, Channel::Roll, Channel::Pitch, Channel::Yaw];

/// Quantities from which an effect is computed. Each variant includes those before it.
///
/// The effects that need only the point of evaluation are evaluated first. The other effects then receive their summed forces
/// and moments.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Needs {
    /// Only the state, the controls and the airflow.
    Point,
    /// Also [`Point::base`]: the forces and moments of the effects that need only the point.
    Base,
    /// Also the part of them that is due to the surfaces, [`Base::deflected`](crate::point::Base::deflected), and their value
    /// for neutral surfaces and zero rates, [`Base::still`](crate::point::Base::still).
    Parts,
    /// Also the time derivative of the state, [`Base::rate`](crate::point::Base::rate).
    Rate,
}

/// Data that a model holds for one of its effects.
#[derive(Clone, Copy, Debug, Default)]
pub struct Own<'a> {
    /// Table of the effect. It is present exactly if [`Effect::TABLE`] is.
    pub table: Option<&'a Table>,
    /// Grid of the effect. It is present exactly if [`Effect::GRID`] is.
    pub grid: Option<&'a Grid>,
    /// Values of the effect's shape constants, its last [`Effect::SHAPE`] coefficients.
    pub shape: &'a [f64],
    /// Index of the effect's first lag among the model's lags, [`Controls::lagged`](crate::Controls::lagged).
    pub first_lag: usize,
}

/// Properties of an effect for the search for missing effects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// Channels in which the effect acts. Empty for an input effect, which acts in the channels of the deflections. A changed
    /// mass or inertia acts like a force or moment in these channels.
    pub channels: &'static [Channel],
    /// Quantities with which the effect may be confounded: ids of effects, full names (`effect.coefficient`) of coefficients, or
    /// a text that names a sensor error.
    pub look_alikes: &'static [&'static str],
    /// Manoeuvre that distinguishes the effect from its `look_alikes`, in words.
    pub separated_by: &'static str,
    /// Values of all coefficients that make the effect clearly visible on an aircraft like the X8. Empty for measurement
    /// errors.
    pub example: &'static [f64],
    /// Starting values of all coefficients for a search over shape constants. Empty for an effect that is linear in all of
    /// its coefficients, or whose shape constants must be given.
    pub starts: &'static [&'static [f64]],
}

/// Receiver of the terms of an effect.
///
/// It is a trait and not a closure, because its method can always be inlined. The call of a closure that is not inlined would
/// not use the instruction set of a planner's vectorised code.
pub trait Terms<R> {
    /// Receives the contribution of one unit of the effect's coefficient `index` to `channel`, in N or N m per unit.
    fn add(&mut self, index: usize, channel: Channel, amount: R);
}

/// A physical effect that is linear in its coefficients, except in its shape constants.
pub trait Effect {
    /// Identifier in parameter files, JSON and the command line.
    const ID: &'static str;
    /// Description of the effect, in one sentence.
    const DESCRIPTION: &'static str;
    /// Formula of the terms added, in textbook notation.
    const FORMULA: &'static str;
    /// Source of the formula.
    const SOURCE: &'static str;
    /// The coefficients, in the order of [`basis`](Effect::basis), then the shape constants.
    const COEFFICIENTS: &'static [Coefficient];
    /// Number of shape constants, in which the effect is nonlinear. They are the last coefficients.
    const SHAPE: usize = 0;
    /// Name of the ordinate of the required table over `alpha_rad`. `None` if the effect needs no table.
    const TABLE: Option<&'static str> = None;
    /// Name of the ordinate of the required grid over `throttle` and `airspeed_mps`. `None` if the effect needs no grid.
    const GRID: Option<&'static str> = None;
    /// Inputs that the effect needs.
    const NEEDS: Needs = Needs::Point;
    /// Full names of the coefficients whose terms the effect replaces. They are zero in a model with the effect.
    const REPLACES: &'static [&'static str] = &[];
    /// Entry in the catalogue of effects that a model may lack. `None` for parts of a basic model.
    const ENTRY: Option<Entry> = None;

    /// Adds to `terms` the contribution of one unit of each coefficient to each channel at the point `at`.
    fn basis<R: Real>(at: &Point<R>, own: Own, terms: &mut impl Terms<R>);

    /// Changes mass and inertia of `_body` according to the effect's coefficients. Most effects change nothing.
    fn change(_coefficients: &[f64], _body: &mut RigidBody) {}
}

/// Description of an effect with its coefficients.
#[derive(Clone, Copy, Debug)]
pub struct Description {
    /// Identifier of the effect, [`Effect::ID`].
    pub id: &'static str,
    /// Description in one sentence, [`Effect::DESCRIPTION`].
    pub description: &'static str,
    /// Formula in textbook notation, [`Effect::FORMULA`].
    pub formula: &'static str,
    /// Source of the formula, [`Effect::SOURCE`].
    pub source: &'static str,
    /// Coefficients and shape constants, [`Effect::COEFFICIENTS`].
    pub coefficients: &'static [Coefficient],
    /// Number of shape constants at the end of the list.
    pub shape: usize,
    /// Ordinate of the required table, [`Effect::TABLE`].
    pub table: Option<&'static str>,
    /// Ordinate of the required grid, [`Effect::GRID`].
    pub grid: Option<&'static str>,
    /// Coefficients whose terms the effect replaces, [`Effect::REPLACES`].
    pub replaces: &'static [&'static str],
    /// Entry for the search for missing effects, [`Effect::ENTRY`].
    pub entry: Option<Entry>,
}

mod curve;

macro_rules! effects {
    ($($module:ident :: $type:ident),* $(,)?) => {
        $(mod $module; pub use $module::$type;)*

        /// Identifies an effect of the list in this file or of an effect file.
        #[derive(Clone, Copy, Debug)]
        pub enum Kind { $(
            #[doc = concat!("See [`", stringify!($type), "`].")]
            $type,
        )*
            /// An effect that an effect file defines.
            Written(&'static Written),
        }

        impl Kind {
            /// All effects of the list, without those of effect files.
            pub const ALL: &'static [Kind] = &[$(Kind::$type),*];

            /// Description of the effect.
            pub const fn describe(self) -> Description {
                match self { $(Kind::$type => Description {
                    id: $type::ID,
                    description: $type::DESCRIPTION,
                    formula: $type::FORMULA,
                    source: $type::SOURCE,
                    coefficients: $type::COEFFICIENTS,
                    shape: $type::SHAPE,
                    table: $type::TABLE,
                    grid: $type::GRID,
                    replaces: $type::REPLACES,
                    entry: $type::ENTRY,
                },)*
                    Kind::Written(effect) => effect.about,
                }
            }

            /// [`Effect::NEEDS`] of this effect.
            pub const fn needs(self) -> Needs {
                match self {
                    $(Kind::$type => $type::NEEDS,)*
                    Kind::Written(effect) => effect.needs(),
                }
            }

            /// [`Effect::basis`] of this effect if the effect needs only the point; otherwise nothing is added. The code of a
            /// sum over these effects therefore does not contain the other effects, which halves the computation time of a
            /// planner.
            #[inline(always)]
            pub fn independent_basis<R: Real>(
                self,
                at: &Point<R>,
                own: Own,
                terms: &mut impl Terms<R>,
            ) {
                match self {
                    $(Kind::$type => if matches!($type::NEEDS, Needs::Point) {
                        $type::basis(at, own, terms)
                    },)*
                    Kind::Written(_) => (),
                }
            }

            /// [`Effect::basis`] of this effect if the effect needs more than the point; otherwise nothing is added.
            #[inline(always)]
            pub fn dependent_basis<R: Real>(
                self,
                at: &Point<R>,
                own: Own,
                terms: &mut impl Terms<R>,
            ) {
                match self {
                    $(Kind::$type => if !matches!($type::NEEDS, Needs::Point) {
                        $type::basis(at, own, terms)
                    },)*
                    Kind::Written(effect) => effect.basis(at, own, terms),
                }
            }

            /// [`Effect::change`] of this effect.
            pub fn change(self, coefficients: &[f64], body: &mut RigidBody) {
                match self {
                    $(Kind::$type => $type::change(coefficients, body),)*
                    Kind::Written(_) => (),
                }
            }
        }
    };
}

impl PartialEq for Kind {
    fn eq(&self, other: &Kind) -> bool {
        self.describe().id == other.describe().id
    }
}

impl Kind {
    /// The effect `id` of the list in this file or of an effect file that was read. `None` if there is no such effect.
    pub fn from_id(id: &str) -> Option<Kind> {
        let known = Kind::ALL.iter().copied().find(|kind| kind.describe().id == id);
        known.or_else(|| register::find(id).map(Kind::Written))
    }

    /// The definition from the effect file. `None` if this is an effect of the list.
    pub fn written(self) -> Option<&'static Written> {
        match self {
            Kind::Written(effect) => Some(effect),
            _ => None,
        }
    }
}

effects! {
    lift_linear::LiftLinear,
    drag_linear::DragLinear,
    side_force_linear::SideForceLinear,
    roll_linear::RollLinear,
    pitch_linear::PitchLinear,
    yaw_linear::YawLinear,
    rudder_linear::RudderLinear,
    thrust_linear::ThrustLinear,
    propeller::Propeller,
    thrust_table::ThrustTable,
    lift_table::LiftTable,
    drag_table::DragTable,
    pitch_table::PitchTable,
    lift_curve::LiftCurve,
    drag_curve::DragCurve,
    drag_alpha2::DragAlpha2,
    drag_beta2::DragBeta2,
    drag_elevator_abs::DragElevatorAbs,
    lift_stall::LiftStall,
    pitch_break::PitchBreak,
    cg_shift::CgShift,
    unsteady_lift::UnsteadyLift,
    thrust_decay::ThrustDecay,
    throttle_curve::ThrottleCurve,
    thrust_scale::ThrustScale,
    thrust_line_offset::ThrustLineOffset,
    motor_torque::MotorTorque,
    propeller_gyro::PropellerGyro,
    propwash::Propwash,
    aeroelastic_loss::AeroelasticLoss,
    air_density::AirDensity,
    mass_error::MassError,
    inertia_xz::InertiaXz,
    asymmetry::Asymmetry,
    dihedral_alpha::DihedralAlpha,
    roll_control_alpha::RollControlAlpha,
    effectiveness_saturation::EffectivenessSaturation,
    ground_effect::GroundEffect,
    external_load::ExternalLoad,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_and_coefficient_names_are_unique() {
        let mut names: Vec<String> = Kind::ALL
            .iter()
            .map(|k| k.describe())
            .flat_map(|d| d.coefficients.iter().map(move |c| format!("{}.{}", d.id, c.name)))
            .collect();
        let count = names.len();
        names.sort();
        names.dedup();
        assert_eq!(names.len(), count);
        for kind in Kind::ALL {
            assert_eq!(Kind::from_id(kind.describe().id), Some(*kind));
        }
    }
}
