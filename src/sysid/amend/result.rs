//! The result of an amendment, serialised to JSON (`greylag.amend/1`).
//!
//! An amendment re-estimates ("tunes") a model's coefficients from flights and adds effects (physical contributions to forces and
//! moments). Its errors are those of free runs (open-loop simulations) along held-out flights, which are not fitted. The horizon
//! of a free run is its duration.

use serde::Serialize;

use super::conventions::Tried;
use super::flight::SENSORS;
use super::judge::{CLEAR, judged, judged_at, repeated_at};
use crate::compare::{Answer, HorizonScore};
use crate::per_flight::{Constant, PerFlight};

/// The fit counts as worse than the model as given if its held-out error is larger by more than this fraction.
const WORSE: f64 = 0.01;

/// A fitted coefficient with its prior and its uncertainty.
#[derive(Clone, Debug, Serialize)]
pub struct Parameter {
    /// Name, `effect.coefficient`, as in the model file.
    pub name: String,
    /// Meaning of the coefficient, with its unit.
    pub meaning: &'static str,
    /// Whether the coefficient belongs to an added effect.
    pub added: bool,
    /// Value before the fit: the prior mean.
    pub prior: f64,
    /// Prior standard deviation. For an added effect it is the range between the coefficient's bounds, or a fraction of this
    /// range for a curve.
    pub prior_sd: f64,
    /// Estimate, in the coefficient's unit.
    pub value: f64,
    /// Posterior standard deviation of `value`.
    pub sd: f64,
    /// 95 % interval of `value`.
    pub ci95: [f64; 2],
    /// Whether the estimate is at a bound of the physically possible range.
    pub at_bound: bool,
    /// Estimate from each flight alone, by one Gauss–Newton step from the common estimate.
    pub by_flight: Vec<FlightEstimate>,
    /// For a coefficient of an added effect: the model's own coefficient with which it is confounded (error correlation above
    /// 0.9). `None` if there is none.
    pub same_as: Option<String>,
}

/// One flight's estimate of a coefficient.
#[derive(Clone, Debug, Serialize)]
pub struct FlightEstimate {
    /// Name of the flight.
    pub flight: String,
    /// Estimate from this flight and the prior.
    pub value: f64,
    /// Standard deviation of `value`, which includes the information of the prior.
    pub sd: f64,
}

/// Estimated constants of one flight.
#[derive(Clone, Debug, Serialize)]
pub struct FittedFlight {
    /// Name of the flight.
    pub flight: String,
    /// Duration of the data that were used, s.
    pub seconds: f64,
    /// Delay of the recorded actuators, s, and its standard deviation.
    pub actuators_late_s: [f64; 2],
    /// Relative scale error of the airspeed that remains after flight-path reconstruction, and its standard deviation.
    pub airspeed_scale: [f64; 2],
    /// Bias of the angle of attack that remains after flight-path reconstruction, rad, and its standard deviation.
    pub alpha_bias_rad: [f64; 2],
    /// Bias of the sideslip angle that remains after flight-path reconstruction, rad, and its standard deviation.
    pub beta_bias_rad: [f64; 2],
    /// Trims and misalignment angles of the flight; empty unless they were estimated.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub own: Vec<OwnConstant>,
}

