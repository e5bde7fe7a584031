//! The result of a diagnosis, serialized to JSON (`greylag.diagnosis/1`).

use serde::Serialize;

use crate::per_flight::PerFlight;

/// Overall verdict on the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// At least one effect is asserted.
    Effect,
    /// The tuned model explains the data; nothing more is needed.
    Adequate,
    /// Something is missing, but no effect of the catalogue explains it.
    Unexplained,
    /// The flights allow no verdict. This has one of four reasons: an estimate is physically impossible, the remaining
    /// sensor errors may account for the residual in every channel, the given model has no certain error, or a flexible
    /// model of the states removes little of the residual.
    Unknown,
}

/// The result of a diagnosis of one model over one or several flights.
///
/// It is plain data: [`diagnose`](crate::diagnose::diagnose) computes it whole and nothing changes it later. Read
/// `verdict` first, then `doubtful`: if that is not empty, figures of the flights are physically impossible,
/// `verdict` is [`Verdict::Unknown`] and no effect is asserted. Then read `effects`, whose `asserted` entries stand
/// first in the order of selection. `sentences` state the same results in words, the most important first. The
/// optional parts are filled as the options requested them: `trims` and the axes' angles in `measurement` if
/// constants of each flight were estimated, `decoys` and the candidates' curves with
/// [`Detail::Full`](crate::diagnose::Detail::Full).
///
/// Units are SI and stand beside the values; channels D, L, Y are forces (N), l, m, n moments (N m). A number that does
/// not exist is NaN, which JSON writes as `null`. Flights are named by their file. For equal inputs, options and version
/// the result is equal, since `settings.seed` determines all random draws.
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
    /// The answer in plain sentences, the most important first.
    pub sentences: Vec<String>,
    /// Physically impossible figures, in words; if there are any, forces and moments are not judged.
    pub doubtful: Vec<String>,
    /// Every candidate, asserted ones first in the order of their selection, then by evidence.
    pub effects: Vec<Candidate>,
    /// Unexplained share of each channel under the tuned model with the asserted effects.
    pub channels: Vec<ChannelLeft>,
    /// Sensor errors and wind of each flight, estimated without any aerodynamics; misalignment of the axes
    /// (`axes_askew`), estimated with the aerodynamics, where it was requested.
    pub measurement: Vec<Measurement>,
    /// Trims of each flight, where they were estimated.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub trims: Vec<FlightTrim>,
    /// The model's own coefficients as tuned with the asserted effects in the model.
    pub tuned: Vec<Tuned>,
    /// Advice on the next flight, the most useful first.
    pub advice: Vec<Advice>,
    /// Evidence in the null flights, in which no effect is missing; it determines the thresholds.
    pub nulls: Nulls,
    /// Decoy regressors, as a check on false detections.
    pub decoys: Vec<Decoy>,
    /// Share of the residual's variance beyond noise that a flexible model, trained on the other flights, could still
    /// remove after the asserted effects; NaN (null) if it was not computed.
    pub learnable_remainder: f64,
    /// Further notes for the reader.
    pub notes: Vec<String>,
    /// Settings of the diagnosis.
    pub settings: Settings,
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
    /// Classification of the evidence.
    pub status: Status,
    /// The smaller of penalised gain and block-robust Wald statistic, in the round that selected the effect; for a
    /// candidate that was not selected, in the last round.
    pub evidence: f64,
    /// Evidence that chance reaches in the null flights.
    pub threshold: f64,
    /// Parameters of the effect, fitted together with the model's own coefficients.
    pub parameters: Vec<Parameter>,
    /// Channels (D, L, Y, l, m, n) whose residual the effect reduces, the largest reduction first.
    pub channels: Vec<String>,
    /// Ids of effects that these data cannot distinguish from this effect.
    pub indistinguishable_from: Vec<String>,
    /// Relative reduction of the error on segments that the fit did not use; NaN (null) if not computed.
    pub heldout_error_reduction: f64,
    /// Share of block bootstraps in which it is selected first; NaN (null) if not computed.
    pub selected_in_bootstraps: f64,
    /// Estimate of the first parameter from each flight alone.
    pub by_flight: Vec<FlightEstimate>,
    /// Smallest amount of the first parameter that these data would have shown, in its unit.
    pub minimum_detectable: Option<f64>,
    /// Reasons not to assert it although its evidence exceeds the threshold.
    pub refused: Vec<String>,
    /// Its contribution over the regime variable that explains most of its variance. `None` for candidates of low rank
    /// and with [`Detail::Lean`](crate::diagnose::Detail::Lean).
    pub curve: Option<Curve>,
}

/// Classification of a candidate's evidence.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// The model lacks this effect.
    Missing,
    /// The model lacks this effect or one that these flights cannot distinguish from it.
    Indistinguishable,
    /// The effect is significant but too small to matter in these flights.
    Small,
    /// The evidence exceeds the threshold, but a further check failed.
    Refused,
    /// The evidence is below the threshold.
    NotShown,
}

