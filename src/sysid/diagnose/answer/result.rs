//! The result of a diagnosis, serialized to JSON (`greylag.diagnosis/1`).

use serde::Serialize;

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
    /// The flights allow no verdict. This has one of four reasons: an estimate is physically impossible, the remaining
    /// sensor errors may account for the residual in every channel, the given model has no certain error, or a flexible
    /// model of the states removes little of the residual.
    Unknown,
}

/// The result of a diagnosis of one model over one or several flights.
///
/// Read `verdict` first, then `doubtful`. If `doubtful` is not empty, estimates from the flights are physically
/// impossible, `verdict` is [`Verdict::Unknown`], and no effect is asserted. Then read `effects`: its `asserted`
/// entries come first, in the order of selection. `sentences` state the same results in words.
///
/// Some parts depend on the options. `trims`, and the misalignment angles in `measurement`, are filled if constants of
/// each flight were estimated. `decoys` and the candidates' curves are filled with
/// [`Detail::Full`](crate::diagnose::Detail::Full).
///
/// Values are in SI units unless a `unit` is given. The channels D, L, Y are forces (N); l, m, n are moments (N m). A
/// number that does not exist is NaN, which JSON writes as `null`. Flights are named after their file. Equal inputs,
/// options and versions give equal results, because `settings.seed` determines all random draws.
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
    /// Unexplained share of each channel under the re-estimated model with the added effects.
    pub channels: Vec<ChannelLeft>,
    /// Sensor errors and wind of each flight, estimated without aerodynamics. If requested, also misalignment angles of
    /// the axes (`axes_askew`), estimated together with the aerodynamics.
    pub measurement: Vec<Measurement>,
    /// Trims of each flight, where they were estimated.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub trims: Vec<FlightTrim>,
    /// The model's own coefficients, re-estimated with the added effects in the model.
    pub tuned: Vec<Tuned>,
    /// Advice on the next flight, the most useful first.
    pub advice: Vec<Advice>,
    /// Evidence in bootstrap draws under the null hypothesis. It determines the critical values.
    pub nulls: Nulls,
    /// Placebo regressors (decoys), which check for false detections.
    pub decoys: Vec<Decoy>,
    /// Share of the residual variance beyond noise that a flexible model could still remove after the asserted effects.
    /// The flexible model is fitted to the other flights.
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
    /// Evidence: the smaller of the penalised likelihood gain and the block-robust Wald statistic. It comes from the
    /// round that selected the effect, or from the last round if the effect was not selected.
    pub evidence: f64,
    /// Critical value of the evidence, from bootstrap draws under the null hypothesis that no effect is missing.
    pub threshold: f64,
    /// Parameters of the effect, fitted together with the model's own coefficients.
    pub parameters: Vec<Parameter>,
    /// Channels (D, L, Y, l, m, n) whose residual the effect reduces, the largest reduction first.
    pub channels: Vec<String>,
    /// Ids of effects that these data cannot distinguish from this effect.
    pub indistinguishable_from: Vec<String>,
    /// Share of the residual variance beyond noise that the effect removes from blocks that the fit did not use; NaN
    /// (null) if not computed.
    pub heldout_error_reduction: f64,
    /// Share of block bootstraps in which the effect ranks first; NaN (null) if not computed.
    pub selected_in_bootstraps: f64,
    /// Estimate of the first parameter from each flight alone.
    pub by_flight: Vec<FlightEstimate>,
    /// Smallest amount of the first parameter that these flights would have shown, in its unit; `None` if there is no
    /// such amount.
    pub minimum_detectable: Option<f64>,
    /// Reasons not to assert the effect although its evidence exceeds the critical value.
    pub refused: Vec<String>,
    /// The effect's contribution over the flight variable that explains most of its variance. `None` for candidates of
    /// low rank and with [`Detail::Lean`](crate::diagnose::Detail::Lean).
    pub curve: Option<Curve>,
}

/// Classification of a candidate's evidence.
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
    /// Unit of `value`; it may include the parameter's meaning.
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

/// An effect's contribution over a flight variable (regime variable), with the residual that it explains.
#[derive(Clone, Debug, Serialize)]
pub struct Curve {
    /// Name of the channel: D, L, Y, l, m or n.
    pub channel: String,
    /// Name of the flight variable, with its unit.
    pub variable: String,
    /// Unit of the channel.
    pub unit: String,
    /// Value of the flight variable in each window.
    pub x: Vec<f64>,
    /// Measured value minus the prediction of the re-estimated model without the effect, in each window.
    pub residual: Vec<f64>,
    /// Values of the flight variable at which the contribution is given.
    pub at: Vec<f64>,
    /// Mean contribution at these values, with the lower and upper end of its 95 % interval.
    pub contribution: Vec<[f64; 3]>,
}

/// Unexplained residual of one channel.
#[derive(Clone, Debug, Serialize)]
pub struct ChannelLeft {
    /// Name of the channel: D, L, Y, l, m or n.
    pub channel: String,
    /// Unexplained share of the channel's variance beyond sensor noise, under the re-estimated model without effects.
    pub tuned_unexplained_fraction: f64,
    /// The same share under the re-estimated model with the added effects.
    pub unexplained_fraction: f64,
    /// Flight condition with the most significant mean residual, in words; `None` if no mean residual is significant.
    pub worst_regime: Option<String>,
    /// Product of states or deflections that explains most of the remaining residual; `None` if this is not
    /// significant.
    pub left_with: Option<String>,
    /// Whether these flights do not suffice to assess the given model in this channel.
    pub abstained: bool,
    /// Reason why the channel cannot be assessed, if `abstained`.
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
    /// Estimated value, in the unit `unit`.
    pub value: f64,
    /// Standard deviation of `value`.
    pub sd: f64,
    /// Unit of the estimate `value`.
    pub unit: String,
    /// Whether the constant differs significantly from its nominal value.
    pub asserted: bool,
}

/// A trim coefficient of one flight, as a difference from the model's coefficient.
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
    /// Estimate minus the mean of all flights, and its standard deviation; `None` for a single flight.
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

/// Bootstrap draws under the null hypothesis that no effect is missing, which determine the critical values. Each draw
/// consists of the flights under the re-estimated model with resampled noise: the sign of the noise is random in each
/// block. Errors of the coefficients are drawn from their prior.
#[derive(Clone, Debug, Serialize)]
pub struct Nulls {
    /// Number of bootstrap draws.
    pub count: usize,
    /// Evidence of the best candidate in each draw, ascending.
    pub best: Vec<f64>,
    /// Significance level of the critical values.
    pub level: f64,
}

/// A placebo regressor (decoy), which cannot be an effect.
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
    /// Ids excluded from the catalogue.
    pub without: Vec<String>,
    /// Constants estimated for each flight.
    #[serde(flatten)]
    pub per_flight: PerFlight,
}
