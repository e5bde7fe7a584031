//! Measurement equations of the flight-path reconstruction: sensor values predicted from the estimated path and the sensors'
//! errors. The constants of a flight are its sensor errors and its wind. A constant acts at instants if it changes a predicted
//! value directly, as the bias of a vane does. The biases of gyros and accelerometers instead act through the integration of the
//! path.

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use crate::flight_path::band::{Corner, Node, add_gram, add_upper_gram};
use crate::flight_path::channel::{cubic, wrap};
use crate::flight_path::intake::Track;
use crate::flight_path::kinematics::MOTION_AND_GUST;
use crate::flight_path::lever_arm::air_at;
use crate::flight_path::nuisance::{
    AIRSPEED_OFFSET, ALPHA, BETA, BOARD_ROLL, HEADING, INERTIAL, SCALE, SKEW_AIRSPEED,
    SKEW_ATTITUDE, SKEW_VANES, SKEW_VELOCITY, VANE_GAIN, Values, WIND,
};
use crate::flight_path::path::{CHANNELS, Path, SLOW, flow_angles};
use crate::flight_path::rotation::{cross, euler_by_turn, to_euler, unrolled};

/// Number of columns for the constants that act at instants and for the right-hand side.
pub const AT: usize = INERTIAL + 1;
/// Number of additional right-hand sides for which the equations are solved at once.
pub const OTHERS: usize = 16;
/// Residuals of a channel, one for each additional right-hand side. They are simulated noise, in single precision because those of a
/// long flight would be the largest list in memory.
pub type Others = [f32; OTHERS];

/// Measured less predicted values of an instant, by channel, rad or m/s; NaN without a measurement.
pub type Residuals = [f64; CHANNELS];

/// Number of instants whose predictions are in memory at a time: those of all instants of a long flight would take much memory.
pub const PIECE: usize = 16_384;

/// Number of instants on either side of an instant whose predictions its reading needs.
const BESIDE: usize = 2;

/// Measurements of an instant less their predictions.
#[derive(Clone, Copy, Debug)]
pub struct Reading {
    /// Measured less predicted values.
    pub residual: Residuals,
    /// Derivatives of the predictions with respect to the delay of each channel, rad/s or m/s².
    by_late: [f64; CHANNELS],
}

impl Reading {
    /// This reading with `residuals` in the channels that have measurements.
    pub fn with(mut self, residuals: Residuals) -> Reading {
        for (residual, other) in self.residual.iter_mut().zip(residuals) {
            *residual = if residual.is_nan() { f64::NAN } else { other };
        }
        self
    }
}

/// Index of the constant that is the delay of a channel.
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

/// Derivatives of airspeed, α and β at the vanes with respect to the velocity `u` relative to the air (m/s, axes of the board, which
/// is rolled by `roll` against the vanes, rad). `None` at low airspeed.
fn air_slopes(u: &Vector3<f64>, roll: f64) -> Option<Matrix3<f64>> {
    let seen = unrolled(u, roll);
    let (v, plane) = (u.norm(), seen.x.hypot(seen.z));
    (plane >= SLOW).then(|| {
        let beta = (Vector3::y() - seen * (seen.y / (v * v))) / plane;
        let p2 = plane * plane;
        let alpha = Vector3::new(-seen.z / p2, 0.0, seen.x / p2);
        let [alpha, beta] = [alpha, beta].map(|slope| unrolled(&slope, -roll));
        Matrix3::from_columns(&[u / v, alpha, beta]).transpose()
    })
}

/// Sets the derivatives of airspeed, α and β with respect to the errors of their sensors. `u` is the velocity relative to the air
/// (m/s, axes of the board), `from` the column of the first constant.
fn by_errors<const M: usize>(
    u: &Vector3<f64>,
    values: &Values,
    from: usize,
    constants: &mut [[f64; M]; CHANNELS],
) {
    constants[3][from + SCALE] = u.norm();
    constants[3][from + AIRSPEED_OFFSET] = 1.0;
    (constants[4][from + ALPHA], constants[5][from + BETA]) = (1.0, 1.0);
    let seen = unrolled(u, values[BOARD_ROLL]);
    let plane = seen.x.hypot(seen.z);
    let rolls = [seen.x * seen.y / (plane * plane), -seen.z / plane];
    let angles = flow_angles(&seen);
    for vane in 0..2 {
        let gain = VANE_GAIN + vane;
        constants[4 + vane][from + gain] = angles[vane];
        constants[4 + vane][from + BOARD_ROLL] = rolls[vane] * (1.0 + values[gain]);
    }
}

