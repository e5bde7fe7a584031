//! What a model assumes beside its effects, and no coefficient can make up for.

use serde::Serialize;

use crate::model::{GreyBox, Integrator};
use crate::physics::atmosphere::Density;
use crate::physics::rigid_body::ForceAxes;

/// Least share by which another convention must lower the error of unseen flights: it is no effect of the
/// aircraft, so a little is not enough.
pub(super) const CLEARLY: f64 = 0.1;

/// A convention that a model file states.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Convention {
    /// How the model steps through time.
    Integrator,
    /// Axes in which its aerodynamic forces act.
    ForceAxes,
    /// Its air density; a constant one may give way to the standard atmosphere.
    Density,
}

impl Convention {
    /// All of them.
    pub const ALL: [Convention; 3] =
        [Convention::Integrator, Convention::ForceAxes, Convention::Density];

    /// Its key in a model file, with the table that holds it.
    pub fn key(self) -> &'static [&'static str] {
        match self {
            Convention::Integrator => &["integrator"],
            Convention::ForceAxes => &["force_axes"],
            Convention::Density => &["air", "density"],
        }
    }

    /// What `model` has there, as its file says it; "constant" for a density of its own.
    pub fn of(self, model: &GreyBox) -> &'static str {
        match self {
            Convention::Integrator => match model.integrator {
                Integrator::Rk4 => "rk4",
                Integrator::Jsbsim => "jsbsim",
            },
            Convention::ForceAxes => match model.axes {
                ForceAxes::Stability => "stability",
                ForceAxes::Wind => "wind",
            },
            Convention::Density => match model.atmosphere.density {
                Density::Constant(_) => "constant",
                Density::Standard => "standard",
            },
        }
    }

    /// `model` with the other one; `None` if there is none to try.
    pub(super) fn other(self, model: &GreyBox) -> Option<GreyBox> {
        let mut other = model.clone();
        match self {
            Convention::Integrator => {
                other.integrator = match model.integrator {
                    Integrator::Rk4 => Integrator::Jsbsim,
                    Integrator::Jsbsim => Integrator::Rk4,
                };
            }
            Convention::ForceAxes => {
                other.axes = match model.axes {
                    ForceAxes::Stability => ForceAxes::Wind,
                    ForceAxes::Wind => ForceAxes::Stability,
                };
            }
            Convention::Density if model.atmosphere.density == Density::Standard => return None,
            Convention::Density => other.atmosphere.density = Density::Standard,
        }
        Some(other)
    }
}

/// A convention that was tried.
#[derive(Clone, Debug, Serialize)]
pub struct Tried {
    /// Which.
    pub convention: Convention,
    /// What the model had, as its file says it.
    pub from: &'static str,
    /// What was tried in its place.
    pub to: &'static str,
    /// Error of unseen flights at the horizon of judgement before and with it, all coefficients refitted;
    /// NaN where no run gets there or the fit fails.
    pub error: [f64; 2],
    /// Whether the amended model has it.
    pub kept: bool,
}