/// A trim of one flight (an offset of a coefficient in this flight), or a misalignment angle of its measured axes.
#[derive(Clone, Debug, Serialize)]
pub struct OwnConstant {
    /// Name: one of the misalignment angles `askew_roll`, `askew_pitch`, `askew_yaw` (rad), or one of the trims `CD0`, `CL0`,
    /// `CY0`, `Cl0`, `Cm0`, `Cn0`, `thrust_share` (dimensionless).
    pub name: &'static str,
    /// Prior standard deviation. The prior mean is zero.
    pub prior_sd: f64,
    /// Estimate, in the unit of `name`.
    pub value: f64,
    /// Standard deviation of `value`, including the uncertainty of the model's own coefficient.
    pub sd: f64,
    /// `value` minus the mean over all flights, and the standard deviation of this difference; `None` for a single flight.
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

/// What became of a requested effect.
#[derive(Clone, Debug, Serialize)]
pub struct AddedEffect {
    /// Identifier of the effect.
    pub id: String,
    /// Description of the effect, in one sentence.
    pub description: &'static str,
    /// Whether the effect was added to the amended model.
    pub joined: bool,
    /// Objections to the effect in words, from its fit and from the held-out flights; empty if there are none.
    pub refused: Vec<String>,
    /// Manoeuvre whose data would decide whether the aircraft has this effect; empty if none is known.
    pub fly_next: String,
}

/// Settings of an amendment.
#[derive(Clone, Debug, Serialize)]
pub struct Settings {
    /// Lengths of the short free runs (shots) that are fitted, s.
    pub lengths_s: Vec<f64>,
    /// Horizons of the free runs along held-out flights, s.
    pub horizons_s: Vec<f64>,
    /// Longest horizon at which models are compared, s.
    pub judged_at_s: f64,
    /// Constants that were estimated for each flight, in addition to its sensor errors.
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
    /// The answer: by how much the amendment reduces the error, in a few sentences and as numbers.
    pub answer: Answer,
    /// Sentences on conventions, on refused effects and on an unmodelled rudder.
    pub sentences: Vec<String>,
    /// What became of each requested effect.
    pub effects: Vec<AddedEffect>,
    /// Alternatives to the model's integrator, force axes and air density (conventions) that were tried.
    pub conventions: Vec<Tried>,
    /// All fitted coefficients of the amended model, including those of added effects.
    pub parameters: Vec<Parameter>,
    /// All fitted coefficients of the tuned model without added effects.
    pub tuned: Vec<Parameter>,
    /// Estimated constants of each flight.
    pub flights: Vec<FittedFlight>,
    /// Names of the held-out flights.
    pub held_out: Vec<String>,
    /// Held-out free-run errors of the model as given.
    pub given: Vec<HorizonScore>,
    /// Held-out free-run errors of the tuned model without added effects.
    pub before: Vec<HorizonScore>,
    /// Held-out free-run errors of the amended model.
    pub after: Vec<HorizonScore>,
    /// Mean over the held-out free runs of ln(scaled error of the model as given / scaled error of the fit), and the standard
    /// error of this mean. The horizon is the longest one up to `judged_at_s` that at least two runs reach; `None` if there is no
    /// such horizon. For a fit without a prior it is the longest one up to `judged_at_s` that any run reaches; `None` if only one
    /// run reaches it.
    pub decrease: Option<[f64; 2]>,
    /// Further notes for the user, in sentences.
    pub notes: Vec<String>,
    /// Settings of the amendment.
    pub settings: Settings,
}

impl Amendment {
    /// Sentence that the model as given is kept because the fit predicts the held-out flights worse by more than 1 %; `None` if
    /// it does not.
    pub fn worse(&self) -> Option<String> {
        let (given, after) = (judged(&self.given)?, judged(&self.after)?);
        (after > (1.0 + WORSE) * given || after.is_nan())
            .then(|| self.kept("the fit predicts the flights for validation worse"))
    }

    /// Sentence that the model as given is kept because the fit may be better by chance; `None` if there is no such reason. The
    /// reason applies if only coefficients were tuned and the 95 % interval of `decrease` does not lie entirely above zero.
    pub fn by_chance(&self) -> Option<String> {
        let [mean, error] = self.decrease?;
        // adding zero turns −0 into 0
        let percent = |sd: f64| (100.0 * (1.0 - (-(mean + sd * error)).exp())).round() + 0.0;
        (self.only_tuned() && mean < CLEAR * error).then(|| {
            self.kept(&format!(
                "on the flights for validation the fit may be better by chance (95 % interval of the decrease of the error \
                 over {} s: {} to {} %)",
                repeated_at(&self.given).unwrap_or_default(),
                percent(-CLEAR),
                percent(CLEAR)
            ))
        })
    }