/// Values of error-free sensors at sample `k`, by channel. The vanes are at the position `vanes_at` (m from the centre of
/// gravity, body axes), and the board is rolled by `board_roll` (rad) against them.
fn shown(
    path: &Path,
    k: usize,
    rates: &[f64; 3],
    vanes_at: Option<[f64; 3]>,
    board_roll: f64,
) -> [f64; CHANNELS] {
    let [roll, pitch, yaw] = to_euler(&path.attitude[k]);
    let u = path.air_velocity(k);
    let at_vanes = vanes_at.map(|at| air_at(&u, &Vector3::from(*rates), at));
    let [alpha, beta] = flow_angles(&unrolled(&at_vanes.unwrap_or(u), board_roll));
    let ground = path.velocity[k];
    [roll, pitch, yaw, u.norm(), alpha, beta, ground.x, ground.y, ground.z]
}

/// Converts derivatives of true air data to derivatives of measured air data.
fn scale(slopes: &mut Matrix3<f64>, values: &Values) {
    for (row, place) in [SCALE, VANE_GAIN, VANE_GAIN + 1].into_iter().enumerate() {
        slopes.row_mut(row).scale_mut(1.0 + values[place]);
    }
}

/// Derivatives of measured airspeed, α and β with respect to a gust at sample `k`, earth axes. `None` at low airspeed.
pub fn by_gust(path: &Path, k: usize, values: &Values) -> Option<Matrix3<f64>> {
    let mut slopes = air_slopes(&path.air_velocity(k), values[BOARD_ROLL])?;
    scale(&mut slopes, values);
    Some(slopes * -path.attitude[k].transpose())
}

/// The sensors of a track, with their errors.
#[derive(Clone, Copy)]
pub struct Instruments<'a> {
    /// The measurements.
    pub track: &'a Track,
    /// The constants of the flight, each in its unit.
    pub values: &'a Values,
    /// Sampling interval, s.
    pub step: f64,
    /// Position of the vanes, m from the centre of gravity, body axes, if it is known.
    pub vanes_at: Option<[f64; 3]>,
}

impl<'a> Instruments<'a> {
    /// Readings at every sample along `path`.
    pub fn readings(&self, path: &Path) -> Vec<Reading> {
        let mut all: Vec<Reading> = Vec::with_capacity(path.len());
        for from in (0..path.len()).step_by(PIECE) {
            let to = (from + PIECE).min(path.len());
            let predicted = self.predicted(path, from, to);
            let samples = (from..to).into_par_iter().with_min_len(1000);
            all.par_extend(samples.map(|k| predicted.reading(k)));
        }
        all
    }

    /// Residuals along `path` at `count` samples from the sample `from` on, or at fewer where the path ends.
    pub fn residuals(&self, path: &Path, from: usize, count: usize) -> Vec<Residuals> {
        let to = (from + count).min(path.len());
        let predicted = self.predicted(path, from, to);
        let samples = (from..to).into_par_iter().with_min_len(1000);
        samples.map(|k| predicted.reading(k).residual).collect()
    }

    /// Predictions for the readings at the samples from `from` to `to`, the last one excluded.
    fn predicted(&self, path: &Path, from: usize, to: usize) -> Predicted<'a> {
        let (first, end) = (from.saturating_sub(BESIDE), (to + BESIDE).min(path.len()));
        let roll = self.values[BOARD_ROLL];
        let of = |k: usize| shown(path, k, &self.track.rates[k], self.vanes_at, roll);
        let samples = (first..end).into_par_iter().with_min_len(1000);
        Predicted { sensors: *self, count: path.len(), first, shown: samples.map(of).collect() }
    }
}

/// Predictions for the sensors along a part of a path, from which the readings follow.
struct Predicted<'a> {
    sensors: Instruments<'a>,
    /// Number of samples of the whole path.
    count: usize,
    /// Index of the first sample in `shown`.
    first: usize,
    /// Values of error-free sensors.
    shown: Vec<[f64; CHANNELS]>,
}

