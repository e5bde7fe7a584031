//! The result of a comparison, as plain data for the terminal, the JSON and the report.
//!
//! Residuals are measured − model: a positive residual means that the model is too low. An undefined number is NaN, written
//! as `null` in JSON. A free run is an open-loop simulation on the recorded controls. A channel is a force, a moment or the
//! rate of V, α or β. In weak form it is averaged with a smooth kernel over short windows. A regime is a range of a regime
//! variable, for example of α, and contains the windows in this range.

use serde::Serialize;

use super::answer::Answer;
use super::forecast::ForecastResult;
use crate::weak_form::channels::{ChannelId, RegimeVariable};

/// The comparison of one or several models with one or several flights.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// Schema of the document, `greylag.comparison/1`.
    pub schema: &'static str,
    /// Name and version of the program.
    pub program: String,
    /// Seed of the bootstrap.
    pub seed: u64,
    /// Short answer in sentences, with their numbers.
    pub answer: Answer,
    /// Findings on the first model in sentences, in descending order of importance.
    pub sentences: Vec<String>,
    /// Physically impossible estimates, in words, and what follows. If there are any, no sentence is on a channel.
    pub doubtful: Vec<String>,
    /// The models, in the order of the command line.
    pub models: Vec<ModelResult>,
    /// Free-run errors of baseline forecasts without aerodynamics.
    pub forecasts: Vec<ForecastResult>,
    /// The flights, in the order of the command line.
    pub flights: Vec<FlightResult>,
    /// Settings on which the results depend.
    pub settings: Settings,
    /// Notes on skipped flights, assumptions and lost accuracy.
    pub notes: Vec<String>,
}

/// A comparison as the JSON document. Free run and channels of the first model are top-level fields.
#[derive(Debug, Serialize)]
pub struct Document<'a> {
    #[serde(flatten)]
    comparison: &'a Comparison,
    free_run: &'a [HorizonScore],
    channels: &'a [ChannelResult],
}

impl Comparison {
    /// The comparison as the JSON document.
    pub fn document(&self) -> Document<'_> {
        let first = self.models.first();
        Document {
            comparison: self,
            free_run: first.map_or(&[], |m| &m.free_run),
            channels: first.map_or(&[], |m| &m.channels),
        }
    }
}

/// Settings on which the results of a comparison depend.
#[derive(Clone, Debug, Serialize)]
pub struct Settings {
    /// Time between the starts of free runs, s.
    pub start_every_s: f64,
    /// Horizons of the free runs, s.
    pub horizons_s: Vec<f64>,
    /// A free run has diverged once its scaled error exceeds this bound.
    pub divergence_bound: f64,
    /// Length of the Hann kernel of the weak form, s.
    pub kernel_s: f64,
    /// Length of a block of the bootstrap, s.
    pub block_s: f64,
    /// Number of resamples of the bootstrap.
    pub resamples: usize,
    /// Smallest number of independent samples with which a bin counts as supported.
    pub support: usize,
}

/// One model against all flights.
#[derive(Clone, Debug, Serialize)]
pub struct ModelResult {
    /// Name of the model, from its file.
    pub name: String,
    /// Findings on the model in sentences, in descending order of importance.
    pub sentences: Vec<String>,
    /// Free-run error at each horizon.
    pub free_run: Vec<HorizonScore>,
    /// Flights for which `free_run` uses constants (sensor errors, trims) in the model's file, and the errors without these
    /// constants; `None` if the file has no constants for these flights.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub known: Option<KnownUse>,
    /// Growth of the free-run error with time, from the start to the longest horizon.
    pub growth: Vec<GrowthPoint>,
    /// Results of the channels that the logs measure, among D, L, Y, l, m, n and the rates of V, α, β.
    pub channels: Vec<ChannelResult>,
    /// Predictions over time, one entry for each flight, in the order of [`Comparison::flights`].
    #[serde(skip)]
    pub traces: Vec<ModelTrace>,
}

/// Flights for which a model's file has constants (trims, misalignment, sensor errors), and the free-run errors without these.
#[derive(Clone, Debug, Serialize)]
pub struct KnownUse {
    /// Names of the flights with a table `[flights.NAME]` in the file.
    pub flights: Vec<String>,
    /// Names of the flights without such a table, to which the file's `[installation]` is applied.
    pub by_installation: Vec<String>,
    /// Free-run error without these constants, one entry for each horizon.
    pub without: Vec<HorizonScore>,
}

/// Free-run errors at one horizon over all runs that reach it.
#[derive(Clone, Debug, Serialize)]
pub struct HorizonScore {
    /// Time after the start, s.
    pub horizon_s: f64,
    /// Number of runs that reach the horizon before their segment ends, including diverged runs.
    pub runs: usize,
    /// Number of those runs that have diverged by then.
    pub diverged: usize,
    /// `diverged / runs`, 0 to 1; NaN without runs.
    pub divergence_rate: f64,
    /// Root mean square, over runs, of the scaled error. The scaled error is the root mean square over the eight states of
    /// error / x_c, where x_c is the reference scale of a state. The scaled error of a diverged run is the divergence
    /// bound.
    pub rmse_scaled: f64,
    /// Errors of each state over the runs that did not diverge.
    pub states: Vec<StateScore>,
}

