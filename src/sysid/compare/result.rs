//! What a comparison finds, as plain data for the terminal, the JSON and the report.
//!
//! Residuals are measured − model: a positive one means that the model is too low. A number that
//! cannot be given is NaN, which JSON writes as `null`.

use serde::Serialize;

use super::answer::Answer;
use super::forecast::ForecastResult;
use crate::weak_form::channels::{ChannelId, RegimeVariable};

/// The comparison of one or several models with one or several flights.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// `greylag.comparison/1`.
    pub schema: &'static str,
    /// Name and version of the program.
    pub program: String,
    /// Seed of the bootstrap.
    pub seed: u64,
    /// The answer in a few sentences, with their numbers.
    pub answer: Answer,
    /// The finding in plain words: the sentences of the first model, the leading ones first.
    pub sentences: Vec<String>,
    /// The models, in the order of the command line.
    pub models: Vec<ModelResult>,
    /// What a model has to beat: the same free runs by forecasts that know no aerodynamics.
    pub forecasts: Vec<ForecastResult>,
    /// The flights, in the order of the command line.
    pub flights: Vec<FlightResult>,
    /// Lengths and bounds that the figures depend on.
    pub settings: Settings,
    /// What the reader must know: what was skipped, assumed or lost.
    pub notes: Vec<String>,
}

/// A comparison as the JSON document: the first model's free run and channels stand at the top.
#[derive(Debug, Serialize)]
pub struct Document<'a> {
    #[serde(flatten)]
    comparison: &'a Comparison,
    free_run: &'a [HorizonScore],
    channels: &'a [ChannelResult],
}

impl Comparison {
    /// The free-run errors of the models, then those of the forecasts, each with its name.
    pub fn free_runs(&self) -> impl Iterator<Item = (&str, &[HorizonScore])> {
        let models = self.models.iter().map(|m| (m.name.as_str(), m.free_run.as_slice()));
        models.chain(self.forecasts.iter().map(|f| (f.name, f.free_run.as_slice())))
    }

    /// The JSON document.
    pub fn document(&self) -> Document<'_> {
        let first = self.models.first();
        Document {
            comparison: self,
            free_run: first.map_or(&[], |m| &m.free_run),
            channels: first.map_or(&[], |m| &m.channels),
        }
    }
}

/// Lengths and bounds that the figures depend on.
#[derive(Clone, Debug, Serialize)]
pub struct Settings {
    /// Time between the starts of free runs, s.
    pub start_every_s: f64,
    /// Horizons of the free runs, s.
    pub horizons_s: Vec<f64>,
    /// A free run has diverged once its scaled error exceeds this.
    pub divergence_bound: f64,
    /// Length of the Hann kernel of the weak form, s.
    pub kernel_s: f64,
    /// Length of a block of the bootstrap, s.
    pub block_s: f64,
    /// Number of resamples of the bootstrap.
    pub resamples: usize,
    /// Fewest independent samples that support a bin.
    pub support: usize,
}

/// One model against all flights.
#[derive(Clone, Debug, Serialize)]
pub struct ModelResult {
    /// The model's name, from its file.
    pub name: String,
    /// What it finds in plain words, the leading sentences first.
    pub sentences: Vec<String>,
    /// Free-run error, one entry a horizon.
    pub free_run: Vec<HorizonScore>,
    /// What the model's file knows of the flights, where it knows any; `free_run` uses it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub known: Option<KnownUse>,
    /// Growth of the free-run error with time, from the start to the longest horizon.
    pub growth: Vec<GrowthPoint>,
    /// The channels D, L, Y, l, m, n and the rates of V, α, β, those that the logs allow.
    pub channels: Vec<ChannelResult>,
    /// Its predictions over time, one entry a flight, in the order of [`Comparison::flights`].
    #[serde(skip)]
    pub traces: Vec<ModelTrace>,
}

/// What a model's file knows of the flights, and what its free runs are worth without it.
#[derive(Clone, Debug, Serialize)]
pub struct KnownUse {
    /// Flights of which it has constants of their own (`[flights.NAME]`).
    pub flights: Vec<String>,
    /// Other flights, for which its `[installation]` is used.
    pub by_installation: Vec<String>,
    /// Free-run error without all that, one entry a horizon.
    pub without: Vec<HorizonScore>,
}

/// Free-run error at one horizon: at that time after the start, over all starts.
#[derive(Clone, Debug, Serialize)]
pub struct HorizonScore {
    /// Time after the start, s.
    pub horizon_s: f64,
    /// Runs that the flights are long enough for.
    pub runs: usize,
    /// Those of them that diverged by then.
    pub diverged: usize,
    /// `diverged / runs`, 0..1.
    pub divergence_rate: f64,
    /// Root mean square, over runs, of the scaled error: the root mean square over the eight states
    /// of error / x_c (eq. 21). A diverged run counts with the divergence bound.
    pub rmse_scaled: f64,
    /// State by state, over the runs that did not diverge.
    pub states: Vec<StateScore>,
}

