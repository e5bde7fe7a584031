//! Delay of the recorded actuator positions relative to the gyros, estimated from the moments that the deflections cause.
//!
//! The kinematics do not depend on the actuators, but the angular accelerations do. Roll and pitch accelerations are
//! regressed on rates, flow angles, inertial coupling, deflection and rate of deflection, all averaged over a short kernel.
//! The averaging limits the noise of the derivatives. The delay is the coefficient of the rate of deflection divided by the
//! coefficient of the deflection. This delay also contains any lag of the surfaces that the record does not show.
//!
//! Accelerations and regressors are high-pass filtered at half a second. Slower variations contain no information on a
//! delay. They contain the errors of unmeasured flow angles, which are up to 0.2° with PX4.

use nalgebra::{DMatrix, DVector};

use crate::flight_path::nuisance::SKEW_SAMPLES;
use crate::flight_path::reconstruction::Instant;
use greylag_logs::Sampling;
use greylag_physics::State;

/// Length of the averaging kernel, s.
const KERNEL: f64 = 0.15;
/// Number of windows over which residuals are treated as correlated: about 1 s.
const BLOCK: usize = 14;
/// Number of windows of the moving mean that is subtracted: about 0.5 s.
const SLOW: usize = 7;
/// Systematic error of the delay, s: the largest of 16 errors in noise-free flights of the X8 in calm air, each from roll alone
/// or from pitch alone.
const SYSTEMATIC: f64 = 2e-5;
/// Additional standard deviation of the delay due to gusts, in s per m/s of the gusts' standard deviation.
///
/// Gusts rotate the aircraft and the autopilot responds. The deflections are then correlated with moments that no regressor
/// explains. In 20 flights of the X8 in light turbulence (2.4 m/s), the root mean square error of the delay was 2.2 ms. The
/// standard deviation without this addition was 1.1 ms.
const BY_GUSTS: f64 = 8e-4;
/// Standard deviation of the bias correction, which is a linear extrapolation, as a fraction of the correction.
const CURVED: f64 = 0.5;
/// Smallest number of windows per regressor for which a delay is estimated.
const SUPPORT: usize = 10;

/// A delay with its standard deviation, s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Skew {
    /// Delay of the recorded deflections, s; positive if they are late.
    pub late: f64,
    /// Standard deviation of the delay, s.
    pub deviation: f64,
}

/// Delays estimated from roll alone and from pitch alone; `None` if the axis does not determine the delay.
pub type ByAxis = [Option<Skew>; 2];

/// A sample with the quantities on which the moments depend.
pub trait Moving {
    /// The state of the flight.
    fn state(&self) -> &State;
    /// Deflections of aileron and elevator, rad.
    fn deflections(&self) -> [f64; 2];
}

impl Moving for Instant {
    fn state(&self) -> &State {
        &self.state
    }

    fn deflections(&self) -> [f64; 2] {
        [self.controls.aileron, self.controls.elevator]
    }
}

/// Delays of the recorded deflections, estimated from roll alone and from pitch alone. `step` is the sampling interval, s.
pub fn by_axis<I: Moving>(segments: &[&[I]], step: f64, sampling: Sampling) -> ByAxis {
    [
        from_axis(segments, step, sampling, |i: &I| i.state().p, roll_terms::<I>),
        from_axis(segments, step, sampling, |i: &I| i.state().q, pitch_terms::<I>),
    ]
}

