//! Shots: short free runs (open-loop simulations) that start at reconstructed states and use the recorded deflections.

use std::f64::consts::{PI, TAU};

use super::flight::{AIRSPEED, BLUR, Flight, OFFSETS, Own, SENSORS, SKEW};
use crate::flight_path::reconstruction::Instant;
use crate::per_flight::askew;
use crate::weak_form::prepared::Prepared;
use greylag_logs::Sampling;
use greylag_model::{GreyBox, Memory, Sloped};
use greylag_num::Real;
use greylag_physics::{Controls, State};

/// A run has diverged once its scaled error exceeds this bound. The scaled error is the root mean square, over the states, of the
/// error divided by x_c, the characteristic scale of the state.
const LEFT: f64 = 0.7;
/// Shortest shot that is fitted, s.
pub(super) const SHORTEST_S: f64 = 0.4;

/// A shot: a part of a segment that one free run of the model covers.
#[derive(Clone, Debug)]
pub(super) struct Shot {
    pub flight: usize,
    pub segment: usize,
    /// Index of the initial sample in the segment.
    pub start: usize,
    /// Number of compared samples; the initial sample is not compared.
    pub steps: usize,
    /// Weight in the cost, 0 to 1; less than 1 for an outlying shot.
    pub weight: f64,
}

/// Cuts the flights into shots of about `length_s` (s).
pub(super) fn cut(flights: &[&Flight], length_s: f64) -> Vec<Shot> {
    let mut shots = Vec::new();
    for (flight, prepared) in flights.iter().map(|f| &f.prepared).enumerate() {
        for (segment, instants) in prepared.segments.iter().enumerate() {
            let steps = instants.len() - 1;
            let pieces = ((steps as f64 * prepared.dt / length_s).round() as usize).max(1);
            let edge = |k: usize| k * steps / pieces;
            shots.extend((0..pieces).map(|k| Shot {
                flight,
                segment,
                start: edge(k),
                steps: edge(k + 1) - edge(k),
                weight: 1.0,
            }));
        }
    }
    let long = |shot: &Shot| shot.steps as f64 * flights[shot.flight].prepared.dt >= SHORTEST_S;
    shots.retain(long);
    shots
}

/// Deflections that act during each model step of each segment of a flight under `model`. The recorded deflections are
/// corrected for the delay and the blur (averaging by the recorder) in `sensors`.
pub(super) fn acting(
    model: &GreyBox,
    flight: &Prepared,
    sensors: &[f64; SENSORS],
) -> Vec<Vec<Controls>> {
    let record = [sensors[SKEW] / flight.dt, sensors[BLUR]];
    flight.segments.iter().map(|segment| act(model, flight, segment, record)).collect()
}

/// Deflections that act during each model step of a segment. Each sample has `substeps` model steps. The record is late by
/// `late` sampling intervals and has the given `blur`.
fn act(
    model: &GreyBox,
    flight: &Prepared,
    segment: &[Instant],
    [late, blur]: [f64; 2],
) -> Vec<Controls> {
    let at = |place: f64| between(segment, place + late, blur);
    let mut memory = model.at_rest(&at(0.0));
    let one = |step: usize| {
        let (k, j) = (step / flight.substeps, step % flight.substeps);
        let recorded = at(match flight.sampling {
            Sampling::Held => k as f64,
            // the middle of the step
            Sampling::Instants => k as f64 + (j as f64 + 0.5) / flight.substeps as f64,
        });
        if model.acts_at_once() { recorded } else { model.act(&recorded, &mut memory) }
    };
    (0..segment.len() * flight.substeps).map(one).collect()
}

