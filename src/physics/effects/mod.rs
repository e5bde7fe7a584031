//! Physical effects: each adds one group of forces or moments, in one file of its own.
//!
//! To add one: write its file beside these and name it in the list at the end of this file. It
//! then takes part in the model, its trim and its linearisation, the planner, the parameter
//! files, the search for missing effects and the report under its id. Effects on what the surfaces
//! do with their commands are in [`inputs`](crate::inputs).

use crate::formula::{Written, register};
use crate::rigid_body::RigidBody;
use crate::{Channel, Point};
use greylag_num::{Grid, Real, Table};

/// A coefficient of an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coefficient {
    /// Its name in parameter files.
    pub name: &'static str,
    /// What it is.
    pub meaning: &'static str,
    /// Its unit; empty for a number without one.
    pub unit: &'static str,
    /// The physically possible values.
    pub bounds: (f64, f64),
    /// Whether `bounds` are those of an aircraft of up to 25 kg and grow with a larger one; see
    /// [`Size`](crate::size::Size).
    pub grows: bool,
}

/// Shorthand for the coefficient lists.
pub const fn coefficient(
    name: &'static str,
    meaning: &'static str,
    unit: &'static str,
    bounds: (f64, f64),
) -> Coefficient {
    Coefficient { name, meaning, unit, bounds, grows: true }
}

impl Coefficient {
    /// The same with bounds that do not grow with the aircraft.
    pub(crate) const fn of_any_size(self) -> Coefficient {
        Coefficient { grows: false, ..self }
    }
}

/// Channels of the forces and moments that the air makes: all but thrust.
const AERODYNAMIC: [Channel; 6] =
    [Channel::Drag, Channel::Lift, Channel::Side, Channel::Roll, Channel::Pitch, Channel::Yaw];

/// What an effect needs besides the point itself.
///
/// Effects that need more are evaluated after those that need only the point, and see what those make.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Needs {
    /// The state, the controls and the airflow.
    Point,
    /// Also [`Point::base`]: the forces and moments of the effects that need only the point.
    Base,
    /// Also [`Base::deflected`](crate::point::Base::deflected) and
    /// [`Base::still`](crate::point::Base::still).
    Parts,
    /// Also [`Base::rate`](crate::point::Base::rate).
    Rate,
}

/// What belongs to one effect of one model.
#[derive(Clone, Copy, Debug, Default)]
pub struct Own<'a> {
    /// Its table; present exactly if [`Effect::TABLE`] is.
    pub table: Option<&'a Table>,
    /// Its grid; present exactly if [`Effect::GRID`] is.
    pub grid: Option<&'a Grid>,
    /// The values of its shape constants: the last [`Effect::SHAPE`] coefficients.
    pub shape: &'a [f64],
    /// Place of its first lag among those of the model, [`Controls::lagged`](crate::Controls::lagged).
    pub first_lag: usize,
}

/// What the search for missing effects knows of one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// Channels in which it acts; empty for an effect on the deflections, which acts wherever they do.
    /// A changed mass or inertia acts as if it were a force or moment in these.
    pub channels: &'static [Channel],
    /// What it is easily mistaken for: ids of effects, full names (`effect.coefficient`) of a prior's
    /// coefficients, or a sensor's error in words.
    pub look_alikes: &'static [&'static str],
    /// The manoeuvre that tells it from them, in words.
    pub separated_by: &'static str,
    /// Values of all coefficients at which the effect is plain to see on an aircraft like the X8; empty
    /// for errors of the measurement.
    pub example: &'static [f64],
    /// Values of all coefficients at which a search over shape constants starts; empty for an effect
    /// that is linear in all of them, or whose constants must be known beforehand.
    pub starts: &'static [&'static [f64]],
}

