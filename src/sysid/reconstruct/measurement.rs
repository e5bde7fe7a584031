//! The measured part: what the sensors show of the path, with their errors.

use nalgebra::{RowSVector, SVector, Vector3};

use super::band::{Corner, CornerVector, NODE, Row};
use super::channel::wrap;
use super::intake::Track;
use super::nuisance::{
    ALPHA, BETA, COUNT, SCALE, SKEW_AIRSPEED, SKEW_ATTITUDE, SKEW_VANES, SKEW_VELOCITY, Values,
    WIND,
};
use super::path::{CHANNELS, Path, SLOW};
use super::rotation::{cross, euler_by_turn};

/// How a channel depends on the path at an instant and on the constants besides its delay.
struct Slope {
    node: RowSVector<f64, NODE>,
    constants: SVector<f64, COUNT>,
}

/// The constants' share in the normal equations, and the sum of squares.
pub struct Sums<'a> {
    /// Information.
    pub matrix: &'a mut Corner,
    /// Right-hand side.
    pub right: &'a mut CornerVector,
    /// Sum of weighted squares.
    pub cost: &'a mut f64,
}

/// The delay that a channel is read with.
pub fn skew_of(channel: usize) -> usize {
    match channel {
        0..3 => SKEW_ATTITUDE,
        3 => SKEW_AIRSPEED,
        4 | 5 => SKEW_VANES,
        _ => SKEW_VELOCITY,
    }
}

/// The measurement of a channel at sample `k`; NaN if there is none.
pub fn measured(track: &Track, channel: usize, k: usize) -> f64 {
    match channel {
        0..3 => track.attitude[k][channel],
        3 => track.airspeed[k],
        4 | 5 => track.vanes[k][channel - 4],
        _ => track.velocity[k][channel - 6],
    }
}

/// Adds the measurements of `track` to the normal equations. `spread` holds the standard deviations
/// of the channels; a residual beyond `bound` of them counts less. `residuals` receives every residual.
#[expect(clippy::too_many_arguments, reason = "one call site; a struct would only rename them")]
pub fn add(
    track: &Track,
    path: &Path,
    values: &Values,
    step: f64,
    spread: &[f64; CHANNELS],
    bound: f64,
    rows: &mut [Row],
    sums: &mut Sums,
    residuals: &mut [Vec<f64>; CHANNELS],
) {
    let shown: Vec<[f64; CHANNELS]> = (0..path.len()).map(|k| path.shown(k)).collect();
    for j in 1..path.len() - 1 {
        let slopes = slopes(path, j, shown[j], values);
        for (channel, slope) in slopes.iter().enumerate() {
            let Some(slope) = slope else { continue };
            let late = values[skew_of(channel)] / step;
            let whole = late.round();
            let data = j as isize + whole as isize;
            if data < 0 || data as usize >= path.len() {
                continue;
            }
            let y = measured(track, channel, data as usize);
            if y.is_nan() {
                continue;
            }
            let angle = |x: f64| if channel < 3 { wrap(x) } else { x };
            let h = shown[j][channel];
            let (ahead, behind) =
                (angle(shown[j + 1][channel] - h), angle(h - shown[j - 1][channel]));
            let (rate, bend, part) = ((ahead + behind) * 0.5, ahead - behind, whole - late);
            let h = h + rate * part + 0.5 * bend * part * part;
            let (h, gain) = with_errors(channel, h, values);
            let residual = angle(y - h);
            residuals[channel].push(residual);
            let size = (residual / spread[channel]).abs();
            let weight = (bound / size).min(1.0) / spread[channel].powi(2);
            let mut constants = slope.constants;
            constants[skew_of(channel)] = -gain * (rate + bend * part) / step;
            accumulate(&mut rows[j], sums, &slope.node, &constants, residual, weight);
        }
    }
}

fn accumulate(
    row: &mut Row,
    sums: &mut Sums,
    node: &RowSVector<f64, NODE>,
    constants: &SVector<f64, COUNT>,
    residual: f64,
    weight: f64,
) {
    let weighted = node.transpose() * weight;
    row.own += weighted * node;
    row.right += weighted * residual;
    for place in 0..COUNT {
        let by = constants[place];
        if by != 0.0 {
            row.border.column_mut(place).axpy(by, &weighted, 1.0);
            sums.right[place] += weight * by * residual;
            sums.matrix.column_mut(place).axpy(weight * by, constants, 1.0);
        }
    }
    *sums.cost += weight * residual * residual;
}

/// What a sensor with its errors shows where one without shows `h`, and the gain from one to the other.
fn with_errors(channel: usize, h: f64, values: &Values) -> (f64, f64) {
    match channel {
        3 => (h * (1.0 + values[SCALE]), 1.0 + values[SCALE]),
        4 => (h + values[ALPHA], 1.0),
        5 => (h + values[BETA], 1.0),
        _ => (h, 1.0),
    }
}

/// How every channel depends on the path at sample `k`; `None` where it says nothing.
fn slopes(
    path: &Path,
    k: usize,
    shown: [f64; CHANNELS],
    values: &Values,
) -> [Option<Slope>; CHANNELS] {
    let body = path.attitude[k].transpose();
    let u = path.air_velocity(k);
    let (v, plane) = (u.norm(), u.x.hypot(u.z));
    let by_turn = cross(&u);
    let none = SVector::<f64, COUNT>::zeros();
    let through = |g: Vector3<f64>, place: usize, by: f64| {
        let mut node = RowSVector::<f64, NODE>::zeros();
        node.fixed_columns_mut::<3>(0).copy_from(&(g.transpose() * by_turn));
        let slope = g.transpose() * body;
        node.fixed_columns_mut::<3>(3).copy_from(&slope);
        node.fixed_columns_mut::<3>(6).copy_from(&-slope);
        let mut constants = SVector::<f64, COUNT>::zeros();
        constants.fixed_rows_mut::<3>(WIND).copy_from(&-slope.transpose());
        constants[place] = by;
        Slope { node, constants }
    };
    let euler = euler_by_turn([shown[0], shown[1], shown[2]]);
    std::array::from_fn(|channel| match channel {
        0..3 => euler.map(|euler| {
            let mut node = RowSVector::<f64, NODE>::zeros();
            node.fixed_columns_mut::<3>(0).copy_from(&euler.row(channel));
            Slope { node, constants: none }
        }),
        3..6 if plane < SLOW => None,
        3 => {
            let gain = 1.0 + values[SCALE];
            Some(through(u * (gain / v), SCALE, v))
        }
        4 => {
            let g = Vector3::new(-u.z, 0.0, u.x) / (plane * plane);
            Some(through(g, ALPHA, 1.0))
        }
        5 => {
            let g = (Vector3::new(0.0, 1.0, 0.0) - u * (u.y / (v * v))) / plane;
            Some(through(g, BETA, 1.0))
        }
        _ => {
            let mut node = RowSVector::<f64, NODE>::zeros();
            node[channel - 3] = 1.0;
            Some(Slope { node, constants: none })
        }
    })
}