/// Combines `own`, the delays from roll and pitch, with the prior into one delay. The prior is zero, with a 95 % interval of
/// ±1.5 samples. `step` is the sampling interval (s), `gusts` the standard deviation of the gusts (m/s).
///
/// Errors in the regressors bias the coefficients and thus the delay. `erring` are the delays estimated from copies of the
/// flight with additional errors of the same distribution as the errors of the flight. The mean change of the delay in the
/// copies is subtracted (simulation extrapolation, Cook and Stefanski 1994, linear).
pub fn estimate(own: ByAxis, erring: &[ByAxis], step: f64, gusts: f64) -> Skew {
    let prior = (SKEW_SAMPLES * step).powi(-2);
    let (mut information, mut weighted) = (prior, 0.0);
    for (axis, skew) in own.into_iter().enumerate() {
        let Some(skew) = skew else { continue };
        let again: Vec<f64> = erring.iter().filter_map(|copy| copy[axis]).map(|s| s.late).collect();
        let skew = extrapolated(skew, &again);
        let i = skew.deviation.powi(-2);
        information += i;
        weighted += i * skew.late;
    }
    // the same gusts disturb roll and pitch: the mean over both axes does not reduce this error
    let by_gusts = BY_GUSTS * gusts;
    let width = SKEW_SAMPLES * step;
    let deviation = information.recip().sqrt().hypot(by_gusts).min(width);
    Skew { late: weighted / information, deviation }
}

/// The delay `skew` without the bias that the errors of the states cause. `again` are the delays, s, estimated from the copies
/// with additional errors.
fn extrapolated(skew: Skew, again: &[f64]) -> Skew {
    if again.len() < 2 {
        return skew;
    }
    let count = again.len() as f64;
    let mean = again.iter().sum::<f64>() / count;
    let scatter = again.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (count - 1.0);
    let pulled = mean - skew.late;
    // two variances are added: that of the mean over the copies, and that of the nonlinear part of the bias
    let deviation = (skew.deviation.powi(2) + scatter / count + (CURVED * pulled).powi(2)).sqrt();
    Skew { late: skew.late - pulled, deviation }
}

/// Regressors of the roll acceleration. The last one is proportional to the deflection.
fn roll_terms<I: Moving>(i: &I) -> [f64; 7] {
    let (s, [aileron, _]) = (i.state(), i.deflections());
    let v = s.airspeed;
    let v2 = v * v;
    [v2, v2 * s.beta, v * s.p, v * s.r, s.p * s.q, s.q * s.r, v2 * aileron]
}

/// Regressors of the pitch acceleration. The last one is proportional to the deflection.
fn pitch_terms<I: Moving>(i: &I) -> [f64; 6] {
    let (s, [_, elevator]) = (i.state(), i.deflections());
    let v = s.airspeed;
    let v2 = v * v;
    let coupling = s.p * s.p - s.r * s.r;
    [v2, v2 * s.alpha, v * s.q, s.p * s.r, coupling, v2 * elevator]
}

fn from_axis<I, const T: usize>(
    segments: &[&[I]],
    step: f64,
    sampling: Sampling,
    rate: fn(&I) -> f64,
    terms: fn(&I) -> [f64; T],
) -> Option<Skew> {
    let half = ((KERNEL / step / 2.0).round() as usize).max(3);
    let kernel: Vec<f64> = (0..=2 * half)
        .map(|j| {
            let phase = std::f64::consts::PI * (j + 1) as f64 / (half + 1) as f64;
            0.5 * (1.0 - phase.cos())
        })
        .collect();
    let (mut rows, mut values) = (Vec::new(), Vec::new());
    for &instants in segments {
        let terms = |k: usize| held(instants, k, sampling, terms);
        let (mut of_terms, mut of_rates) = (Vec::new(), Vec::new());
        let mut middle = half + 1;
        while middle + half + 1 < instants.len() {
            let rate = |k: usize| rate(&instants[k]);
            let (row, value) = window(&kernel, terms, rate, middle - half, step);
            of_terms.push(row);
            of_rates.push(vec![value]);
            middle += half;
        }
        rows.extend(fast(&of_terms));
        values.extend(fast(&of_rates).into_iter().flatten());
    }
    regress(&rows, &values)
}

