//! Modelling conventions: integrator, force axes and air density. No coefficient can compensate for a wrong convention.
//!
//! A convention is replaced by its alternative if the flights support this. The evidence comes from the fitted flights and
//! from held-out flights, which no fit uses. In a free run the model is simulated with the recorded controls.

use serde::Serialize;

use super::normal::Weights;
use super::output_error::{Fit, Left};
use greylag_model::{GreyBox, Integrator};
use greylag_physics::atmosphere::Density;
use greylag_physics::rigid_body::ForceAxes;

/// Two fits differ significantly if the difference of their costs exceeds this number of standard errors (two-sided 95 %,
/// Vuong 1989).
const CLEARLY: f64 = 1.96;
/// Relative change of the held-out error that counts as large.
const MUCH: f64 = 0.1;

/// Number of standard errors by which `other` fits the shots better than `fit`. Shots are the short free runs of the
/// output-error fit.
///
/// The number is the mean decrease of the shots' costs divided by its standard error (Vuong 1989). The total decrease is
/// first reduced by 2 for each additional coefficient (Akaike). Each fit has estimated weights, which favour this fit. The
/// cost of a shot is therefore the mean of its costs with the weights of `fit` and with those of `other`. The result is zero
/// if the fits have fewer than three shots in common.
pub(super) fn closer(fit: &Fit, other: &Fit) -> f64 {
    let cost = |left: &Left| -> f64 {
        let weigh = |squares: &[f64; 8], weights: &[f64; 8]| -> f64 {
            squares.iter().zip(weights).map(|(x, w)| x * w).sum()
        };
        let by = |w: &Weights| weigh(&left.output, &w.output) + weigh(&left.start, &w.start);
        0.5 * (by(&fit.weights) + by(&other.weights))
    };
    let fall = |a: &Left| {
        let b = other.left.iter().find(|b| b.shot == a.shot)?;
        Some(cost(a) - cost(b))
    };
    let falls: Vec<f64> = fit.left.iter().filter_map(fall).collect();
    let count = falls.len() as f64;
    let mean = falls.iter().sum::<f64>() / count;
    let more = other.parameters.len() as f64 - fit.parameters.len() as f64;
    let scatter = falls.iter().map(|f| (f - mean).powi(2)).sum::<f64>() / (count - 1.0);
    if falls.len() < 3 || scatter == 0.0 {
        0.0
    } else {
        (mean - 2.0 * more / count) / (scatter / count).sqrt()
    }
}

/// A convention that a model file states.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Convention {
    /// Integrator of the equations of motion.
    Integrator,
    /// Axes of the aerodynamic forces: stability or wind axes.
    ForceAxes,
    /// Air density; the standard atmosphere is the alternative to a constant density.
    Density,
}

impl Convention {
    /// All conventions, in the order in which they are tried.
    pub const ALL: [Convention; 3] =
        [Convention::Integrator, Convention::ForceAxes, Convention::Density];

    /// Keys of the convention in a model file, from the outer table to the value.
    pub fn key(self) -> &'static [&'static str] {
        match self {
            Convention::Integrator => &["integrator"],
            Convention::ForceAxes => &["force_axes"],
            Convention::Density => &["air", "density"],
        }
    }

    /// The convention of `model`, spelled as in a model file. For a constant air density the result is "constant".
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

    /// Whether the alternative is adopted. `closer` is the number of standard errors by which the alternative fits the
    /// shots better. `error` holds the errors on held-out flights without and with the alternative.
    ///
    /// An alternative integrator or alternative axes need positive evidence, because both are choices of the model's author.
    /// Real air density decreases with height. The standard atmosphere is therefore adopted unless the data contradict it.
    pub(super) fn is_borne_out(self, closer: f64, error: [f64; 2]) -> bool {
        let fall = 1.0 - error[1] / error[0];
        match self {
            Convention::Integrator | Convention::ForceAxes => {
                (closer > 0.0 && fall > MUCH) || (closer > CLEARLY && fall > 0.0)
            }
            Convention::Density => closer > -CLEARLY && fall > -MUCH,
        }
    }

    /// `model` with the alternative convention; `None` if the convention has no alternative.
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

/// An alternative convention that was tried, with the evidence for or against it.
#[derive(Clone, Debug, Serialize)]
pub struct Tried {
    /// The convention that was changed.
    pub convention: Convention,
    /// The convention of the given model, spelled as in a model file.
    pub from: &'static str,
    /// The alternative, spelled as in a model file.
    pub to: &'static str,
    /// Held-out free-run errors without and with the alternative, at the longest horizon up to 5 s that a run reaches, after a
    /// refit of all coefficients. NaN if there is no such horizon or the fit fails.
    pub error: [f64; 2],
    /// Number of standard errors by which the alternative fits the shots better; NaN if the fit fails.
    pub closer: f64,
    /// Whether the amended model adopts the alternative.
    pub kept: bool,
}
