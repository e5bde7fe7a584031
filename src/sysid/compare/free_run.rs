//! Free runs: the model is integrated from reconstructed states with the recorded deflections, without feedback from the
//! measurements. x_c is the scale by which the error of each state is divided.

use std::f64::consts::{PI, TAU};

use rayon::prelude::*;

use super::correction::{Acting, Correction};
use super::result::{GrowthPoint, HorizonScore, StateScore};
use crate::flight_path::reconstruction::Instant;
use crate::per_flight::known::KnownFlight;
use crate::weak_form::prepared::Prepared;
use greylag_model::{GreyBox, Memory};
use greylag_num::statistics::{mean, quantile};
use greylag_physics::State;

/// Time between the starts of two free runs, s.
pub const START_EVERY_S: f64 = 3.0;
/// A run has diverged once its scaled error (root mean square over the states of error / x_c) exceeds this bound. The scaled
/// error is 1, for example, if the error of every state equals its scale: 1 rad for angles, V0 for airspeed, and so on.
pub const DIVERGENCE_BOUND: f64 = 1.0;
/// Number of points of the growth curve, which shows the error over the time since the start of a run.
pub const GROWTH_POINTS: usize = 25;

/// Measured and predicted state of a run at one time; `None` once the run has diverged.
pub(super) type Look = Option<[[f64; 8]; 2]>;

/// All free runs of a model over all flights.
pub struct Runs {
    /// Times at which the errors are evaluated, s after the start of a run, ascending.
    times: Vec<f64>,
    /// For each run: its states at `times`, up to the end of its segment (stretch of a flight without gaps).
    runs: Vec<Vec<Look>>,
    scale: [f64; 8],
}

/// The predicted states of free runs that restart every [`START_EVERY_S`], one list for each state. The times are those of
/// [`FlightTrace`](super::result::FlightTrace), the order and the units those of `State::NAMES`.
pub type Trace = [Vec<f64>; 8];

/// Makes free runs of `model` over all `flights`. They are evaluated at the `horizons` (s) and at the points of the growth
/// curve up to the longest horizon. Constants of a flight in the model's file (trims, sensor errors) are applied to that
/// flight. Returns also one trace for each flight.
pub fn fly(model: &GreyBox, flights: &[Prepared], horizons: &[f64]) -> (Runs, Vec<Trace>) {
    fly_with(model, flights, horizons, None)
}

/// As [`fly`], with the model's rates corrected by `correction`.
pub fn fly_with(
    model: &GreyBox,
    flights: &[Prepared],
    horizons: &[f64],
    correction: Option<Correction>,
) -> (Runs, Vec<Trace>) {
    let longest = horizons.iter().copied().fold(0.0, f64::max);
    let growth = (1..=GROWTH_POINTS).map(|k| longest * k as f64 / GROWTH_POINTS as f64);
    let mut times: Vec<f64> = horizons.iter().copied().chain(growth).collect();
    times.sort_by(f64::total_cmp);
    times.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
    let mut runs = Vec::new();
    let mut traces = Vec::new();
    for flight in flights {
        let known = KnownFlight::of(model, flight);
        let (with, right) = known.as_ref().map_or((model, flight), |k| (&k.model, &k.flight));
        let (mut flown, mut trace) = fly_one(with, &right.acting(with), &times, correction);
        if let Some(known) = &known {
            measured_from(&mut trace, known);
            let pairs = flown.iter_mut().flatten().flatten();
            pairs.for_each(|pair| *pair = pair.map(|state| known.as_measured(state)));
        }
        runs.extend(flown);
        traces.push(trace);
    }
    (Runs { times, runs, scale: model.scale() }, traces)
}

/// Largest accepted relative difference between a horizon and the time of the sample at which its error is computed.
const UNEVEN: f64 = 0.25;

/// A note for each flight and horizon (s) for which no sample is close to the horizon. `steps` holds the names of the
/// flights and their sampling intervals, s.
pub fn uneven(steps: &[(&str, f64)], horizons: &[f64]) -> Vec<String> {
    let mut notes = Vec::new();
    for (name, dt) in steps {
        for horizon in horizons {
            let sampled = dt * (horizon / dt).round().max(1.0);
            if (sampled - horizon).abs() > UNEVEN * horizon {
                notes.push(format!(
                    "{name}: its samples are {dt:.3} s apart, so its error at the horizon {horizon} s is that at \
                     {sampled:.3} s"
                ));
            }
        }
    }
    notes
}

