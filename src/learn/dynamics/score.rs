//! Errors of a model in free runs (open-loop simulations) along recorded flights, as a function of the horizon. The horizon is
//! the length of a run. A track is a section of a flight without gaps.

use rayon::prelude::*;

use crate::dynamics::windows::{Track, Window, windows};
use greylag_model::{GreyBox, Memory};

/// Interval between the starts of consecutive runs along a track, steps of 10 ms.
const EVERY: usize = 50;

/// Limit of the error of a run, which is relative to the characteristic scale x_c of each state. A run at the limit counts as
/// diverged.
const BOUND: f64 = 1.0;

/// The error at one horizon.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Horizon {
    /// Horizon in steps of 10 ms.
    pub steps: usize,
    /// Number of runs that reach this horizon.
    pub runs: usize,
    /// RMS over the runs of the error at the end of a run. This error is the RMS over the eight states of (ŝ − s)/x_c, limited to
    /// 1. Here ŝ is the predicted state, s the recorded state and x_c the characteristic scale of the states, eq. (21).
    pub rms: f64,
    /// Median over the runs of the same error.
    pub median: f64,
    /// Fraction of the runs whose error reaches the limit of 1.
    pub lost: f64,
}

/// Errors of `model` in free runs along `tracks` with the recorded inputs, for each of `horizons` (steps).
pub fn free_run(model: &GreyBox, tracks: &[Track], horizons: &[usize]) -> Vec<Horizon> {
    horizons.iter().map(|steps| horizon(model, tracks, *steps)).collect()
}

fn horizon(model: &GreyBox, tracks: &[Track], steps: usize) -> Horizon {
    let starts: Vec<Window> =
        windows(tracks, steps).into_iter().filter(|w| w.start as usize % EVERY == 1).collect();
    let mut errors: Vec<f64> =
        starts.par_iter().map(|w| off_after(model, tracks, w, steps)).collect();
    errors.sort_by(f64::total_cmp);
    let runs = errors.len();
    let mean = errors.iter().map(|e| e * e).sum::<f64>() / runs as f64;
    let lost = errors.iter().filter(|e| **e >= BOUND).count() as f64 / runs as f64;
    Horizon {
        steps,
        runs,
        rms: mean.sqrt(),
        median: errors.get(runs / 2).copied().unwrap_or(f64::NAN),
        lost,
    }
}

/// The error of one run of `steps` steps from the start of `window`: the root mean square over the states of (ŝ − s)/x_c,
/// limited to 1.
pub(crate) fn off_after(model: &GreyBox, tracks: &[Track], window: &Window, steps: usize) -> f64 {
    let (track, start) = (&tracks[window.track as usize], window.start as usize);
    let mut memory = Memory::default();
    let advance = |k: usize, state, memory: &mut Memory| {
        model.step(&state, &track.controls[k], track.altitude[k], memory)
    };
    // the integrator needs the acceleration of the step before the start
    advance(start - 1, track.states[start - 1], &mut memory);
    let mut state = track.states[start];
    for k in start..start + steps {
        state = advance(k, state, &mut memory);
    }
    let (seen, scale) = (track.states[start + steps].to_array(), model.scale());
    let mut error: [f64; 8] = std::array::from_fn(|i| state.to_array()[i] - seen[i]);
    let turn = std::f64::consts::TAU;
    error[0] = (error[0] + 0.5 * turn).rem_euclid(turn) - 0.5 * turn;
    let mean = (0..8).map(|i| (error[i] / scale[i]).powi(2)).sum::<f64>() / 8.0;
    // a run whose state is not finite has diverged
    if mean.is_finite() { mean.sqrt().min(BOUND) } else { BOUND }
}
