//! Free runs: the model is integrated from reconstructed states with the recorded deflections, without feedback from the
//! measurements. x_c is the scale by which the error of each state is divided.

use std::f64::consts::{PI, TAU};

use rayon::prelude::*;

use super::correction::{Acting, Correction};
pub use super::runs::Runs;
use super::runs::{Ahead, Look};
use crate::flight_path::reconstruction::Instant;
use crate::per_flight::known::KnownFlight;
use crate::weak_form::prepared::Prepared;
use greylag_model::{GreyBox, Memory};
use greylag_physics::State;

/// Time between the starts of two free runs, s.
pub const START_EVERY_S: f64 = 3.0;
/// A run has diverged once its scaled error (root mean square over the states of error / x_c) exceeds this bound. The scaled
/// error is 1, for example, if the error of every state equals its scale: 1 rad for angles, V0 for airspeed, and so on.
pub const DIVERGENCE_BOUND: f64 = 1.0;
/// Number of points of the growth curve, which shows the error over the time since the start of a run.
pub const GROWTH_POINTS: usize = 25;

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
            let flown: Vec<Flown> = starts
                .par_iter()
                .map(|&start| {
                    let acting = correction.map(|c| c.from(&model, flight, segment, start));
                    let wanted = Wanted { looks: &looks, keep: every, end: End::Wrong };
                    run(&model, flight, segment, start, wanted, acting)
                })
                .collect();
            for (start, Flown { looks, path, .. }) in starts.iter().zip(flown) {
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

/// Free runs of `model` along one flight, from starts every `every_s` (s) to each of `horizons_s` (s) that is recorded, with the
/// model's rates corrected by `correction`. They end as [`End::Far`] says.
pub(super) fn ahead(
    model: &GreyBox,
    flight: &Prepared,
    horizons_s: &[f64],
    every_s: f64,
    correction: Option<Correction>,
) -> Vec<Ahead> {
    let known = KnownFlight::of(model, flight);
    let (with, right) = known.as_ref().map_or((model, flight), |k| (&k.model, &k.flight));
    let flight = &*right.acting(with);
    let model = &flight.stepping(with);
    let steps = |time_s: f64| ((time_s / flight.dt).round() as usize).max(1);
    let looks: Vec<usize> = horizons_s.iter().map(|h| steps(*h)).collect();
    let measured = |state: [f64; 8]| known.as_ref().map_or(state, |known| known.as_measured(state));
    let from = |segment: &[Instant], start: usize| {
        let acting = correction.map(|c| c.from(model, flight, segment, start));
        let wanted = Wanted { looks: &looks, keep: 1, end: End::Far };
        let Flown { looks, unheld, .. } = run(model, flight, segment, start, wanted, acting);
        let pairs = looks.into_iter().flatten().map(|pair| pair.map(measured)).collect();
        Ahead { from: measured(segment[start].state.to_array()), pairs, unheld }
    };
    let of = |segment: &Vec<Instant>| {
        let starts: Vec<usize> = (0..segment.len() - 1).step_by(steps(every_s)).collect();
        starts.par_iter().map(|start| from(segment, *start)).collect::<Vec<_>>()
    };
    flight.segments.iter().flat_map(of).collect()
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
    let wanted = Wanted { looks: &[], keep, end: End::Wrong };
    let flown = run(&flight.stepping(model), flight, segment, start, wanted, None);
    let mut path = Path::default();
    for (instant, row) in segment[start..].iter().zip(flown.path) {
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
    /// Where the run ends early.
    end: End,
}

/// Where a run ends early. Both distances are scaled as errors are, and bounded by [`DIVERGENCE_BOUND`].
#[derive(Clone, Copy, PartialEq)]
pub(super) enum End {
    /// Where it is far from the measurements: it has diverged.
    Wrong,
    /// Where it is far from its start, which is known without a measurement. The last state before that is then held. The run is
    /// continued beside it, to see whether it diverges.
    Far,
}

impl End {
    /// Whether a run from the state `from` goes on with the state `predicted`, where `measured` was measured.
    pub(super) fn goes_on(
        self,
        from: &[f64; 8],
        measured: &[f64; 8],
        predicted: &[f64; 8],
        scale: &[f64; 8],
    ) -> bool {
        let near = match self {
            End::Wrong => measured,
            End::Far => from,
        };
        scaled(&error(near, predicted), scale) <= DIVERGENCE_BOUND
    }
}

/// Scaled distance from the start beyond which a run is not continued: its error counts as infinite.
const LOST: f64 = 10.0;

/// A run as flown.
#[derive(Clone, Debug, Default)]
struct Flown {
    /// Measured and predicted state at each of [`Wanted::looks`].
    looks: Vec<Look>,
    /// The predicted states of the first [`Wanted::keep`] samples.
    path: Vec<[f64; 8]>,
    /// Scaled error at each look without the hold of [`End::Far`]; infinite once the run is further than [`LOST`] from its start.
    unheld: Vec<f64>,
}

/// Integrates one run from sample `start`. Returns what is [`Wanted`].
fn run(
    model: &GreyBox,
    flight: &Prepared,
    segment: &[Instant],
    start: usize,
    Wanted { looks, keep, end }: Wanted,
    mut correction: Option<Acting>,
) -> Flown {
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
    let from = state.to_array();
    let mut flown = Flown { path: vec![from], ..Flown::default() };
    let mut held = None;
    for i in start..last.max((start + keep).min(segment.len()) - 1) {
        let before = state.to_array();
        state = advance(i, state, &mut memory);
        if let Some(correction) = &mut correction {
            let mut next = state.to_array();
            correction.act(&mut next, &segment[..=i], flight.dt);
            state = State::from_array(next);
        }
        let (measured, next) = (segment[i + 1].state.to_array(), state.to_array());
        if held.is_none() && !end.goes_on(&from, &measured, &next, &scale) {
            held = Some(before);
        }
        if let Some(held) = held
            && (end == End::Wrong || is_lost(&from, &next, &scale))
        {
            let rest = looks.iter().filter(|l| start + *l < segment.len()).skip(flown.looks.len());
            let held = |l: &usize| [segment[start + l].state.to_array(), held];
            flown.looks.extend(rest.map(|l| (end == End::Far).then(|| held(l))));
            flown.unheld.resize(flown.looks.len(), f64::INFINITY);
            break;
        }
        if flown.path.len() < keep {
            flown.path.push(next);
        }
        for _ in looks.iter().filter(|l| **l == i + 1 - start) {
            flown.looks.push(Some([measured, held.unwrap_or(next)]));
            flown.unheld.push(scaled(&error(&measured, &next), &scale));
        }
    }
    flown
}

/// Whether the state `next` of a run from the state `from` is not finite or further than [`LOST`] from it.
fn is_lost(from: &[f64; 8], next: &[f64; 8], scale: &[f64; 8]) -> bool {
    let away = scaled(&error(from, next), scale);
    away.is_nan() || away > LOST
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
}
