//! What a model assumes beside its effects, and no coefficient can make up for.

use serde::Serialize;

use super::normal::Weights;
use super::output_error::{Fit, Left};
use greylag_model::{GreyBox, Integrator};
use greylag_physics::atmosphere::Density;
use greylag_physics::rigid_body::ForceAxes;

/// Standard errors of the difference between two fits that are clear (two-sided 95 %, as Vuong has it).
const CLEARLY: f64 = 1.96;
/// Share of the error of unseen flights that is much.
const MUCH: f64 = 0.1;

/// By how many standard errors `other` follows the shots more closely than `fit`: the mean difference of the shots'
/// costs, two (Akaike's) off for each coefficient more, over the scatter of these differences (Vuong 1989). Each
/// fit's weights suit itself, so the costs are means by both. Zero if fewer than three shots are in both.
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

    /// Whether the other one is taken if the fit's own flights are followed `closer` by so many standard errors
    /// with it, and the error of unseen flights goes from the first of `error` to the second. Steps and axes are the
    /// simulator's or the author's choice, which the flights must bear out; air does thin with height, which they
    /// must not deny.
    pub(super) fn is_borne_out(self, closer: f64, error: [f64; 2]) -> bool {
        let fall = 1.0 - error[1] / error[0];
        match self {
            Convention::Integrator | Convention::ForceAxes => {
                (closer > 0.0 && fall > MUCH) || (closer > CLEARLY && fall > 0.0)
            }
            Convention::Density => closer > -CLEARLY && fall > -MUCH,
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
    /// Standard errors by which the fit follows its own flights more closely; NaN where it fails.
    pub closer: f64,
    /// Whether the amended model has it.
    pub kept: bool,
}