/// What takes the terms that an effect reports.
///
/// A trait rather than a closure, because its one method can be made to be inlined: a planner's
/// vector instructions end where a call begins.
pub trait Terms<R> {
    /// What one unit of the effect's coefficient `index` contributes to `channel`, N or N m.
    fn add(&mut self, index: usize, channel: Channel, amount: R);
}

/// A physical effect that is linear in its coefficients, but for shape constants.
pub trait Effect {
    /// The id of parameter files, JSON and the command line.
    const ID: &'static str;
    /// What it is, in one sentence.
    const DESCRIPTION: &'static str;
    /// The terms added, in textbook letters.
    const FORMULA: &'static str;
    /// Where the formula comes from.
    const SOURCE: &'static str;
    /// The coefficients, in the order of [`basis`](Effect::basis), then the shape constants.
    const COEFFICIENTS: &'static [Coefficient];
    /// How many of the coefficients, at the end of the list, are constants in which the effect is not
    /// linear.
    const SHAPE: usize = 0;
    /// Name of the ordinate of a table over `alpha_rad` that the effect needs.
    const TABLE: Option<&'static str> = None;
    /// Name of the ordinate of a grid over `throttle` and `airspeed_mps` that the effect needs.
    const GRID: Option<&'static str> = None;
    /// What it needs.
    const NEEDS: Needs = Needs::Point;
    /// Full names of coefficients in whose place it stands: they are zero in a model that it joins.
    const REPLACES: &'static [&'static str] = &[];
    /// Its entry in the catalogue of effects that a model may lack; `None` for parts of a prior.
    const ENTRY: Option<Entry> = None;

    /// Reports to `terms` what one unit of each coefficient contributes to each channel at `at`.
    fn basis<R: Real>(at: &Point<R>, own: Own, terms: &mut impl Terms<R>);

    /// Changes the rigid body by the effect's coefficients.
    fn change(_coefficients: &[f64], _body: &mut RigidBody) {}
}

/// What is known of an effect.
#[derive(Clone, Copy, Debug)]
pub struct Description {
    /// [`Effect::ID`].
    pub id: &'static str,
    /// [`Effect::DESCRIPTION`].
    pub description: &'static str,
    /// [`Effect::FORMULA`].
    pub formula: &'static str,
    /// [`Effect::SOURCE`].
    pub source: &'static str,
    /// [`Effect::COEFFICIENTS`].
    pub coefficients: &'static [Coefficient],
    /// How many coefficients at the end of the list are shape constants.
    pub shape: usize,
    /// [`Effect::TABLE`].
    pub table: Option<&'static str>,
    /// [`Effect::GRID`].
    pub grid: Option<&'static str>,
    /// [`Effect::REPLACES`].
    pub replaces: &'static [&'static str],
    /// [`Effect::ENTRY`].
    pub entry: Option<Entry>,
}

mod curve;

macro_rules! effects {
    ($($module:ident :: $type:ident),* $(,)?) => {
        $(mod $module; pub use $module::$type;)*

        /// One of the effects of the list.
        #[derive(Clone, Copy, Debug)]
        pub enum Kind { $(
            #[doc = concat!("See [`", stringify!($type), "`].")]
            $type,
        )*
            /// An effect of a file.
            Written(&'static Written),
        }

        impl Kind {
            /// Every effect of the catalogue; those of files are not among them.
            pub const ALL: &'static [Kind] = &[$(Kind::$type),*];

            /// What is known of the effect.
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

            /// [`Effect::basis`] of this effect if it needs only the point; else nothing. A sum over
            /// such effects then holds no code of the others, which is half the time of a planner.
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

            /// [`Effect::basis`] of this effect if it needs more than the point; else nothing.
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
    /// The effect of that id: of the catalogue, or of a file that was read.
    pub fn from_id(id: &str) -> Option<Kind> {
        let known = Kind::ALL.iter().copied().find(|kind| kind.describe().id == id);
        known.or_else(|| register::find(id).map(Kind::Written))
    }

    /// The effect of a file, if it is one.
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
