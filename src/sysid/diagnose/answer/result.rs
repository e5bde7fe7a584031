//! The result of a diagnosis, serialised to JSON (`greylag.diagnosis/1`). A diagnosis compares a model with flights and finds
//! effects (physical contributions to forces and moments) that the model lacks. A candidate is an effect that the model may lack.
//! The catalogue has the effects that the program knows. In each round of the search the model is linearised and the candidates
//! are ranked. An effect is asserted if the diagnosis states that the model lacks it.

use serde::Serialize;

use super::probability::Explanation;
use super::shares;
use crate::compare::answer::{Acting, Compared};
use crate::per_flight::PerFlight;

/// Overall verdict on the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// At least one effect is asserted.
    Effect,
    /// The re-estimated model explains the flights without further effects.
    Adequate,
    /// Something is missing, but no effect of the catalogue explains it.
    Unexplained,
    /// The flights allow no verdict. There are four possible reasons: an estimate is physically impossible, sensor errors may
    /// account for the residual in every channel, no error of the given model is certain, or a flexible model of the states
    /// removes little of the residual.
    Unknown,
}

/// The result of a diagnosis of one model over one or several flights.
///
/// Read `verdict` first, then `doubtful`. If `doubtful` is not empty, estimates from the flights are physically
/// impossible, `verdict` is [`Verdict::Unknown`], and no effect is asserted. Then read `effects`: its `asserted`
/// entries come first, in the order of selection. `sentences` state the same results in words.
///
/// Some parts depend on the options. `trims`, and the misalignment angles in `measurement`, exist only if constants of each
/// flight were estimated. `decoys` and the candidates' curves exist only with
/// [`Detail::Full`](crate::diagnose::Detail::Full).
///
/// Values are in SI units unless a `unit` is given. The channels D, L, Y are forces (N); l, m, n are moments (N m). Their
/// residuals are measured minus predicted values, averaged over windows (short stretches of flight). A number that does not
/// exist is NaN, `null` in JSON. Flights are named after their file. Equal inputs, options and versions give equal results,
/// because `settings.seed` determines all random draws.
#[derive(Clone, Debug, Serialize)]
pub struct Diagnosis {
    /// Schema of the document, `greylag.diagnosis/1`.
    pub schema: &'static str,
    /// Version of the program.
    pub version: &'static str,
    /// Name of the model.
    pub model: String,
    /// Overall verdict on the model.
    pub verdict: Verdict,
    /// The result in plain sentences, the most important first.
    pub sentences: Vec<String>,
    /// Physically impossible estimates, in words. If there are any, forces and moments are not assessed.
    pub doubtful: Vec<String>,
    /// Every candidate: the asserted ones first, in the order of their selection, then the others by evidence.
    pub effects: Vec<Candidate>,
    /// Probabilities of what the model lacks above all, the largest first; their sum is 1. They concern the first entry of
    /// `effects`. Empty if the verdict is [`Verdict::Unknown`].
    pub explanations: Vec<Explanation>,
    /// What the re-estimated model leaves unexplained in each channel, without and with the asserted effects.
    pub channels: Vec<ChannelLeft>,
    /// Sensor errors and wind of each flight, estimated from kinematics alone. If requested, also misalignment angles of the
    /// sensor axes (`axes_askew`), estimated together with the aerodynamics.
    pub measurement: Vec<Measurement>,
    /// Trims of each flight, where they were estimated.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub trims: Vec<FlightTrim>,
    /// The model's own coefficients, re-estimated with the asserted effects in the model.
    pub tuned: Vec<Tuned>,
    /// Advice on the next flight, the most useful first.
    pub advice: Vec<Advice>,
    /// Evidence in bootstrap draws under the null hypothesis that no effect is missing. It determines the critical values.
    pub nulls: Nulls,
    /// Placebo regressors (decoys), which check for false detections.
    pub decoys: Vec<Decoy>,
    /// Share of the residual variance, without that of noise, that a flexible model still removes after the asserted effects.
    /// The flexible model is fitted to other flights than those on which the share is computed.
    pub learnable_remainder: f64,
    /// Further notes for the reader.
    pub notes: Vec<String>,
    /// Settings of the diagnosis.
    pub settings: Settings,
}

impl Diagnosis {
    /// The unexplained shares of the re-estimated model, without and with the asserted effects.
    pub fn compared(&self) -> Compared {
        shares::compared(&self.channels)
    }
}

