//! The result of an amendment, serialized to JSON (`greylag.amend/1`).

use serde::Serialize;

use super::conventions::Tried;
use super::flight::SENSORS;
use super::judge::{CLEAR, judged, judged_at};
use crate::compare::{Answer, HorizonScore};
use crate::per_flight::{Constant, PerFlight};

/// Relative rise of the held-out error above which the fit is worse than the model as given.
const WORSE: f64 = 0.01;

/// A fitted coefficient with its prior and its uncertainty.
#[derive(Clone, Debug, Serialize)]
pub struct Parameter {
    /// Name, `effect.coefficient`, as in the model file.
    pub name: String,
    /// Meaning, with its unit.
    pub meaning: &'static str,
    /// Whether it belongs to an added effect.
    pub added: bool,
    /// Value before the fit.
    pub prior: f64,
    /// Prior standard deviation; for an added effect, the width of its bounds.
    pub prior_sd: f64,
    /// Estimate, in the coefficient's unit.
    pub value: f64,
    /// Posterior standard deviation of `value`.
    pub sd: f64,
    /// 95 % interval of `value`.
    pub ci95: [f64; 2],
    /// Whether the estimate is at a bound of what is physically possible.
    pub at_bound: bool,
    /// Estimates of each flight alone, to first order.
    pub by_flight: Vec<FlightEstimate>,
    /// Coefficient of the model with which this coefficient of an added effect is confounded (error correlation above
    /// 0.9); `None` if there is none.
    pub same_as: Option<String>,
}

/// One flight's estimate of a coefficient.
#[derive(Clone, Debug, Serialize)]
pub struct FlightEstimate {
    /// Name of the flight.
    pub flight: String,
    /// Estimate from this flight and the prior.
    pub value: f64,
    /// Standard deviation of `value`, the prior included.
    pub sd: f64,
}

/// Estimated constants of one flight.
#[derive(Clone, Debug, Serialize)]
pub struct FittedFlight {
    /// Name of the flight.
    pub flight: String,
    /// Duration of the data used, s.
    pub seconds: f64,
    /// Delay of the recorded actuators, s, and its standard deviation.
    pub actuators_late_s: [f64; 2],
    /// Remaining scale error of its airspeed (relative), and its standard deviation.
    pub airspeed_scale: [f64; 2],
    /// Remaining bias of the angle-of-attack vane, rad, and its standard deviation.
    pub alpha_bias_rad: [f64; 2],
    /// Remaining bias of the sideslip vane, rad, and its standard deviation.
    pub beta_bias_rad: [f64; 2],
    /// Its trims and misalignment angles, where they were estimated.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub own: Vec<OwnConstant>,
}