#[cfg(test)]
impl HorizonScore {
    /// A score of three runs without a divergence, for tests.
    pub(crate) fn of_three(horizon_s: f64, rmse_scaled: f64) -> HorizonScore {
        let (runs, diverged, divergence_rate, states) = (3, 0, 0.0, Vec::new());
        HorizonScore { horizon_s, runs, diverged, divergence_rate, rmse_scaled, states }
    }
}

/// Free-run error of one state at one horizon.
#[derive(Clone, Debug, Serialize)]
pub struct StateScore {
    /// State with its unit, as in `State::NAMES`.
    pub state: &'static str,
    /// Root mean square error, in the state's unit.
    pub rmse: f64,
    /// Root mean square error divided by the reference scale x_c of the state.
    pub rmse_scaled: f64,
    /// Coefficient of determination over the runs: 1 − mean square error / variance of the measured state at the horizon. 1 is
    /// perfect; at 0 or below, the mean of the measured states would be at least as good a forecast.
    pub r2: f64,
    /// Theil's U: RMSE / (RMS of measured + RMS of predicted), 0 (perfect) to 1.
    pub theil_u: f64,
    /// Theil's bias proportion: fraction of the mean square error due to a constant offset, 0..1.
    pub bias_share: f64,
    /// Theil's variance proportion: fraction due to different standard deviations of predicted and measured state, 0..1.
    pub variance_share: f64,
    /// Theil's covariance proportion: fraction due to lack of correlation, 0..1. The three proportions add up to 1.
    pub covariance_share: f64,
}

/// Free-run error at a time after the start.
#[derive(Clone, Debug, Serialize)]
pub struct GrowthPoint {
    /// Time after the start, s.
    pub time_s: f64,
    /// Number of runs that reach this time.
    pub runs: usize,
    /// Number of those runs that have diverged by then.
    pub diverged: usize,
    /// Scaled error at this time, as [`HorizonScore::rmse_scaled`].
    pub rmse_scaled: f64,
    /// Median over runs of the scaled error. The scaled error of a diverged run is the divergence bound.
    pub median_scaled: f64,
    /// 90 % quantile over runs of the scaled error. The scaled error of a diverged run is the divergence bound.
    pub p90_scaled: f64,
}

/// One channel of one model over all flights, in weak form: values are averages over the kernel.
#[derive(Clone, Debug, Serialize)]
pub struct ChannelResult {
    /// Identifier of the channel.
    pub channel: ChannelId,
    /// Name of the channel, [`ChannelId::name`].
    pub name: &'static str,
    /// Unit of the channel.
    pub unit: &'static str,
    /// Number of windows (half overlapping kernels) compared.
    pub windows: usize,
    /// Standard deviation of the measured channel, in `unit`.
    pub measured_sd: f64,
    /// Root mean square residual, in `unit`.
    pub residual_rms: f64,
    /// Standard deviation of the residual due to sensor noise, in `unit`.
    pub noise_sd: f64,
    /// Mean square residual less noise, divided by the measured variance less noise. At 0 the model explains all variance
    /// beyond noise; above 1 the model is worse than a constant. NaN if the measured variance hardly exceeds the noise.
    pub unexplained_fraction: f64,
    /// RMS rate at which the residual beyond noise drives the scaled state error (error / x_c), 1/s. The values of different
    /// channels are comparable.
    pub effect_per_s: f64,
    /// Fraction of the mean square residual due to a constant offset, 0..1.
    pub offset_share: f64,
    /// Sentence on the regime in which the model fails most.
    pub worst_regime: String,
    /// Reason why these flights do not suffice to assess the model in this channel; `None` if they suffice.
    pub abstained: Option<&'static str>,
    /// The same regime as numbers; `None` if the mean residual of no supported regime differs from zero.
    pub regime: Option<Regime>,
    /// Mean residual over each regime variable.
    pub bins: Vec<RegimeBins>,
    /// Mean residual over α and β.
    pub map: Map,
}

/// Whether the flights suffice to assess a model in one channel.
#[derive(Clone, Copy, Debug)]
pub struct Abstention {
    /// Channel that is assessed.
    pub channel: ChannelId,
    /// Reason why the flights do not suffice; `None` if they suffice.
    pub why: Option<&'static str>,
    /// Whether the mean residual differs significantly from zero in a regime with enough samples.
    pub sure_error: bool,
}

/// Mean residual over one regime variable.
#[derive(Clone, Debug, Serialize)]
pub struct RegimeBins {
    /// Variable whose range is divided into bins.
    pub variable: RegimeVariable,
    /// Name of the variable, for example `angle of attack`.
    pub name: &'static str,
    /// Display unit of the variable: `°`, `°/s`, `m/s`, `m`, `s`, or empty.
    pub unit: &'static str,
    /// Fraction of the residual's variance that the bins or a straight line explain, whichever is larger, 0..1. It is
    /// adjusted for the number of parameters.
    pub explained: f64,
    /// Bins in ascending order of the variable. If the variable is the flight, there is one bin for each flight, in the order
    /// of the flights.
    pub bins: Vec<Bin>,
}

