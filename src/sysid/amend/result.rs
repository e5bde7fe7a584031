//! What an amendment says, as it goes into JSON (`greylag.amend/1`).

use serde::Serialize;

use super::conventions::Tried;
use super::flight::SENSORS;
use crate::compare::HorizonScore;
use crate::per_flight::{Constant, PerFlight};

/// A fitted coefficient.
#[derive(Clone, Debug, Serialize)]
pub struct Parameter {
    /// `effect.coefficient`, as in the model file.
    pub name: String,
    /// What it is, with its unit.
    pub meaning: &'static str,
    /// Whether it belongs to an effect that was added.
    pub added: bool,
    /// Value before the fit.
    pub prior: f64,
    /// Its standard deviation as a prior; for an added effect, the width of its bounds.
    pub prior_sd: f64,
    /// The fitted value.
    pub value: f64,
    /// Its standard deviation.
    pub sd: f64,
    /// Its 95 % interval.
    pub ci95: [f64; 2],
    /// Whether it stands at a bound of what is physically possible.
    pub at_bound: bool,
    /// What each flight alone says of it, to first order.
    pub by_flight: Vec<FlightEstimate>,
    /// The coefficient of the model itself that says nearly the same as this one of an added effect (errors
    /// correlated beyond 0.9), if there is one.
    pub same_as: Option<String>,
}

/// One flight's say on a coefficient.
#[derive(Clone, Debug, Serialize)]
pub struct FlightEstimate {
    /// The flight.
    pub flight: String,
    /// The value.
    pub value: f64,
    /// Its standard deviation, the prior's included.
    pub sd: f64,
}

/// What was found of one flight's sensors.
#[derive(Clone, Debug, Serialize)]
pub struct FittedFlight {
    /// The flight.
    pub flight: String,
    /// Seconds used.
    pub seconds: f64,
    /// How late its actuators are recorded, s, with standard deviation.
    pub actuators_late_s: [f64; 2],
    /// What was left of its airspeed's scale, a share, with standard deviation.
    pub airspeed_scale: [f64; 2],
    /// Likewise the angle-of-attack vane's bias, rad.
    pub alpha_bias_rad: [f64; 2],
    /// Likewise the sideslip vane's bias, rad.
    pub beta_bias_rad: [f64; 2],
    /// What it has of its own beside them, where that was asked for.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub own: Vec<OwnConstant>,
}

/// A trim of one flight, or an angle by which its measured axes are turned.
#[derive(Clone, Debug, Serialize)]
pub struct OwnConstant {
    /// `askew_roll`, `askew_pitch`, `askew_yaw` (rad), or one of the trims `CD0`, `CL0`, `CY0`, `Cl0`, `Cm0`, `Cn0`,
    /// `thrust_share` (dimensionless), which are added to the model's coefficients in this flight.
    pub name: &'static str,
    /// Its standard deviation as a prior, about zero.
    pub prior_sd: f64,
    /// Its value.
    pub value: f64,
    /// Its standard deviation, what is not sure of the model's coefficient included.
    pub sd: f64,
    /// The same less the mean of all flights, with its standard deviation; `None` of a single flight.
    pub beside_mean: Option<[f64; 2]>,
}

impl OwnConstant {
    pub(super) fn new(
        constant: &Constant,
        value: f64,
        sd: f64,
        beside_mean: Option<[f64; 2]>,
    ) -> OwnConstant {
        OwnConstant { name: constant.name, prior_sd: constant.width, value, sd, beside_mean }
    }
}

impl FittedFlight {
    pub(super) fn new(flight: &str, seconds: f64, x: &[f64; SENSORS], sd: &[f64]) -> FittedFlight {
        FittedFlight {
            flight: flight.into(),
            seconds,
            actuators_late_s: [x[0], sd[0]],
            airspeed_scale: [x[1], sd[1]],
            alpha_bias_rad: [x[5], sd[5]],
            beta_bias_rad: [x[6], sd[6]],
            own: Vec::new(),
        }
    }
}

/// An effect that was asked for.
#[derive(Clone, Debug, Serialize)]
pub struct AddedEffect {
    /// Its id.
    pub id: String,
    /// What it is, in one sentence.
    pub description: &'static str,
    /// Whether the amended model has it.
    pub joined: bool,
    /// Why the data refuse it; empty if they do not.
    pub refused: Vec<String>,
    /// What to fly so that the data decide.
    pub fly_next: String,
}

/// What an amendment was asked for.
#[derive(Clone, Debug, Serialize)]
pub struct Settings {
    /// Lengths of shots, s.
    pub lengths_s: Vec<f64>,
    /// Horizons of the free runs, s.
    pub horizons_s: Vec<f64>,
    /// Horizon at which improvement is judged, s.
    pub judged_at_s: f64,
    /// What each flight had of its own.
    #[serde(flatten)]
    pub per_flight: PerFlight,
}

/// An amended model's story.
#[derive(Clone, Debug, Serialize)]
pub struct Amendment {
    /// `greylag.amend/1`.
    pub schema: &'static str,
    /// Version of the program.
    pub version: &'static str,
    /// Name of the model before.
    pub model: String,
    /// The story in plain sentences.
    pub sentences: Vec<String>,
    /// The effects that were asked for.
    pub effects: Vec<AddedEffect>,
    /// The conventions that were tried.
    pub conventions: Vec<Tried>,
    /// Every coefficient that was free, with the effects.
    pub parameters: Vec<Parameter>,
    /// The prior's coefficients when tuned without the effects.
    pub tuned: Vec<Parameter>,
    /// What was found of the flights' sensors.
    pub flights: Vec<FittedFlight>,
    /// Names of the flights that the fit never saw.
    pub held_out: Vec<String>,
    /// Free-run errors on them: of the model as given,
    pub given: Vec<HorizonScore>,
    /// with its coefficients tuned,
    pub before: Vec<HorizonScore>,
    /// with the effects.
    pub after: Vec<HorizonScore>,
    /// What the reader must know besides.
    pub notes: Vec<String>,
    /// What was asked for.
    pub settings: Settings,
}

impl Amendment {
    /// Whether effects were asked for and none of them joined the model.
    pub fn all_refused(&self) -> bool {
        !self.effects.is_empty() && !self.effects.iter().any(|e| e.joined)
    }
}