impl Predicted<'_> {
    /// The reading at sample `j`.
    fn reading(&self, j: usize) -> Reading {
        let Instruments { track, values, step, .. } = self.sensors;
        let mut reading = Reading { residual: [f64::NAN; CHANNELS], by_late: [0.0; CHANNELS] };
        let n = self.count;
        if j == 0 || j + 1 >= n {
            return reading;
        }
        for channel in 0..CHANNELS {
            let late = values[skew_of(channel)] / step;
            let whole = late.round();
            let data = j as isize + whole as isize;
            if data < 0 || data as usize >= n {
                continue;
            }
            let y = measured(track, channel, data as usize);
            if y.is_nan() {
                continue;
            }
            let (h, slope) = self.seen_at(channel, j, whole - late);
            let (h, gain) = with_errors(channel, h, values);
            reading.residual[channel] = turn(channel, y - h);
            reading.by_late[channel] = -gain * slope / step;
        }
        reading
    }

    /// Value of an error-free sensor at the time `part` (−0.5 to 0.5) sampling intervals after sample `j`, and its slope per sampling
    /// interval.
    fn seen_at(&self, channel: usize, j: usize, part: f64) -> (f64, f64) {
        let shown = |k: usize| self.shown[k - self.first][channel];
        let (here, last) = (shown(j), self.count as isize - 1);
        let beside = |i: isize| turn(channel, shown(i.clamp(0, last) as usize) - here);
        let whole = part.floor();
        let i = j as isize + whole as isize;
        let (beside, slope) = cubic([i - 1, i, i + 1, i + 2].map(beside), part - whole);
        (here + beside, slope)
    }
}

/// A difference of a channel's values, wrapped to ±π for attitude angles.
fn turn(channel: usize, x: f64) -> f64 {
    if channel < 3 { wrap(x) } else { x }
}

/// Value of a sensor with its errors for the error-free value `h`, and the derivative with respect to `h`.
fn with_errors(channel: usize, h: f64, values: &Values) -> (f64, f64) {
    match channel {
        2 => (h + values[HEADING], 1.0),
        3 => (h * (1.0 + values[SCALE]) + values[AIRSPEED_OFFSET], 1.0 + values[SCALE]),
        4 => (h * (1.0 + values[VANE_GAIN]) + values[ALPHA], 1.0 + values[VANE_GAIN]),
        5 => (h * (1.0 + values[VANE_GAIN + 1]) + values[BETA], 1.0 + values[VANE_GAIN + 1]),
        _ => (h, 1.0),
    }
}

/// Adds the reading of sample `k` to the equations.
///
/// `spread` holds the standard deviations of the channels. A residual beyond `bound` standard deviations is down-weighted.
/// The first columns are `others`, additional residuals of the air-data sensors. The columns of the constants that act at
/// instants follow. With `M` = 1 the constants are held and have no columns.
#[expect(clippy::too_many_arguments, reason = "one call site; a struct would only rename them")]
pub fn add<const N: usize, const W: usize, const M: usize>(
    path: &Path,
    values: &Values,
    k: usize,
    reading: &Reading,
    spread: &[f64; CHANNELS],
    bound: f64,
    others: Option<&[Others; 3]>,
    node: &mut Node<N, W>,
    corner: Option<&mut Corner<W>>,
) {
    if reading.residual.iter().all(|x| x.is_nan()) {
        return;
    }
    let (by_node, by_constants) = slopes::<N, M>(path, k, values, reading);
    let (mut nodes, mut rests) = ([[0.0; N]; CHANNELS], [[0.0; M]; CHANNELS]);
    for channel in 0..CHANNELS {
        let residual = reading.residual[channel];
        let Some(slope) = by_node[channel].filter(|_| !residual.is_nan()) else { continue };
        let size = (residual / spread[channel]).abs();
        let weight = (bound / size).min(1.0).sqrt() / spread[channel];
        nodes[channel] = slope.map(|x| x * weight);
        rests[channel] = by_constants[channel].map(|x| x * weight);
        rests[channel][M - 1] = residual * weight;
        if let (3..6, Some(others)) = (channel, others) {
            let columns = rests[channel].iter_mut().zip(&others[channel - 3]);
            columns.for_each(|(x, other)| *x = f64::from(*other) * weight);
        }
    }
    add_gram(&mut node.own, &nodes, &nodes);
    let mut coupling = [[0.0; M]; N];
    add_gram(&mut coupling, &nodes, &rests);
    for (row, coupling) in node.rest.iter_mut().zip(&coupling) {
        spill(row, coupling);
    }
    let Some(corner) = corner else { return };
    let mut own = [[0.0; M]; M];
    add_upper_gram(&mut own, &rests);
    for (i, own) in own.iter().enumerate() {
        spill(&mut corner[if i + 1 == M { W - 1 } else { i }], own);
    }
}