/// A candidate effect with its evidence.
#[derive(Clone, Debug, Serialize)]
pub struct Candidate {
    /// Identifier in the catalogue.
    pub id: String,
    /// Description of the effect, in one sentence.
    pub description: &'static str,
    /// Whether the diagnosis asserts that the model lacks the effect.
    pub asserted: bool,
    /// Classification of the candidate.
    pub status: Status,
    /// Evidence: the smaller of the penalised likelihood gain and the block-robust Wald statistic. Effects are selected one per
    /// round. The evidence is that of the round in which the effect was selected, otherwise that of the last round.
    pub evidence: f64,
    /// Critical value of the evidence, from bootstrap draws under the null hypothesis that no effect is missing.
    pub threshold: f64,
    /// Parameters of the effect, fitted together with the model's own coefficients.
    pub parameters: Vec<Parameter>,
    /// Channels (D, L, Y, l, m, n) whose residual the effect reduces, the largest reduction first.
    pub channels: Vec<String>,
    /// The one or two channels in which the unexplained share falls most with the asserted effects, if this effect is one of them:
    /// its shares without and with all of them. Empty for other candidates.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub acts: Vec<Acting>,
    /// Ids of effects that these data cannot distinguish from this effect.
    pub indistinguishable_from: Vec<String>,
    /// Share of the residual variance, without that of noise, that the effect removes in blocks (stretches of about 4 s) that
    /// its fit did not use. NaN if not computed.
    pub heldout_error_reduction: f64,
    /// Share of block bootstraps in which the effect, or one that cannot be distinguished from it, ranks first. NaN if not
    /// computed.
    pub selected_in_bootstraps: f64,
    /// Estimate of the first parameter from each flight alone.
    pub by_flight: Vec<FlightEstimate>,
    /// Smallest value of the first parameter, in its unit, at which these flights would have shown the effect; `None` if there
    /// is no such value.
    pub minimum_detectable: Option<f64>,
    /// Reasons not to assert the effect although its evidence exceeds the critical value.
    pub refused: Vec<String>,
    /// The effect's contribution as a function of the flight variable that explains most of its variance. `None` for candidates
    /// that rank low, and with [`Detail::Lean`](crate::diagnose::Detail::Lean).
    pub curve: Option<Curve>,
}

/// Classification of a candidate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// The model lacks this effect.
    Missing,
    /// The model lacks this effect, or another effect that these flights cannot distinguish from it.
    Indistinguishable,
    /// The effect is significant but too small to matter in these flights.
    Small,
    /// The evidence exceeds the critical value, but a further check failed.
    Refused,
    /// The evidence is below the critical value.
    NotShown,
}

/// A fitted parameter of a candidate.
#[derive(Clone, Debug, Serialize)]
pub struct Parameter {
    /// Name of the coefficient in model files.
    pub name: String,
    /// Estimated value, in the unit `unit`.
    pub value: f64,
    /// 95 % interval of `value`.
    pub ci95: [f64; 2],
    /// Unit of `value`, possibly with the parameter's meaning.
    pub unit: String,
    /// Estimate from each flight alone; empty if it was not computed.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub by_flight: Vec<FlightEstimate>,
}

/// One flight's estimate of a parameter.
#[derive(Clone, Debug, Serialize)]
pub struct FlightEstimate {
    /// Name of the flight.
    pub flight: String,
    /// Estimate from this flight alone.
    pub value: f64,
    /// Standard deviation of `value`.
    pub sd: f64,
}

/// An effect's contribution to a channel as a function of a flight variable such as α, and the residual that it explains.
#[derive(Clone, Debug, Serialize)]
pub struct Curve {
    /// Name of the channel: D, L, Y, l, m or n.
    pub channel: String,
    /// Name of the flight variable, with its unit.
    pub variable: String,
    /// Unit of the channel.
    pub unit: String,
    /// Value of the flight variable in each window (a short stretch of flight).
    pub x: Vec<f64>,
    /// Partial residual in each window: the measured value minus all other terms of the fit with the effect. For an effect that is not
    /// part of the fit, the residual of the fit.
    pub residual: Vec<f64>,
    /// Values of the flight variable at which the contribution is given.
    pub at: Vec<f64>,
    /// Mean contribution at each value in `at`, and the lower and upper end of its 95 % interval, in `unit`.
    pub contribution: Vec<[f64; 3]>,
}