/// Adds the sensor errors of the flight to the states of `trace`, so that they are comparable with its measurements.
fn measured_from(trace: &mut Trace, known: &KnownFlight) {
    for k in 0..trace[0].len() {
        let state = known.as_measured(std::array::from_fn(|i| trace[i][k]));
        trace.iter_mut().zip(state).for_each(|(list, x)| list[k] = x);
    }
}

fn fly_one(
    model: &GreyBox,
    flight: &Prepared,
    times: &[f64],
    correction: Option<Correction>,
) -> (Vec<Vec<Look>>, Trace) {
    let every = ((START_EVERY_S / flight.dt).round() as usize).max(1);
    let looks: Vec<usize> =
        times.iter().map(|t| ((t / flight.dt).round() as usize).max(1)).collect();
    let model = flight.stepping(model);
    let mut runs = Vec::new();
    let rows = flight.segments.iter().map(|segment| segment.len() + 1).sum();
    let mut trace: Trace = std::array::from_fn(|_| Vec::with_capacity(rows));
    for segment in &flight.segments {
        let from = trace[0].len();
        let starts: Vec<usize> = (0..segment.len() - 1).step_by(every).collect();
        for starts in starts.chunks(RUNS_AT_A_TIME) {
            let flown: Vec<(Vec<Look>, Vec<[f64; 8]>)> = starts
                .par_iter()
                .map(|&start| {
                    let acting = correction.map(|c| c.from(&model, flight, segment, start));
                    let wanted = Wanted { looks: &looks, keep: every };
                    run(&model, flight, segment, start, wanted, acting)
                })
                .collect();
            for (start, (looks, path)) in starts.iter().zip(flown) {
                for (k, list) in trace.iter_mut().enumerate() {
                    list.resize(from + start, f64::NAN);
                    list.extend(path.iter().map(|state| state[k]));
                }
                runs.push(looks);
            }
        }
        // the row between segments is NaN, as in the flight's trace
        for list in &mut trace {
            list.resize(from + segment.len(), f64::NAN);
            list.push(f64::NAN);
        }
    }
    (runs, trace)
}

/// Largest number of runs whose paths are in memory before they are appended to the trace.
const RUNS_AT_A_TIME: usize = 256;

/// Predicted states of a single free run.
#[derive(Clone, Debug, Default)]
pub struct Path {
    /// Time on the log's clock, s.
    pub time_s: Vec<f64>,
    /// The predicted states, in the order and units of `State::NAMES`.
    pub states: Trace,
}

/// Integrates `model` from the measured state at the sample nearest to `time_s` (s on the log's clock).
///
/// The run ends after `seconds` (s), at the end of the segment or when it diverges. `None` if no segment contains `time_s`.
pub fn from_moment(model: &GreyBox, flight: &Prepared, time_s: f64, seconds: f64) -> Option<Path> {
    let known = KnownFlight::of(model, flight);
    let (model, flight) = known.as_ref().map_or((model, flight), |k| (&k.model, &k.flight));
    let flight = &*flight.acting(model);
    let inside = |s: &&Vec<Instant>| {
        s.first().is_some_and(|i| i.time_s - flight.dt <= time_s)
            && s.last().is_some_and(|i| time_s < i.time_s)
    };
    let segment = flight.segments.iter().find(inside)?;
    let start = segment.partition_point(|i| i.time_s < time_s - 0.5 * flight.dt);
    let keep = ((seconds / flight.dt).round() as usize).max(1) + 1;
    let wanted = Wanted { looks: &[], keep };
    let (_, rows) = run(&flight.stepping(model), flight, segment, start, wanted, None);
    let mut path = Path::default();
    for (instant, row) in segment[start..].iter().zip(rows) {
        path.time_s.push(instant.time_s);
        path.states.iter_mut().zip(row).for_each(|(list, x)| list.push(x));
    }
    if let Some(known) = &known {
        measured_from(&mut path.states, known);
    }
    Some(path)
}

/// Results that are wanted of a run.
struct Wanted<'a> {
    /// Numbers of steps after which the measured and the predicted state are returned, ascending.
    looks: &'a [usize],
    /// Number of samples, the first included, of which the predicted state is returned.
    keep: usize,
}