/// A fitted parameter of a candidate.
#[derive(Clone, Debug, Serialize)]
pub struct Parameter {
    /// Name in model files.
    pub name: String,
    /// Estimate, in `unit`.
    pub value: f64,
    /// 95 % interval of `value`.
    pub ci95: [f64; 2],
    /// Unit of `value`, with the parameter's meaning.
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

/// An effect's contribution over a regime variable, with the scatter that it explains.
#[derive(Clone, Debug, Serialize)]
pub struct Curve {
    /// Name of the channel: D, L, Y, l, m or n.
    pub channel: String,
    /// Name of the regime variable with its unit.
    pub variable: String,
    /// Unit of the channel.
    pub unit: String,
    /// Value of the variable at each window.
    pub x: Vec<f64>,
    /// Measured less the tuned model without the effect, at each window.
    pub residual: Vec<f64>,
    /// Values of the variable at which the contribution is given.
    pub at: Vec<f64>,
    /// Mean contribution there, with lower and upper end of its 95 % interval.
    pub contribution: Vec<[f64; 3]>,
}

/// Unexplained residual of one channel.
#[derive(Clone, Debug, Serialize)]
pub struct ChannelLeft {
    /// Name of the channel: D, L, Y, l, m or n.
    pub channel: String,
    /// Unexplained share of the variance beyond sensor noise under the tuned model.
    pub tuned_unexplained_fraction: f64,
    /// The same share with the asserted effects.
    pub unexplained_fraction: f64,
    /// The worst regime in one sentence, where there is one.
    pub worst_regime: Option<String>,
    /// The product of states that correlates most with the remaining residual, if that exceeds chance.
    pub left_with: Option<String>,
    /// Whether these flights do not suffice to assess the given model in this channel.
    pub abstained: bool,
    /// Reason for abstaining, if `abstained`.
    pub why_abstained: Option<String>,
}

/// A sensor error or a component of the wind in one flight.
#[derive(Clone, Debug, Serialize)]
pub struct Measurement {
    /// Name of the flight.
    pub flight: String,
    /// Identifier in the catalogue: `alpha_bias`, `airspeed_scale`, `steady_wind` and so on.
    pub id: String,
    /// Name of the constant.
    pub name: String,
    /// Estimate, in `unit`.
    pub value: f64,
    /// Standard deviation of `value`.
    pub sd: f64,
    /// Unit of `value`.
    pub unit: String,
    /// Whether it differs significantly from its nominal value.
    pub asserted: bool,
}

/// A trim of one flight, relative to what all flights have in common.
#[derive(Clone, Debug, Serialize)]
pub struct FlightTrim {
    /// Name of the flight.
    pub flight: String,
    /// Name of the trim: `CD0`, `CL0`, `CY0`, `Cl0`, `Cm0`, `Cn0`, or `thrust_share`, a share of the model's thrust.
    pub name: String,
    /// Prior standard deviation (prior mean zero).
    pub prior_sd: f64,
    /// Estimate, dimensionless, to be added to the model's coefficient.
    pub value: f64,
    /// Standard deviation of `value`, the uncertainty of the model's own coefficient included.
    pub sd: f64,
    /// Estimate less the mean of all flights, and its standard deviation; `None` for a single flight.
    pub beside_mean: Option<[f64; 2]>,
    /// Whether it differs significantly from the mean by a plausible amount.
    pub asserted: bool,
}

/// A tuned coefficient of the model.
#[derive(Clone, Debug, Serialize)]
pub struct Tuned {
    /// Name, `effect.coefficient`, as in the model file.
    pub name: String,
    /// Value in the model file.
    pub prior: f64,
    /// Prior standard deviation.
    pub prior_sd: f64,
    /// Value after tuning.
    pub value: f64,
    /// Posterior standard deviation of `value`.
    pub sd: f64,
}

/// A manoeuvre to fly next, with its reason.
#[derive(Clone, Debug, Serialize)]
pub struct Advice {
    /// The manoeuvre, in words.
    pub manoeuvre: String,
    /// Question that the manoeuvre would answer.
    pub why: String,
    /// Pair of ids for `greylag design --between`, if the manoeuvre separates two effects.
    pub between: Option<[String; 2]>,
}

/// Null flights, which determine the thresholds. Each is the set of flights under the tuned model with the noise of the
/// richest fit. The sign of this noise is drawn at random block by block, and errors of the coefficients are drawn from
/// their prior.
#[derive(Clone, Debug, Serialize)]
pub struct Nulls {
    /// Number of null flights.
    pub count: usize,
    /// Largest evidence over the candidates in each, ascending.
    pub best: Vec<f64>,
    /// Significance level of the thresholds.
    pub level: f64,
}

/// A column that cannot be an effect.
#[derive(Clone, Debug, Serialize)]
pub struct Decoy {
    /// Construction of the decoy, for example `drag_alpha2 reversed in time`.
    pub name: String,
    /// Evidence that it reaches.
    pub evidence: f64,
}

/// Settings of a diagnosis.
#[derive(Clone, Debug, Serialize)]
pub struct Settings {
    /// Seed of null flights, bootstraps and decoys.
    pub seed: u64,
    /// Number of null flights.
    pub nulls: usize,
    /// Number of block bootstraps.
    pub bootstraps: usize,
    /// Ids excluded from the catalogue.
    pub without: Vec<String>,
    /// Constants estimated for each flight.
    #[serde(flatten)]
    pub per_flight: PerFlight,
}