/// Deflections at `place` (in samples) by cubic interpolation with a continuous derivative. `blur` times the second difference
/// is subtracted to correct for the averaging by the recorder.
fn between(segment: &[Instant], place: f64, blur: f64) -> Controls {
    let last = segment.len() as f64 - 1.0;
    let place = place.clamp(0.0, last);
    let (i, t) = (place.floor() as isize, place.fract());
    let sample = |j: isize| &segment[(i + j).clamp(0, last as isize) as usize].controls;
    let [a, b, c, d] = [-1, 0, 1, 2].map(sample);
    let mix = |of: fn(&Controls) -> f64| {
        let (a, b, c, d) = (of(a), of(b), of(c), of(d));
        let bend = 2.0 * a - 5.0 * b + 4.0 * c - d + t * (3.0 * (b - c) + d - a);
        let second = (1.0 - t) * (a - 2.0 * b + c) + t * (b - 2.0 * c + d);
        b + 0.5 * t * (c - a + t * bend) - blur * second
    };
    Controls {
        aileron: mix(|z| z.aileron),
        elevator: mix(|z| z.elevator),
        throttle: mix(|z| z.throttle),
        rudder: mix(|z| z.rudder),
        lagged: None,
    }
}

/// Changes of the measured state per rad of each misalignment angle.
pub(super) fn turned(flight: &Prepared, state: &[f64; 8]) -> [[f64; 8]; askew::NAMES.len()] {
    askew::state(&flight.turning, state)
}

/// Errors that a flight's sensors add to the state, from the sensor constants and misalignment angles of `own`.
pub(super) fn offset(flight: &Prepared, own: &Own, state: &[f64; 8]) -> [f64; 8] {
    let sensors = &own.sensors;
    let mut offset = [0.0; 8];
    for (k, place) in OFFSETS.iter().enumerate() {
        let unit = if *place == AIRSPEED { state[AIRSPEED] } else { 1.0 };
        offset[*place] = sensors[SKEW + 1 + k] * unit;
    }
    if own.askew.iter().any(|angle| *angle != 0.0) {
        for (angle, by) in own.askew.iter().zip(turned(flight, state)) {
            offset.iter_mut().zip(by).for_each(|(x, by)| *x += angle * by);
        }
    }
    offset
}

/// Initial state of a shot: the reconstructed state less the sensors' errors, plus the error `from` of the initial state.
pub(super) fn start(shot: &Shot, flight: &Prepared, own: &Own, from: &[f64; 8]) -> [f64; 8] {
    let measured = flight.segments[shot.segment][shot.start].state.to_array();
    let offset = offset(flight, own, &measured);
    std::array::from_fn(|k| measured[k] - offset[k] + from[k])
}

/// States of a free run at the compared samples of a shot; fewer states if the run diverges.
pub(super) fn fly(
    model: &GreyBox,
    flight: &Prepared,
    shot: &Shot,
    controls: &[Controls],
    start: [f64; 8],
) -> Vec<[f64; 8]> {
    let segment = &flight.segments[shot.segment];
    let scale = model.scale();
    let mut memory = Memory::default();
    let model = flight.stepping(model);
    let advance = |k: usize, state: State, memory: &mut Memory| {
        let altitude = segment[k].altitude;
        let steps = &controls[k * flight.substeps..(k + 1) * flight.substeps];
        steps.iter().fold(state, |s, controls| model.step(&s, controls, altitude, memory))
    };
    if let Some(before) = shot.start.checked_sub(1) {
        // the integrator uses the acceleration of the preceding step
        advance(before, segment[before].state, &mut memory);
    }
    let mut state = State::from_array(start);
    let mut path = Vec::with_capacity(shot.steps);
    for k in shot.start..shot.start + shot.steps {
        state = advance(k, state, &mut memory);
        let now = state.to_array();
        if diverged(&segment[k + 1], &now, &scale) {
            break;
        }
        path.push(now);
    }
    path
}

/// Whether the error of the predicted state `now` at the sample `measured` exceeds the bound of a run. NaN also ends a run.
fn diverged(measured: &Instant, now: &[f64; 8], scale: &[f64; 8]) -> bool {
    let error = error(&measured.state.to_array(), now);
    let mean = error.iter().zip(scale).map(|(e, x)| (e / x).powi(2)).sum::<f64>() / 8.0;
    mean.is_nan() || mean > LEFT * LEFT
}