/// Integrates one run from sample `start`. Returns what is [`Wanted`]: the pairs of measured and predicted state, and the
/// predicted states.
fn run(
    model: &GreyBox,
    flight: &Prepared,
    segment: &[Instant],
    start: usize,
    Wanted { looks, keep }: Wanted,
    mut correction: Option<Acting>,
) -> (Vec<Look>, Vec<[f64; 8]>) {
    let scale = model.scale();
    let mut memory = Memory::default();
    let advance = |k: usize, state: State, memory: &mut Memory| {
        let next = &segment[(k + 1).min(segment.len() - 1)];
        flight.advance(model, state, [&segment[k], next], memory)
    };
    if let Some(before) = start.checked_sub(1) {
        // the integrator uses the acceleration of the preceding step
        advance(before, segment[before].state, &mut memory);
    }
    let last = looks.last().map_or(0, |l| (start + l).min(segment.len() - 1));
    let mut state = segment[start].state;
    let mut seen = Vec::new();
    let mut path = vec![state.to_array()];
    for i in start..last.max((start + keep).min(segment.len()) - 1) {
        state = advance(i, state, &mut memory);
        if let Some(correction) = &mut correction {
            let mut next = state.to_array();
            correction.act(&mut next, &segment[..=i], flight.dt);
            state = State::from_array(next);
        }
        let measured = segment[i + 1].state.to_array();
        let error = error(&measured, &state.to_array());
        let good = scaled(&error, &scale) <= DIVERGENCE_BOUND;
        if path.len() < keep && good {
            path.push(state.to_array());
        }
        for _ in looks.iter().filter(|l| **l == i + 1 - start) {
            seen.push(good.then(|| [measured, state.to_array()]));
        }
        if !good {
            let reached = looks.iter().filter(|l| start + *l < segment.len()).count();
            seen.resize(reached, None);
            break;
        }
    }
    (seen, path)
}

/// Predicted − measured states, in the units of `State::NAMES`, with the roll error wrapped to ±π. Residuals in the report
/// are measured − predicted.
pub fn error(measured: &[f64; 8], predicted: &[f64; 8]) -> [f64; 8] {
    let mut error: [f64; 8] = std::array::from_fn(|k| predicted[k] - measured[k]);
    error[0] = (error[0] + PI).rem_euclid(TAU) - PI;
    error
}

/// Root mean square of error / x_c over the eight states; NaN if the error of any state is NaN.
pub(super) fn scaled(error: &[f64; 8], scale: &[f64; 8]) -> f64 {
    (error.iter().zip(scale).map(|(e, x)| (e / x).powi(2)).sum::<f64>() / 8.0).sqrt()
}

impl Runs {
    /// Combines `runs`, which are evaluated at the `times` (s). `scale` is the scale x_c of each state.
    pub(super) fn new(times: Vec<f64>, runs: Vec<Vec<Look>>, scale: [f64; 8]) -> Runs {
        Runs { times, runs, scale }
    }

    fn at(&self, time: f64) -> Vec<Look> {
        let place = self.times.iter().position(|t| (t - time).abs() < 1e-9);
        place.map_or(Vec::new(), |k| self.runs.iter().filter_map(|r| r.get(k).copied()).collect())
    }

    /// Scaled errors of `looks`, the states of all runs at one time. The error of a diverged run is [`DIVERGENCE_BOUND`].
    fn errors(&self, looks: &[Look]) -> Vec<f64> {
        let one = |look: &Look| match look {
            Some([measured, predicted]) => scaled(&error(measured, predicted), &self.scale),
            None => DIVERGENCE_BOUND,
        };
        looks.iter().map(one).collect()
    }

    /// Scaled error of each run at `horizon_s` (s), one of the evaluated times. The error of a diverged run is
    /// [`DIVERGENCE_BOUND`].
    pub fn scaled_errors(&self, horizon_s: f64) -> Vec<f64> {
        self.errors(&self.at(horizon_s))
    }

    /// The errors over all runs at `horizon_s` (s), one of the evaluated times.
    pub fn score(&self, horizon_s: f64) -> HorizonScore {
        let looks = self.at(horizon_s);
        let diverged = looks.iter().filter(|l| l.is_none()).count();
        let whole: Vec<[[f64; 8]; 2]> = looks.iter().flatten().copied().collect();
        HorizonScore {
            horizon_s,
            runs: looks.len(),
            diverged,
            divergence_rate: diverged as f64 / looks.len() as f64,
            rmse_scaled: root_mean_square(&self.errors(&looks)),
            states: (0..8).map(|k| self.state_score(k, &whole)).collect(),
        }
    }