/// Regressors averaged over the interval from sample `k` to the next sample.
fn held<I, const T: usize>(
    instants: &[I],
    k: usize,
    sampling: Sampling,
    terms: fn(&I) -> [f64; T],
) -> [f64; T] {
    let own = terms(&instants[k]);
    match sampling {
        Sampling::Held => own,
        Sampling::Instants => {
            let after = terms(&instants[(k + 1).min(instants.len() - 1)]);
            std::array::from_fn(|i| 0.5 * (own[i] + after[i]))
        }
    }
}

/// High-pass filter: each row minus the moving mean over `SLOW` rows.
fn fast(rows: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let about = |i: usize| &rows[i.saturating_sub(SLOW / 2)..(i + SLOW / 2 + 1).min(rows.len())];
    let less_mean = |(i, row): (usize, &Vec<f64>)| {
        let about = about(i);
        let mean = |j: usize| about.iter().map(|r| r[j]).sum::<f64>() / about.len() as f64;
        row.iter().enumerate().map(|(j, x)| x - mean(j)).collect()
    };
    rows.iter().enumerate().map(less_mean).collect()
}

/// Kernel averages over the window that starts at sample `start`: the regressors followed by the rate of the last regressor,
/// and the angular acceleration.
fn window<const T: usize>(
    kernel: &[f64],
    terms: impl Fn(usize) -> [f64; T],
    rate: impl Fn(usize) -> f64,
    start: usize,
    step: f64,
) -> (Vec<f64>, f64) {
    let last = T - 1;
    let mut row = vec![0.0; last + 2];
    let mut value = 0.0;
    let [mut before, mut now] = [terms(start - 1), terms(start)];
    for (j, weight) in kernel.iter().enumerate() {
        let k = start + j;
        let after = terms(k + 1);
        for (x, term) in row.iter_mut().zip(&now) {
            *x += weight * term;
        }
        row[last + 1] += weight * (after[last] - before[last]) / (2.0 * step);
        value += weight * (rate(k + 1) - rate(k)) / step;
        (before, now) = (now, after);
    }
    (row, value)
}

/// Delay by least squares, with a covariance that is robust to correlation within blocks of residuals. `None` if there are too
/// few windows or the regression is singular.
fn regress(rows: &[Vec<f64>], values: &[f64]) -> Option<Skew> {
    let columns = rows.first()?.len();
    if rows.len() < SUPPORT * columns {
        return None;
    }
    let mut x = DMatrix::from_fn(rows.len(), columns, |i, j| rows[i][j]);
    let scale: Vec<f64> = (0..columns).map(|j| x.column(j).norm()).collect();
    if scale.iter().any(|s| !(s.is_finite() && *s > 0.0)) {
        return None;
    }
    for (j, s) in scale.iter().enumerate() {
        x.column_mut(j).scale_mut(s.recip());
    }
    let y = DVector::from_column_slice(values);
    let inverse = (x.transpose() * &x).cholesky()?.inverse();
    let solution = &inverse * x.transpose() * &y;
    let residual = y - &x * &solution;
    let mut meat = DMatrix::<f64>::zeros(columns, columns);
    for start in (0..rows.len()).step_by(BLOCK) {
        let n = BLOCK.min(rows.len() - start);
        let score = x.rows(start, n).transpose() * residual.rows(start, n);
        meat += &score * score.transpose();
    }
    let covariance = &inverse * meat * &inverse;
    let (deflection, by_rate) = (columns - 2, columns - 1);
    let gain = solution[deflection] / scale[deflection];
    let late = solution[by_rate] / scale[by_rate] / gain;
    // gradient of the quotient of both coefficients
    let gradient = DVector::from_fn(columns, |j, _| match j {
        j if j == by_rate => 1.0 / (scale[by_rate] * gain),
        j if j == deflection => -late / (scale[deflection] * gain),
        _ => 0.0,
    });
    let deviation = (gradient.transpose() * covariance * gradient)[0].sqrt().hypot(SYSTEMATIC);
    (late.is_finite() && deviation.is_finite() && deviation > 0.0)
        .then_some(Skew { late, deviation })
}
