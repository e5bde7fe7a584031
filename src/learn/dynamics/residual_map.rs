//! Map of the learned residual: its magnitude in each channel and in each flight condition.
//!
//! The residual is the network that adds state rates F_a to the rates F_p of the physical effects (the prior). x_c is the
//! reference scale of the state, eq. (21) of \[GSFM26\] (T. Guerin et al., 2026, see `src/lib.rs`). A channel is one of the eight
//! state rates. A regime variable describes the flight condition: angle of attack, sideslip or airspeed.

use rayon::prelude::*;
use serde::Serialize;

use crate::dynamics::windows::{Track, regular};
use greylag_model::GreyBox;
use greylag_physics::State;

/// Names of the channels, in the order of [`State::to_array`].
pub const CHANNELS: [&str; 8] = ["roll", "pitch", "airspeed", "p", "q", "r", "alpha", "beta"];

/// Number of bins of a regime variable.
const BINS: usize = 10;

/// Smallest number of samples in a bin. Bins with fewer samples are omitted.
const SUPPORT: usize = 20;

/// Statistics of a residual at the states of recorded flights.
#[derive(Clone, Debug, Serialize)]
pub struct ResidualMap {
    /// Root mean square of ‖F_a/x_c‖ over all samples, divided by that of ‖F_p/x_c‖, eq. (22).
    pub ratio: f64,
    /// Magnitude of each channel's residual.
    pub channels: Vec<Share>,
    /// Each channel's F_a/x_c (1/s) over each regime variable.
    pub curves: Vec<Curve>,
    /// Root mean square of ‖F_a/x_c‖ (1/s) in cells of angle of attack and sideslip.
    pub map: Vec<Cell>,
}

/// Magnitude of a channel's residual.
#[derive(Clone, Debug, Serialize)]
pub struct Share {
    /// Name of the channel.
    pub channel: &'static str,
    /// Root mean square of F_p/x_c, 1/s.
    pub prior: f64,
    /// Root mean square of F_a/x_c, 1/s.
    pub learned: f64,
    /// Name and edges (degrees, m/s) of the bin in which the residual is largest relative to the mean over the bins of its
    /// regime variable. `None` if no bin has enough samples.
    pub strongest: Option<(&'static str, [f64; 2])>,
}

/// A channel's residual over a regime variable.
#[derive(Clone, Debug, Serialize)]
pub struct Curve {
    /// Name of the channel.
    pub channel: &'static str,
    /// Name of the regime variable.
    pub over: &'static str,
    /// For each bin: centre (degrees, m/s), mean and root mean square of F_a/x_c (1/s). Bins of fewer than 20 samples are
    /// omitted.
    pub points: Vec<[f64; 3]>,
}

/// A cell of the map over angle of attack and sideslip.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Cell {
    /// Angle of attack at the centre, degrees.
    pub alpha_deg: f64,
    /// Angle of sideslip at the centre, degrees.
    pub beta_deg: f64,
    /// Root mean square of ‖F_a/x_c‖ in the cell, 1/s.
    pub norm: f64,
    /// Number of samples in the cell.
    pub samples: usize,
}

/// The regime variables with their ranges: degrees, m/s.
const REGIMES: [(&str, [f64; 2]); 3] =
    [("alpha_deg", [-15.0, 35.0]), ("beta_deg", [-30.0, 30.0]), ("airspeed_mps", [8.0, 38.0])];

/// Half width of a cell over α and over β, degrees.
pub const HALF_CELL_DEG: [f64; 2] = [25.0 / BINS as f64, 30.0 / BINS as f64];

fn regime(state: &State) -> [f64; 3] {
    [state.alpha.to_degrees(), state.beta.to_degrees(), state.airspeed]
}

/// A sample: the values of the regime variables, F_p/x_c and F_a/x_c.
type Row = ([f64; 3], [f64; 8], [f64; 8]);