    /// The growth of the error with time.
    pub fn growth(&self) -> Vec<GrowthPoint> {
        let point = |&time_s: &f64| {
            let looks = self.at(time_s);
            let errors = self.errors(&looks);
            GrowthPoint {
                time_s,
                runs: looks.len(),
                diverged: looks.iter().filter(|l| l.is_none()).count(),
                rmse_scaled: root_mean_square(&errors),
                median_scaled: quantile(&errors, 0.5),
                p90_scaled: quantile(&errors, 0.9),
            }
        };
        self.times.iter().map(point).filter(|p| p.runs > 0).collect()
    }

    /// RMSE, R², Theil's U and Theil's proportions for state number `k`.
    fn state_score(&self, k: usize, runs: &[[[f64; 8]; 2]]) -> StateScore {
        let measured: Vec<f64> = runs.iter().map(|r| r[0][k]).collect();
        // the error is wrapped, so that a measured roll of 179° and a predicted one of −179° differ by 2°
        let predicted: Vec<f64> = runs.iter().map(|r| r[0][k] + error(&r[0], &r[1])[k]).collect();
        let errors: Vec<f64> = predicted.iter().zip(&measured).map(|(a, b)| a - b).collect();
        let rmse = root_mean_square(&errors);
        let (mean_a, mean_b) = (mean(&predicted), mean(&measured));
        let (sd_a, sd_b) = (deviation(&predicted, mean_a), deviation(&measured, mean_b));
        let bias = (mean_a - mean_b).powi(2) / (rmse * rmse);
        let variance = (sd_a - sd_b).powi(2) / (rmse * rmse);
        StateScore {
            state: State::NAMES[k],
            rmse,
            rmse_scaled: rmse / self.scale[k],
            r2: 1.0 - (rmse / sd_b).powi(2),
            theil_u: rmse / (root_mean_square(&predicted) + root_mean_square(&measured)),
            bias_share: bias,
            variance_share: variance,
            covariance_share: at_least_zero(1.0 - bias - variance),
        }
    }
}

/// Returns `x`, or 0 if `x` is negative. A NaN stays NaN, which `f64::max` would replace by 0.
fn at_least_zero(x: f64) -> f64 {
    if x < 0.0 { 0.0 } else { x }
}

fn root_mean_square(x: &[f64]) -> f64 {
    (x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64).sqrt()
}

fn deviation(x: &[f64], mean: f64) -> f64 {
    (x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / x.len() as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_horizon_between_two_samples_is_noted() {
        let all = uneven(&[("a", 0.01), ("b", 0.2)], &[0.05, 1.0]);
        assert_eq!(
            all,
            [
                "b: its samples are 0.200 s apart, so its error at the horizon 0.05 s is that at 0.200 s"
            ]
        );
    }

    #[test]
    fn theils_shares_of_known_errors() {
        let runs = |f: fn(f64) -> f64| Runs {
            times: vec![1.0],
            scale: [1.0; 8],
            runs: [-0.4, -0.1, 0.2, 0.3].map(|x: f64| vec![Some([[x; 8], [f(x); 8]])]).to_vec(),
        };
        let offset = runs(|x| x + 0.1).score(1.0);
        let s = &offset.states[1];
        assert!((s.rmse - 0.1).abs() < 1e-12 && (s.bias_share - 1.0).abs() < 1e-9);
        // the prediction is twice the measured value: the RMSE equals the RMS of the measured values, so U = 1/(2 + 1)
        let doubled = runs(|x| 2.0 * x).score(1.0);
        let s = &doubled.states[1];
        assert!((s.theil_u - 1.0 / 3.0).abs() < 1e-12 && (s.variance_share - 1.0).abs() < 1e-9);
        assert_eq!(offset.divergence_rate, 0.0);
    }

    #[test]
    fn a_diverged_run_counts_with_the_bound() {
        let exact = Some([[0.1; 8]; 2]);
        let runs = Runs { times: vec![1.0], scale: [1.0; 8], runs: vec![vec![exact], vec![None]] };
        let score = runs.score(1.0);
        assert_eq!((score.runs, score.diverged, score.divergence_rate), (2, 1, 0.5));
        assert!((score.rmse_scaled - DIVERGENCE_BOUND / 2_f64.sqrt()).abs() < 1e-12);
        assert_eq!(score.states[2].rmse, 0.0);
        // Theil's proportions of a zero error are not defined
        let s = &score.states[2];
        assert!(s.bias_share.is_nan() && s.variance_share.is_nan() && s.covariance_share.is_nan());
        // a roll of 179° predicted as −179° has an error of 2°
        let e = error(&[179_f64.to_radians(); 8], &[-179_f64.to_radians(); 8]);
        assert!((e[0] - 2_f64.to_radians()).abs() < 1e-9);
    }
}
