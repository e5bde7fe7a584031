//! What a diagnosis says, as it goes into JSON (`greylag.diagnosis/1`).

use serde::Serialize;

use crate::per_flight::PerFlight;

/// The answer in one word.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// At least one effect is asserted.
    Effect,
    /// The tuned model explains the data; nothing more is needed.
    Adequate,
    /// Something is missing, and none of the catalogue's effects is it.
    Unexplained,
}

/// A diagnosis.
#[derive(Clone, Debug, Serialize)]
pub struct Diagnosis {
    /// `greylag.diagnosis/1`.
    pub schema: &'static str,
    /// Version of the program.
    pub version: &'static str,
    /// Name of the model.
    pub model: String,
    /// The answer in one word.
    pub verdict: Verdict,
    /// The answer in plain sentences, the most important first.
    pub sentences: Vec<String>,
    /// Every candidate, asserted ones first in the order of their selection, then by evidence.
    pub effects: Vec<Candidate>,
    /// What the tuned model with the asserted effects leaves unexplained, by channel.
    pub channels: Vec<ChannelLeft>,
    /// Sensor errors and wind of each flight, decided before any aerodynamics; axes that stand askew
    /// (`axes_askew`), decided beside them, where they were asked for.
    pub measurement: Vec<Measurement>,
    /// The trims of each flight, where they were asked for.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub trims: Vec<FlightTrim>,
    /// The prior's coefficients as tuned, with the asserted effects in the model.
    pub tuned: Vec<Tuned>,
    /// What to fly next, the most useful first.
    pub advice: Vec<Advice>,
    /// The nulls, which lack no effect, that set the thresholds.
    pub nulls: Nulls,
    /// Columns that cannot be effects, tried to see what chance reaches.
    pub decoys: Vec<Decoy>,
    /// Share of the residual's variance beyond noise that a flexible model, trained on the other
    /// flights, could still remove after the asserted effects; NaN (null) if it could not be tried.
    pub learnable_remainder: f64,
    /// What the reader must know besides.
    pub notes: Vec<String>,
    /// What the diagnosis was asked for.
    pub settings: Settings,
}

/// A candidate effect.
#[derive(Clone, Debug, Serialize)]
pub struct Candidate {
    /// Its id in the catalogue.
    pub id: String,
    /// What it is, in one sentence.
    pub description: &'static str,
    /// Whether the data say that it is missing.
    pub asserted: bool,
    /// The smaller of its penalised gain and its block-robust Wald statistic, in the step in which
    /// it was selected, or in the last one.
    pub evidence: f64,
    /// What chance reaches in the nulls.
    pub threshold: f64,
    /// Its parameters as fitted together with the prior.
    pub parameters: Vec<Parameter>,
    /// Channels (D, L, Y, l, m, n) in which it takes part of the residual, the largest first.
    pub channels: Vec<String>,
    /// Ids that these data cannot tell from it.
    pub indistinguishable_from: Vec<String>,
    /// Share by which it lowers the error of segments that the fit did not see; NaN (null) if not
    /// tried.
    pub heldout_error_reduction: f64,
    /// Share of block bootstraps in which it is selected first; NaN (null) if not tried.
    pub selected_in_bootstraps: f64,
    /// Per flight, the first parameter fitted on that flight alone with its standard deviation.
    pub by_flight: Vec<FlightEstimate>,
    /// Smallest amount of the first parameter that these data would have shown.
    pub minimum_detectable: Option<f64>,
    /// Why it is not asserted although its evidence exceeds the threshold.
    pub refused: Vec<String>,
    /// Its contribution over the regime variable that shows it best.
    pub curve: Option<Curve>,
}

/// A fitted parameter.
#[derive(Clone, Debug, Serialize)]
pub struct Parameter {
    /// Its name in model files.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// Its 95 % interval.
    pub ci95: [f64; 2],
    /// What it is, with its unit.
    pub unit: String,
}

/// One flight's say on a parameter.
#[derive(Clone, Debug, Serialize)]
pub struct FlightEstimate {
    /// The flight.
    pub flight: String,
    /// The value.
    pub value: f64,
    /// Its standard deviation.
    pub sd: f64,
}