/// Mean residual in a bin.
#[derive(Clone, Debug, Serialize)]
pub struct Bin {
    /// Lower edge in the variable's unit, or the flight's index − 0.5 if the variable is the flight. NaN if open.
    pub low: f64,
    /// Upper edge in the variable's unit, or the flight's index + 0.5 if the variable is the flight. NaN if open.
    pub high: f64,
    /// Mean of the variable over the bin's windows, in the variable's unit.
    pub center: f64,
    /// Name of the flight if the bins are flights; otherwise empty.
    pub label: String,
    /// Mean residual (measured − model), in the channel's unit.
    pub mean: f64,
    /// 95 % interval of the mean: block bootstrap, widened by the uncertainty of the sensor errors estimated by the
    /// reconstruction.
    pub interval: [f64; 2],
    /// Benjamini–Hochberg q-value, 0..1: expected fraction of false discoveries among the cells of the model that are at least as
    /// significant as this one. A cell is one channel in one bin. NaN if the bin is not supported. The model fails in cells with
    /// a q-value of at most 0.05.
    pub q_value: f64,
    /// Mean of the measured channel, in its unit.
    pub measured: f64,
    /// Number of independent samples: number of kernel lengths that the windows cover.
    pub independent: usize,
    /// Whether there are enough independent samples ([`Settings::support`]).
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
    /// Index of the column, from 0.
    pub alpha: usize,
    /// Index of the row, from 0.
    pub beta: usize,
    /// Mean residual, in the channel's unit.
    pub mean: f64,
    /// Number of independent samples.
    pub independent: usize,
    /// Whether there are enough independent samples.
    pub supported: bool,
}

/// A regime in which a model fails.
#[derive(Clone, Debug, Serialize)]
pub struct Regime {
    /// The variable that separates the regime; `None` if the residual is a constant offset.
    pub variable: Option<RegimeVariable>,
    /// Lower end in `unit`; NaN if open.
    pub low: f64,
    /// Upper end in `unit`; NaN if open.
    pub high: f64,
    /// Unit of the ends.
    pub unit: &'static str,
    /// Mean residual (measured − model) in the regime, in the channel's unit.
    pub mean: f64,
    /// 95 % interval of `mean`.
    pub interval: [f64; 2],
    /// Relative error (model − measured) / measured in the regime, from the means, %. NaN if more than 10 % of the measured
    /// values have the opposite sign of their mean.
    pub relative_percent: f64,
    /// Number of independent samples.
    pub independent: usize,
    /// Names of the flights with enough samples in the regime whose own mean residual there has the sign of `mean`.
    pub flights: Vec<String>,
}

/// A flight of the comparison.
#[derive(Clone, Debug, Serialize)]
pub struct FlightResult {
    /// Name of the flight, from its file.
    pub name: String,
    /// Time between samples, s.
    pub step_s: f64,
    /// Total number of samples.
    pub samples: usize,
    /// Start and end of each stretch without gaps, s on the log's clock.
    pub segments_s: Vec<[f64; 2]>,
    /// Sensor errors and wind estimated by the reconstruction.
    pub nuisances: Vec<NuisanceResult>,
    /// Notes of the reconstruction.
    pub notes: Vec<String>,
    /// Reconstructed states and controls over time.
    #[serde(skip)]
    pub trace: FlightTrace,
}

/// A sensor error, or a component of the wind.
#[derive(Clone, Debug, Serialize)]
pub struct NuisanceResult {
    /// Name, for example `gyro_bias_p`.
    pub name: String,
    /// Estimate, in `unit`.
    pub value: f64,
    /// Standard deviation of the estimate, in `unit`.
    pub sd: f64,
    /// Unit of the values.
    pub unit: &'static str,
    /// Prior mean, in `unit`; `None` if the quantity was not estimated together with the path.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub prior: Option<f64>,
    /// Prior standard deviation, in `unit`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub prior_sd: Option<f64>,
    /// Estimate less prior mean, in prior standard deviations; `None` without a prior.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub moved_sd: Option<f64>,
}

/// A flight over time. All lists have the same length. A row of NaN follows each segment.
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
    /// States of free runs that restart from the reconstruction every [`Settings::start_every_s`], at the times of
    /// [`FlightTrace::time_s`]; NaN between segments and after divergence.
    pub states: [Vec<f64>; 8],
    /// The channels in weak form.
    pub channels: Vec<ChannelTrace>,
}

/// A channel over time, measured and predicted, in weak form and in the model's force axes.
#[derive(Clone, Debug)]
pub struct ChannelTrace {
    /// Identifier of the channel.
    pub channel: ChannelId,
    /// Middle of each window, s on the log's clock, ascending. A row of NaN values separates two segments. Its time is one
    /// sample before the first window of the next segment.
    pub time_s: Vec<f64>,
    /// Measured values, in the channel's unit.
    pub measured: Vec<f64>,
    /// Predicted values, in the channel's unit.
    pub predicted: Vec<f64>,
}