/// What is left unexplained in one channel.
#[derive(Clone, Debug, Serialize)]
pub struct ChannelLeft {
    /// Name of the channel: D, L, Y, l, m or n.
    pub channel: String,
    /// Share of the channel's variance, without that of sensor noise, that the re-estimated model without added effects leaves
    /// unexplained.
    pub tuned_unexplained_fraction: f64,
    /// The same share for the re-estimated model with the asserted effects.
    pub unexplained_fraction: f64,
    /// Flight condition with the most significant mean residual, in words; `None` if no mean residual is significant.
    pub worst_regime: Option<String>,
    /// Product of states or deflections that explains most of the remaining residual; `None` if none does so significantly.
    pub left_with: Option<String>,
    /// Whether these flights do not suffice to assess the given model in this channel.
    pub abstained: bool,
    /// The reason, if `abstained` is true.
    pub why_abstained: Option<String>,
}

/// A sensor error or a component of the wind in one flight.
#[derive(Clone, Debug, Serialize)]
pub struct Measurement {
    /// Name of the flight.
    pub flight: String,
    /// Identifier in the catalogue: `alpha_bias`, `airspeed_scale`, `steady_wind` and so on.
    pub id: String,
    /// Name of the sensor error or wind component.
    pub name: String,
    /// Estimated value, in the unit `unit`.
    pub value: f64,
    /// Standard deviation of `value`.
    pub sd: f64,
    /// Unit of the estimate `value`.
    pub unit: String,
    /// Whether `value` differs significantly from the nominal value.
    pub asserted: bool,
}

/// A trim of one flight: an offset that is added to one of the model's coefficients in this flight.
#[derive(Clone, Debug, Serialize)]
pub struct FlightTrim {
    /// Name of the flight.
    pub flight: String,
    /// Name of the trim: `CD0`, `CL0`, `CY0`, `Cl0`, `Cm0`, `Cn0`, or `thrust_share`, a share of the model's thrust.
    pub name: String,
    /// Prior standard deviation. The prior mean is zero.
    pub prior_sd: f64,
    /// Estimate of the trim, dimensionless.
    pub value: f64,
    /// Standard deviation of `value`, including the uncertainty of the model's own coefficient.
    pub sd: f64,
    /// `value` minus the mean over all flights, and the standard deviation of this difference; `None` for a single flight.
    pub beside_mean: Option<[f64; 2]>,
    /// Whether the trim differs significantly from the mean of all flights, by a plausible amount.
    pub asserted: bool,
}

/// A re-estimated coefficient of the model.
#[derive(Clone, Debug, Serialize)]
pub struct Tuned {
    /// Name, `effect.coefficient`, as in the model file.
    pub name: String,
    /// Value in the model file.
    pub prior: f64,
    /// Prior standard deviation of the coefficient.
    pub prior_sd: f64,
    /// Value after the re-estimation, from data and prior.
    pub value: f64,
    /// Posterior standard deviation of `value`.
    pub sd: f64,
}

/// A manoeuvre recommended for the next flight, with the reason.
#[derive(Clone, Debug, Serialize)]
pub struct Advice {
    /// The manoeuvre, in words.
    pub manoeuvre: String,
    /// Question that the manoeuvre would answer.
    pub why: String,
    /// Pair of ids for `greylag design --between`, if the manoeuvre separates two effects.
    pub between: Option<[String; 2]>,
}

/// Bootstrap draws under the null hypothesis that no effect is missing. They determine the critical values. A draw consists of
/// the same flights, with the residuals that they would have if the re-estimated model were right: noise whose sign is random in
/// each block (stretch of about 4 s), and the effects of coefficient errors that are drawn from their prior.
#[derive(Clone, Debug, Serialize)]
pub struct Nulls {
    /// Number of bootstrap draws.
    pub count: usize,
    /// Evidence of the best candidate in each draw, ascending.
    pub best: Vec<f64>,
    /// Significance level of the critical values.
    pub level: f64,
}

/// A placebo regressor (decoy): a regressor that cannot be an effect.
#[derive(Clone, Debug, Serialize)]
pub struct Decoy {
    /// Construction of the regressor, for example `drag_alpha2 reversed in time`.
    pub name: String,
    /// Evidence that the regressor reaches.
    pub evidence: f64,
}

/// Settings of a diagnosis.
#[derive(Clone, Debug, Serialize)]
pub struct Settings {
    /// Seed of all random draws of the diagnosis.
    pub seed: u64,
    /// Number of bootstrap draws under the null hypothesis.
    pub nulls: usize,
    /// Number of block bootstraps.
    pub bootstraps: usize,
    /// Ids of effects of the catalogue that were excluded.
    pub without: Vec<String>,
    /// Constants that were estimated for each flight in addition to its sensor errors.
    #[serde(flatten)]
    pub per_flight: PerFlight,
}