/// Makes the run of [`fly`] with derivatives. `variables` are the coefficients that are variables, as for
/// [`GreyBox::step_sloped`]. `controls` returns the deflections of a model step of the segment.
///
/// `seen` receives the number of each compared sample, from 0, and the state there. After divergence it receives the last state
/// again, because the residuals keep their last value. If the run diverges in its first step, `seen` is not called.
pub(super) fn fly_sloped(
    (model, variables): (&GreyBox, &[Option<usize>]),
    flight: &Prepared,
    shot: &Shot,
    controls: impl Fn(usize) -> Controls<Sloped>,
    start: [Sloped; 8],
    mut seen: impl FnMut(usize, &[Sloped; 8]),
) {
    let segment = &flight.segments[shot.segment];
    let scale = model.scale();
    let mut memory = Memory::default();
    let model = flight.stepping(model);
    let advance = |k: usize, state: State<Sloped>, memory: &mut Memory<Sloped>| {
        let altitude = segment[k].altitude;
        let steps = k * flight.substeps..(k + 1) * flight.substeps;
        steps.fold(state, |s, step| {
            model.step_sloped(variables, &s, &controls(step), altitude, memory)
        })
    };
    if let Some(before) = shot.start.checked_sub(1) {
        advance(before, segment[before].state.map(Sloped::from_f64), &mut memory);
    }
    let (mut state, mut reached) = (State::from_array(start), 0);
    for k in 0..shot.steps {
        let next = advance(shot.start + k, state, &mut memory);
        let now = next.to_array();
        if diverged(&segment[shot.start + k + 1], &now.map(|x| x.value), &scale) {
            break;
        }
        seen(k, &now);
        (state, reached) = (next, k + 1);
    }
    if reached > 0 {
        (reached..shot.steps).for_each(|k| seen(k, &state.to_array()));
    }
}

/// Predicted − measured states, in the units of the state, with roll wrapped to ±π. The weak form and the report use the
/// opposite sign.
pub(super) fn error(measured: &[f64; 8], predicted: &[f64; 8]) -> [f64; 8] {
    let mut error: [f64; 8] = std::array::from_fn(|k| predicted[k] - measured[k]);
    error[0] = (error[0] + PI).rem_euclid(TAU) - PI;
    error
}

/// Predicted − measured states at the compared samples of a shot. The sensors' errors are added to the prediction. After
/// divergence, the residual keeps its last value. `scale` is the reference scale x_c of the state.
pub(super) fn residuals(
    flight: &Prepared,
    shot: &Shot,
    own: &Own,
    scale: &[f64; 8],
    path: &[[f64; 8]],
) -> Vec<[f64; 8]> {
    let segment = &flight.segments[shot.segment];
    // a run that diverges in its first step gets the error at which a run counts as diverged
    let mut last = scale.map(|x| LEFT * x);
    (0..shot.steps)
        .map(|k| {
            if let Some(predicted) = path.get(k) {
                let measured = segment[shot.start + 1 + k].state.to_array();
                let offset = offset(flight, own, &measured);
                let seen = std::array::from_fn(|i| predicted[i] + offset[i]);
                last = error(&measured, &seen);
            }
            last
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_of_means_is_undone() {
        // 3 Hz at 100 samples per second; each record is the mean of two adjacent samples and therefore half a sample late
        let true_value = |k: usize| (0.19 * k as f64).sin();
        let instant = |k: usize| {
            let aileron = 0.5 * (true_value(k) + true_value(k.saturating_sub(1)));
            let controls =
                Controls { aileron, elevator: 0.0, throttle: 0.0, rudder: 0.0, lagged: None };
            Instant {
                time_s: 0.01 * k as f64,
                state: State::from_array([0.0; 8]),
                yaw: 0.0,
                controls,
                command: None,
                specific_force: [0.0; 3],
                altitude: 0.0,
                density: 1.225,
            }
        };
        let record: Vec<Instant> = (0..60).map(instant).collect();
        let worst = |blur: f64| {
            let error =
                |k: usize| (between(&record, k as f64 + 0.5, blur).aileron - true_value(k)).abs();
            (10..50).map(error).fold(0.0, f64::max)
        };
        // the mean reduces the amplitude by (0.19)²/8 = 0.5 %; after the second-order correction, 0.19⁴ · 5/128 = 5e-5 remain
        assert!(worst(0.0) > 4e-3, "{}", worst(0.0));
        assert!(worst(0.125) < 2e-4, "{}", worst(0.125));
    }
}