/// Adds `part` to `row`: the last column to the last column, the other columns to the first columns.
fn spill<const M: usize, const W: usize>(row: &mut [f64; W], part: &[f64; M]) {
    row.iter_mut().zip(&part[..M - 1]).for_each(|(x, y)| *x += y);
    row[W - 1] += part[M - 1];
}

/// Derivatives of every channel with respect to the path at sample `k` and to the constants. `None` for a singular channel:
/// Euler angles near vertical pitch, or air data at low airspeed.
fn slopes<const N: usize, const M: usize>(
    path: &Path,
    k: usize,
    values: &Values,
    reading: &Reading,
) -> ([Option<[f64; N]>; CHANNELS], [[f64; M]; CHANNELS]) {
    let body = path.attitude[k].transpose();
    let u = path.air_velocity(k);
    let from = M.saturating_sub(AT);
    let mut nodes = [None; CHANNELS];
    let mut constants = [[0.0; M]; CHANNELS];
    if let Some(euler) = euler_by_turn(&path.attitude[k]) {
        for (channel, node) in nodes[..3].iter_mut().enumerate() {
            let mut row = [0.0; N];
            (0..3).for_each(|i| row[i] = euler[(channel, i)]);
            *node = Some(row);
        }
    }
    if let Some(mut slopes) = air_slopes(&u, values[BOARD_ROLL]) {
        scale(&mut slopes, values);
        let (by_turn, by_velocity) = (slopes * cross(&u), slopes * body);
        for i in 0..3 {
            let mut row = [0.0; N];
            for j in 0..3 {
                row[j] = by_turn[(i, j)];
                row[3 + j] = by_velocity[(i, j)];
                if N == MOTION_AND_GUST {
                    row[6 + j] = -by_velocity[(i, j)];
                }
                if M > 1 {
                    constants[3 + i][from + WIND + j] = -by_velocity[(i, j)];
                }
            }
            nodes[3 + i] = Some(row);
        }
        if M > 1 {
            by_errors(&u, values, from, &mut constants);
        }
    }
    for (channel, node) in nodes.iter_mut().enumerate().skip(6) {
        let mut row = [0.0; N];
        row[channel - 3] = 1.0;
        *node = Some(row);
    }
    if M > 1 {
        constants[2][from + HEADING] = 1.0;
        for (channel, row) in constants.iter_mut().enumerate() {
            row[from + skew_of(channel)] = reading.by_late[channel];
        }
    }
    (nodes, constants)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight_path::nuisance::COUNT;

    /// The analytic derivatives must equal central differences of the vanes' readings.
    #[test]
    fn a_rolled_board_turns_the_slopes_of_the_vanes() {
        const STEP: f64 = 1e-6;
        let (u, roll) = (Vector3::new(16.0, 2.5, 1.8), 0.04);
        let seen = |u: Vector3<f64>, roll: f64| flow_angles(&unrolled(&u, roll));
        let slopes = air_slopes(&u, roll).unwrap();
        let close = |up: [f64; 2], down: [f64; 2], slope: [f64; 2]| {
            for vane in 0..2 {
                let differences = (up[vane] - down[vane]) / (2.0 * STEP);
                assert!((differences - slope[vane]).abs() < 1e-8, "{differences} {slope:?}");
            }
        };
        for axis in 0..3 {
            let mut by = Vector3::zeros();
            by[axis] = STEP;
            let slope = [slopes[(1, axis)], slopes[(2, axis)]];
            close(seen(u + by, roll), seen(u - by, roll), slope);
        }
        let mut values = [0.0; COUNT];
        values[BOARD_ROLL] = roll;
        let mut constants = [[0.0; AT]; CHANNELS];
        by_errors(&u, &values, 0, &mut constants);
        let slope = [constants[4][BOARD_ROLL], constants[5][BOARD_ROLL]];
        close(seen(u, roll + STEP), seen(u, roll - STEP), slope);
    }
}