/// The residual map of `model` at the states of `tracks`; `None` if `model` has no residual or no state is usable.
pub fn residual_map(model: &GreyBox, tracks: &[Track]) -> Option<ResidualMap> {
    let residual = model.residual.as_ref()?;
    let mut bare = model.clone();
    bare.residual = None;
    let scale = model.scale();
    let rows: Vec<Row> = tracks
        .par_iter()
        .flat_map_iter(|t| (0..t.states.len()).map(move |k| (t, k)))
        .filter(|(t, k)| regular(&t.states[*k]))
        .map(|(t, k)| {
            let (state, controls) = (&t.states[k], &t.controls[k]);
            let prior = bare.rate(state, controls, t.altitude[k]).to_array();
            let learned = residual.rate(state, controls).to_array();
            let scaled = |x: [f64; 8]| std::array::from_fn(|i| x[i] / scale[i]);
            (regime(state), scaled(prior), scaled(learned))
        })
        .collect();
    if rows.is_empty() {
        return None;
    }
    let rms = |get: &dyn Fn(&Row) -> f64| {
        (rows.iter().map(|r| get(r).powi(2)).sum::<f64>() / rows.len() as f64).sqrt()
    };
    let norm = |x: &[f64; 8]| x.iter().map(|x| x * x).sum::<f64>().sqrt();
    let curves: Vec<Curve> =
        (0..8).flat_map(|c| (0..3).map(move |v| (c, v))).map(|(c, v)| curve(&rows, c, v)).collect();
    let share = |c: usize| Share {
        channel: CHANNELS[c],
        prior: rms(&|r| r.1[c]),
        learned: rms(&|r| r.2[c]),
        strongest: strongest(&curves[3 * c..3 * c + 3]),
    };
    Some(ResidualMap {
        ratio: rms(&|r| norm(&r.2)) / rms(&|r| norm(&r.1)),
        channels: (0..8).map(share).collect(),
        map: map(&rows),
        curves,
    })
}

/// The bin of `x`, a value of the regime variable with the range `low` to `high`; `None` outside the range.
fn bin(x: f64, [low, high]: [f64; 2]) -> Option<usize> {
    let place = (x - low) / (high - low) * BINS as f64;
    (place >= 0.0 && place < BINS as f64).then_some(place as usize)
}

fn middle(bin: usize, [low, high]: [f64; 2]) -> f64 {
    low + (high - low) * (bin as f64 + 0.5) / BINS as f64
}

fn curve(rows: &[Row], channel: usize, variable: usize) -> Curve {
    let (over, range) = REGIMES[variable];
    let mut sums = [[0.0; 3]; BINS];
    for (at, _, learned) in rows {
        if let Some(bin) = bin(at[variable], range) {
            let x = learned[channel];
            for (sum, part) in sums[bin].iter_mut().zip([1.0, x, x * x]) {
                *sum += part;
            }
        }
    }
    let points = (0..BINS)
        .filter(|b| sums[*b][0] >= SUPPORT as f64)
        .map(|b| {
            let [n, mean, square] = sums[b];
            [middle(b, range), mean / n, (square / n).sqrt()]
        })
        .collect();
    Curve { channel: CHANNELS[channel], over, points }
}

/// Name and edges of the bin whose root mean square is largest relative to the mean over the bins of its regime variable.
fn strongest(curves: &[Curve]) -> Option<(&'static str, [f64; 2])> {
    let mut best: Option<(f64, &str, [f64; 2])> = None;
    for (curve, (over, [low, high])) in curves.iter().zip(REGIMES) {
        let count = curve.points.len() as f64;
        let mean = curve.points.iter().map(|p| p[2]).sum::<f64>() / count;
        let half = (high - low) / BINS as f64 / 2.0;
        for [middle, _, rms] in &curve.points {
            let contrast = rms / mean;
            if contrast.is_finite() && best.is_none_or(|(c, ..)| contrast > c) {
                best = Some((contrast, over, [middle - half, middle + half]));
            }
        }
    }
    best.map(|(_, over, edges)| (over, edges))
}

fn map(rows: &[Row]) -> Vec<Cell> {
    let mut sums = [[[0.0; 2]; BINS]; BINS];
    for (at, _, learned) in rows {
        if let (Some(a), Some(b)) = (bin(at[0], REGIMES[0].1), bin(at[1], REGIMES[1].1)) {
            sums[a][b][0] += 1.0;
            sums[a][b][1] += learned.iter().map(|x| x * x).sum::<f64>();
        }
    }
    let mut cells = Vec::new();
    for (a, row) in sums.iter().enumerate() {
        for (b, [count, square]) in row.iter().enumerate() {
            if *count >= SUPPORT as f64 {
                cells.push(Cell {
                    alpha_deg: middle(a, REGIMES[0].1),
                    beta_deg: middle(b, REGIMES[1].1),
                    norm: (square / count).sqrt(),
                    samples: *count as usize,
                });
            }
        }
    }
    cells
}
