//! Physical effects: each adds one group of forces or moments, in one file of its own.
//!
//! To add one: write its file beside these and name it in the list at the end of this file. It
//! then takes part in the model, its trim and its linearisation, the planner and the parameter
//! files under its id.

use crate::num::{Real, Table};
use crate::physics::{Channel, Point};

/// A coefficient of an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coefficient {
    /// Its name in parameter files.
    pub name: &'static str,
    /// What it is, with its unit.
    pub meaning: &'static str,
    /// The physically possible values.
    pub bounds: (f64, f64),
}

/// Shorthand for the coefficient lists.
pub(crate) const fn coefficient(
    name: &'static str,
    meaning: &'static str,
    bounds: (f64, f64),
) -> Coefficient {
    Coefficient { name, meaning, bounds }
}

/// A physical effect that is linear in its coefficients.
pub trait Effect {
    /// The id of parameter files, JSON and the command line.
    const ID: &'static str;
    /// What it is, in one sentence.
    const DESCRIPTION: &'static str;
    /// The terms added, in textbook letters.
    const FORMULA: &'static str;
    /// Where the formula comes from.
    const SOURCE: &'static str;
    /// The coefficients, in the order of [`basis`](Effect::basis).
    const COEFFICIENTS: &'static [Coefficient];
    /// Name of the ordinate of a table over `alpha_rad` that the effect needs.
    const TABLE: Option<&'static str> = None;

    /// Reports, through `term(index, channel, amount)`, what one unit of the coefficient `index`
    /// contributes to a channel at `at`. Forces in N, moments in N m. `table` is the effect's own
    /// and present exactly if [`TABLE`](Effect::TABLE) is.
    fn basis<R: Real>(at: &Point<R>, table: Option<&Table>, term: impl FnMut(usize, Channel, R));
}

/// What the list knows of an effect.
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
    /// [`Effect::TABLE`].
    pub table: Option<&'static str>,
}

macro_rules! effects {
    ($($module:ident :: $type:ident),* $(,)?) => {
        $(mod $module; pub use $module::$type;)*

        /// One of the effects of the list.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum Kind { $(
            #[doc = concat!("See [`", stringify!($type), "`].")]
            $type,
        )* }

        impl Kind {
            /// Every effect there is.
            pub const ALL: &'static [Kind] = &[$(Kind::$type),*];

            /// What is known of the effect.
            pub const fn describe(self) -> Description {
                match self { $(Kind::$type => Description {
                    id: $type::ID,
                    description: $type::DESCRIPTION,
                    formula: $type::FORMULA,
                    source: $type::SOURCE,
                    coefficients: $type::COEFFICIENTS,
                    table: $type::TABLE,
                },)* }
            }

            /// [`Effect::basis`] of this effect.
            #[inline(always)]
            pub fn basis<R: Real>(
                self,
                at: &Point<R>,
                table: Option<&Table>,
                term: impl FnMut(usize, Channel, R),
            ) {
                match self { $(Kind::$type => $type::basis(at, table, term),)* }
            }
        }
    };
}

impl Kind {
    /// The effect of that id.
    pub fn from_id(id: &str) -> Option<Kind> {
        Kind::ALL.iter().copied().find(|kind| kind.describe().id == id)
    }
}

effects! {
    lift_linear::LiftLinear,
    drag_linear::DragLinear,
    side_force_linear::SideForceLinear,
    roll_linear::RollLinear,
    pitch_linear::PitchLinear,
    yaw_linear::YawLinear,
    thrust_linear::ThrustLinear,
    lift_table::LiftTable,
    drag_table::DragTable,
    drag_alpha2::DragAlpha2,
    drag_beta2::DragBeta2,
    drag_elevator_abs::DragElevatorAbs,
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