    /// Sentence that the model as given is kept because it is unknown whether the fit is better by chance; `None` if there is no
    /// such reason. The reason applies if only coefficients were tuned and `decrease` is `None`.
    pub fn unjudged(&self) -> Option<String> {
        (self.decrease.is_none() && self.only_tuned()).then(|| {
            self.kept(
                "the flights for validation are too short for two free runs, so the fit may be better by chance; hold out \
                 longer flights, or more of them",
            )
        })
    }

    /// Sentence that the model as given is kept, with the reason `why`, and with the held-out errors if they are known.
    fn kept(&self, why: &str) -> String {
        let errors = judged(&self.given).zip(judged(&self.after)).zip(judged_at(&self.given));
        let errors = errors.map_or(String::new(), |((given, after), seconds)| {
            format!(
                " {given:.5} became {after:.5} of the reference scale in free runs of {seconds} s."
            )
        });
        format!("The model as given is kept: {why}.{errors}")
    }

    /// Whether the fit differs from the model as given in its coefficients only.
    fn only_tuned(&self) -> bool {
        !self.effects.iter().any(|e| e.joined)
            && !self.conventions.iter().any(|c| c.kept)
            && self.settings.per_flight == PerFlight::default()
    }

    /// Whether effects were requested and none of them was added.
    pub fn all_refused(&self) -> bool {
        !self.effects.is_empty() && !self.effects.iter().any(|e| e.joined)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::amend::judge::JUDGED_AT_S;

    /// One score for each entry of `runs`, a horizon (s) and the number of runs that reach it. All have the same `error`.
    fn scores(runs: &[(f64, usize)], error: f64) -> Vec<HorizonScore> {
        let score = |&(horizon_s, runs): &(f64, usize)| HorizonScore {
            horizon_s,
            runs,
            diverged: 0,
            divergence_rate: 0.0,
            rmse_scaled: error,
            states: Vec::new(),
        };
        runs.iter().map(score).collect()
    }

    fn tuned(runs: &[(f64, usize)], decrease: Option<[f64; 2]>) -> Amendment {
        Amendment {
            schema: "greylag.amend/1",
            version: "0",
            model: "a".into(),
            answer: Answer::nothing(),
            sentences: Vec::new(),
            effects: Vec::new(),
            conventions: Vec::new(),
            parameters: Vec::new(),
            tuned: Vec::new(),
            flights: Vec::new(),
            held_out: Vec::new(),
            given: scores(runs, 0.5),
            before: scores(runs, 0.25),
            after: scores(runs, 0.25),
            decrease,
            notes: Vec::new(),
            settings: Settings {
                lengths_s: Vec::new(),
                horizons_s: Vec::new(),
                judged_at_s: JUDGED_AT_S,
                per_flight: PerFlight::default(),
            },
        }
    }

    #[test]
    fn an_improvement_that_too_few_runs_can_judge_keeps_the_model_as_given() {
        // one run reaches 5 s, and two runs reach 2 s
        let runs = [(1.0, 3), (2.0, 2), (5.0, 1), (10.0, 0)];
        let chance = tuned(&runs, Some([0.1, 0.1]));
        assert_eq!((judged_at(&chance.given), repeated_at(&chance.given)), (Some(5.0), Some(2.0)));
        assert_eq!((chance.worse(), chance.unjudged()), (None, None));
        let why = chance.by_chance().unwrap();
        assert!(why.contains("over 2 s: -10 to 26 %"), "{why}");
        assert_eq!(tuned(&runs, Some([0.3, 0.1])).by_chance(), None);
        let alone = tuned(&[(1.0, 1)], None);
        assert_eq!((alone.by_chance(), repeated_at(&alone.given)), (None, None));
        let why = alone.unjudged().unwrap();
        assert!(why.contains("too short") && why.contains("in free runs of 1 s"), "{why}");
        let why = tuned(&[(1.0, 0)], None).unjudged().unwrap();
        assert!(!why.contains("NaN") && !why.contains("became"), "{why}");
        let joined = AddedEffect { joined: true, ..AddedEffect::asked_for("motor_torque") };
        let effects = Amendment { effects: vec![joined], ..tuned(&[(1.0, 1)], None) };
        assert_eq!(effects.unjudged(), None);
    }
}