/// A trim of one flight, or a misalignment angle of its measured axes.
#[derive(Clone, Debug, Serialize)]
pub struct OwnConstant {
    /// `askew_roll`, `askew_pitch`, `askew_yaw` (rad), or one of the trims `CD0`, `CL0`, `CY0`, `Cl0`, `Cm0`, `Cn0`,
    /// `thrust_share` (dimensionless), which are added to the model's coefficients in this flight.
    pub name: &'static str,
    /// Prior standard deviation, about zero.
    pub prior_sd: f64,
    /// Estimate, in the unit of `name`.
    pub value: f64,
    /// Standard deviation of `value`, the uncertainty of the model's own coefficient included.
    pub sd: f64,
    /// Estimate less the mean of all flights, and its standard deviation; `None` for a single flight.
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

/// The outcome for a requested effect.
#[derive(Clone, Debug, Serialize)]
pub struct AddedEffect {
    /// Identifier of the effect.
    pub id: String,
    /// Description of the effect, in one sentence.
    pub description: &'static str,
    /// Whether it joined the amended model.
    pub joined: bool,
    /// Reasons to reject it, from its estimates and the held-out flights; empty if there are none.
    pub refused: Vec<String>,
    /// Manoeuvre that would let the data decide.
    pub fly_next: String,
}

/// Settings of an amendment.
#[derive(Clone, Debug, Serialize)]
pub struct Settings {
    /// Lengths of shots, s.
    pub lengths_s: Vec<f64>,
    /// Horizons of the free runs, s.
    pub horizons_s: Vec<f64>,
    /// Horizon at which improvement is judged, s.
    pub judged_at_s: f64,
    /// Constants estimated for each flight.
    #[serde(flatten)]
    pub per_flight: PerFlight,
}

/// The result of an amendment.
#[derive(Clone, Debug, Serialize)]
pub struct Amendment {
    /// Schema of the document, `greylag.amend/1`.
    pub schema: &'static str,
    /// Version of the program.
    pub version: &'static str,
    /// Name of the model as given.
    pub model: String,
    /// Answer in sentences, with the numbers of these sentences.
    pub answer: Answer,
    /// Sentences on conventions, on refused effects and on an unmodelled rudder.
    pub sentences: Vec<String>,
    /// Outcome for each requested effect.
    pub effects: Vec<AddedEffect>,
    /// Conventions that were tried.
    pub conventions: Vec<Tried>,
    /// All free coefficients of the final model, those of effects included.
    pub parameters: Vec<Parameter>,
    /// Coefficients of the model tuned without effects.
    pub tuned: Vec<Parameter>,
    /// Estimated constants of each flight.
    pub flights: Vec<FittedFlight>,
    /// Names of the held-out flights.
    pub held_out: Vec<String>,
    /// Held-out free-run errors of the model as given.
    pub given: Vec<HorizonScore>,
    /// Held-out free-run errors with its coefficients tuned.
    pub before: Vec<HorizonScore>,
    /// Held-out free-run errors with the effects added.
    pub after: Vec<HorizonScore>,
    /// Mean of ln(scaled error of the model as given / scaled error of the fit), paired over the free runs of the held-out flights,
    /// and its standard error; `None` if fewer than two runs reach a horizon.
    pub decrease: Option<[f64; 2]>,
    /// Further notes for the reader.
    pub notes: Vec<String>,
    /// Settings of the amendment.
    pub settings: Settings,
}

impl Amendment {
    /// Sentence that the given model is kept because the fit predicts the validation flights worse; `None` if it does
    /// not.
    pub fn worse(&self) -> Option<String> {
        let (given, after) = (judged(&self.given)?, judged(&self.after)?);
        (after > (1.0 + WORSE) * given || after.is_nan())
            .then(|| self.kept("the fit predicts the flights for validation worse"))
    }

    /// Sentence that the given model is kept because only its coefficients were tuned and the 95 % interval of
    /// `decrease` includes zero; `None` otherwise.
    pub fn by_chance(&self) -> Option<String> {
        let [mean, error] = self.decrease?;
        // plus zero: no −0
        let percent = |sd: f64| (100.0 * (1.0 - (-(mean + sd * error)).exp())).round() + 0.0;
        (self.only_tuned() && mean < CLEAR * error).then(|| {
            self.kept(&format!(
                "on the flights for validation the fit may be better by chance (95 % interval of the decrease of the error: \
                 {} to {} %)",
                percent(-CLEAR),
                percent(CLEAR)
            ))
        })
    }

    /// Sentence that the given model is kept, with the reason `why` and the errors.
    fn kept(&self, why: &str) -> String {
        let error = |scores| judged(scores).unwrap_or(f64::NAN);
        format!(
            "The model as given is kept: {why}. {:.5} became {:.5} of the reference scale in free runs of {} s.",
            error(&self.given),
            error(&self.after),
            judged_at(&self.given).unwrap_or_default()
        )
    }

    /// Whether the fit differs from the model as given in its coefficients only.
    fn only_tuned(&self) -> bool {
        !self.effects.iter().any(|e| e.joined)
            && !self.conventions.iter().any(|c| c.kept)
            && self.settings.per_flight == PerFlight::default()
    }

    /// Whether effects were requested and none of them joined.
    pub fn all_refused(&self) -> bool {
        !self.effects.is_empty() && !self.effects.iter().any(|e| e.joined)
    }
}