/// Free-run error of one state at one horizon.
#[derive(Clone, Debug, Serialize)]
pub struct StateScore {
    /// The state, with its unit, as in `State::NAMES`.
    pub state: &'static str,
    /// Root mean square error, in the state's unit.
    pub rmse: f64,
    /// Root mean square error divided by x_c.
    pub rmse_scaled: f64,
    /// Coefficient of determination over the runs: 1 − mean square error / variance of the measured state at
    /// that time. 1 is perfect; at 0 or below the measured mean is the better forecast.
    pub r2: f64,
    /// Theil's U: RMSE / (RMS of measured + RMS of predicted), 0 (perfect) to 1.
    pub theil_u: f64,
    /// Share of the mean square error that is a constant offset, 0..1.
    pub bias_share: f64,
    /// Share that is too much or too little variation, 0..1.
    pub variance_share: f64,
    /// Share that is lack of correlation, 0..1; the three shares add up to 1.
    pub covariance_share: f64,
}

/// Free-run error at a time after the start.
#[derive(Clone, Debug, Serialize)]
pub struct GrowthPoint {
    /// Time after the start, s.
    pub time_s: f64,
    /// Runs that reach so far.
    pub runs: usize,
    /// Those of them that diverged by then.
    pub diverged: usize,
    /// As [`HorizonScore::rmse_scaled`].
    pub rmse_scaled: f64,
    /// Median over runs of the scaled error, a diverged run counting with the bound.
    pub median_scaled: f64,
    /// 90 % quantile over runs of the scaled error, likewise.
    pub p90_scaled: f64,
}

/// One channel of one model over all flights, in weak form: averages over the kernel.
#[derive(Clone, Debug, Serialize)]
pub struct ChannelResult {
    /// Which.
    pub channel: ChannelId,
    /// [`ChannelId::name`].
    pub name: &'static str,
    /// Unit of the channel.
    pub unit: &'static str,
    /// Windows (half overlapping kernels) that it was compared in.
    pub windows: usize,
    /// Standard deviation of the measured channel, in `unit`.
    pub measured_sd: f64,
    /// Root mean square residual, in `unit`.
    pub residual_rms: f64,
    /// Part of it that the sensors' noise accounts for, standard deviation in `unit`.
    pub noise_sd: f64,
    /// Mean square residual less noise, divided by the measured variance less noise, 0 (the model
    /// explains everything) upwards (over 1: worse than a constant). NaN if the flights do not move
    /// the channel above the noise.
    pub unexplained_fraction: f64,
    /// What the residual beyond noise does to the state: scaled error (error / x_c) a second, RMS.
    /// Comparable between channels.
    pub effect_per_s: f64,
    /// Share of the mean square residual that is a constant offset, 0..1.
    pub offset_share: f64,
    /// The worst regime in one sentence.
    pub worst_regime: String,
    /// Why these flights cannot judge the model here; `None` where they can.
    pub abstained: Option<&'static str>,
    /// The worst regime as numbers; `None` if no supported regime differs from zero.
    pub regime: Option<Regime>,
    /// Mean residual over each regime variable.
    pub bins: Vec<RegimeBins>,
    /// Mean residual over α and β.
    pub map: Map,
}

/// Mean residual over one regime variable.
#[derive(Clone, Debug, Serialize)]
pub struct RegimeBins {
    /// The variable.
    pub variable: RegimeVariable,
    /// What it is called, for example `angle of attack`.
    pub name: &'static str,
    /// Its unit here, chosen for people: `°`, `°/s`, `m/s`, `m`, `s`, or empty.
    pub unit: &'static str,
    /// Share of the residual's variance that the bins, or a straight line, explain, whichever is
    /// more, adjusted for their number of parameters, 0..1.
    pub explained: f64,
    /// The bins, ascending; for flights one each, in their order.
    pub bins: Vec<Bin>,
}

/// Mean residual in a bin.
#[derive(Clone, Debug, Serialize)]
pub struct Bin {
    /// Lower edge in the variable's unit; for flights the flight's index − 0.5. NaN if open.
    pub low: f64,
    /// Upper edge; NaN if open.
    pub high: f64,
    /// Mean of the variable over the bin's windows.
    pub center: f64,
    /// Label of a bin that is no interval: the flight's name; else empty.
    pub label: String,
    /// Mean residual (measured − model), in the channel's unit.
    pub mean: f64,
    /// 95 % interval of the mean: block bootstrap, widened by the uncertainty of the sensor errors that
    /// the reconstruction took out.
    pub interval: [f64; 2],
    /// Expected share of false ones among the cells of the model that are at least as sure as this one, 0..1
    /// (Benjamini and Hochberg); NaN if it is not supported. A cell up to 0.05 is one in which the model
    /// fails.
    pub q_value: f64,
    /// Mean of the measured channel, in its unit.
    pub measured: f64,
    /// Number of independent samples: kernel lengths that the windows cover.
    pub independent: usize,
    /// Whether they are enough ([`Settings::support`]); draw grey if not.
    pub supported: bool,
}