/// An effect's contribution over a regime variable, with the scatter that it explains.
#[derive(Clone, Debug, Serialize)]
pub struct Curve {
    /// Channel, D, L, Y, l, m or n.
    pub channel: String,
    /// Name of the regime variable with its unit.
    pub variable: String,
    /// Unit of the channel.
    pub unit: String,
    /// The variable at each window.
    pub x: Vec<f64>,
    /// Measured less the tuned model without the effect, at each window.
    pub residual: Vec<f64>,
    /// Places on the axis where the curve is given.
    pub at: Vec<f64>,
    /// Mean contribution there, lower and upper end of its 95 % interval.
    pub contribution: Vec<[f64; 3]>,
}

/// What is left of one channel.
#[derive(Clone, Debug, Serialize)]
pub struct ChannelLeft {
    /// D, L, Y, l, m or n.
    pub channel: String,
    /// Unexplained share of what is not sensor noise under the tuned model.
    pub tuned_unexplained_fraction: f64,
    /// The same with the asserted effects.
    pub unexplained_fraction: f64,
    /// The worst regime in one sentence, where there is one.
    pub worst_regime: Option<String>,
    /// The product of states that what is left goes with most, where more is left than chance leaves.
    pub left_with: Option<String>,
}

/// A sensor's error or the wind in one flight.
#[derive(Clone, Debug, Serialize)]
pub struct Measurement {
    /// The flight.
    pub flight: String,
    /// Id in the catalogue: `alpha_bias`, `airspeed_scale`, `steady_wind` and so on.
    pub id: String,
    /// Name of the constant.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// Its standard deviation.
    pub sd: f64,
    /// Its unit.
    pub unit: String,
    /// Whether it is clearly not zero.
    pub asserted: bool,
}

/// A trim of one flight, beside what all flights have in common.
#[derive(Clone, Debug, Serialize)]
pub struct FlightTrim {
    /// The flight.
    pub flight: String,
    /// Its name: `CD0`, `CL0`, `CY0`, `Cl0`, `Cm0`, `Cn0`, or `thrust_share`, a share of the model's thrust.
    pub name: String,
    /// Its standard deviation as a prior, about zero.
    pub prior_sd: f64,
    /// Its value, dimensionless, to be added to the model's coefficient.
    pub value: f64,
    /// Its standard deviation, what is not sure of the model's coefficient included.
    pub sd: f64,
    /// The same less the mean of all flights, with its standard deviation; `None` of a single flight.
    pub beside_mean: Option<[f64; 2]>,
    /// Whether it is clearly not the mean, and by no more than is believed.
    pub asserted: bool,
}

/// A tuned coefficient.
#[derive(Clone, Debug, Serialize)]
pub struct Tuned {
    /// `effect.coefficient`.
    pub name: String,
    /// Value in the model file.
    pub prior: f64,
    /// Its standard deviation as a prior.
    pub prior_sd: f64,
    /// Value after tuning.
    pub value: f64,
    /// Its standard deviation.
    pub sd: f64,
}

/// What to fly, and why.
#[derive(Clone, Debug, Serialize)]
pub struct Advice {
    /// The manoeuvre, in words.
    pub manoeuvre: String,
    /// What it would tell.
    pub why: String,
    /// The pair of ids for `greylag design --between`, where it separates two.
    pub between: Option<[String; 2]>,
}

/// Nulls: the flights under the tuned model, with the noise of the richest fit, its sign drawn anew block by
/// block, and the prior wrong by chance within its widths.
#[derive(Clone, Debug, Serialize)]
pub struct Nulls {
    /// How many.
    pub count: usize,
    /// The best candidate's evidence in each, ascending.
    pub best: Vec<f64>,
    /// The chance that was allowed in setting the thresholds.
    pub level: f64,
}

/// A column that cannot be an effect.
#[derive(Clone, Debug, Serialize)]
pub struct Decoy {
    /// How it was made, for example `drag_alpha2 reversed in time`.
    pub name: String,
    /// Its evidence.
    pub evidence: f64,
}

/// What a diagnosis was asked for.
#[derive(Clone, Debug, Serialize)]
pub struct Settings {
    /// Seed of nulls, bootstraps and decoys.
    pub seed: u64,
    /// Nulls drawn.
    pub nulls: usize,
    /// Block bootstraps.
    pub bootstraps: usize,
    /// Ids left out of the catalogue.
    pub without: Vec<String>,
    /// What each flight had of its own.
    #[serde(flatten)]
    pub per_flight: PerFlight,
}