/// Mean residual over α and β.
#[derive(Clone, Debug, Serialize)]
pub struct Map {
    /// Edges of the columns: α in degrees, ascending, one more than columns.
    pub alpha_deg: Vec<f64>,
    /// Edges of the rows: β in degrees, ascending, one more than rows.
    pub beta_deg: Vec<f64>,
    /// The cells with at least one window.
    pub cells: Vec<MapCell>,
}

/// One cell of a [`Map`].
#[derive(Clone, Debug, Serialize)]
pub struct MapCell {
    /// Column, from 0.
    pub alpha: usize,
    /// Row, from 0.
    pub beta: usize,
    /// Mean residual, in the channel's unit.
    pub mean: f64,
    /// Number of independent samples.
    pub independent: usize,
    /// Whether they are enough.
    pub supported: bool,
}

/// A regime in which a model fails.
#[derive(Clone, Debug, Serialize)]
pub struct Regime {
    /// The variable that tells it apart; `None`: everywhere alike.
    pub variable: Option<RegimeVariable>,
    /// Lower end in `unit`; NaN if open.
    pub low: f64,
    /// Upper end; NaN if open.
    pub high: f64,
    /// Unit of the ends.
    pub unit: &'static str,
    /// Mean residual (measured − model) there, in the channel's unit.
    pub mean: f64,
    /// 95 % interval, likewise.
    pub interval: [f64; 2],
    /// The same relative to the measured mean there, in %, model − measured; NaN if the measured
    /// channel passes through zero there.
    pub relative_percent: f64,
    /// Number of independent samples.
    pub independent: usize,
    /// The flights that show it.
    pub flights: Vec<String>,
}

/// One flight as compared.
#[derive(Clone, Debug, Serialize)]
pub struct FlightResult {
    /// Its name: the file.
    pub name: String,
    /// Time between samples, s.
    pub step_s: f64,
    /// Number of samples.
    pub samples: usize,
    /// Start and end of each stretch without gaps, s on the log's clock.
    pub segments_s: Vec<[f64; 2]>,
    /// Sensor errors and wind that the reconstruction found.
    pub nuisances: Vec<NuisanceResult>,
    /// What the reconstruction says.
    pub notes: Vec<String>,
    /// What was flown.
    #[serde(skip)]
    pub trace: FlightTrace,
}

/// An error of a sensor, or the wind.
#[derive(Clone, Debug, Serialize)]
pub struct NuisanceResult {
    /// What it is, for example `gyro_bias_p`.
    pub name: String,
    /// Its value, in `unit`.
    pub value: f64,
    /// Its standard deviation, in `unit`.
    pub sd: f64,
    /// The unit.
    pub unit: &'static str,
    /// Its value before the flight; absent if it was not estimated along with the path.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub prior: Option<f64>,
    /// Its standard deviation before the flight.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub prior_sd: Option<f64>,
    /// How far it moved, in standard deviations of its prior.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub moved_sd: Option<f64>,
}

/// A flight over time. All lists have one length; a row of NaN stands between segments.
#[derive(Clone, Debug, Default)]
pub struct FlightTrace {
    /// Time on the log's clock, s, ascending.
    pub time_s: Vec<f64>,
    /// The reconstructed states, in the order and units of `State::NAMES`.
    pub states: [Vec<f64>; 8],
    /// Aileron (rad), elevator (rad), throttle (0..1).
    pub controls: [Vec<f64>; 3],
}

/// A model's predictions for one flight.
#[derive(Clone, Debug, Default)]
pub struct ModelTrace {
    /// The states of free runs restarted from the reconstruction every [`Settings::start_every_s`],
    /// at the times of [`FlightTrace::time_s`]; NaN where there is none.
    pub states: [Vec<f64>; 8],
    /// The channels in weak form.
    pub channels: Vec<ChannelTrace>,
}

/// A channel over time, measured and predicted, in weak form and in the model's force axes.
#[derive(Clone, Debug)]
pub struct ChannelTrace {
    /// Which.
    pub channel: ChannelId,
    /// Middle of each window, s on the log's clock, ascending; between segments a row of NaN
    /// values stands at the segment's end.
    pub time_s: Vec<f64>,
    /// Measured, in the channel's unit.
    pub measured: Vec<f64>,
    /// Predicted, in the channel's unit.
    pub predicted: Vec<f64>,
}
