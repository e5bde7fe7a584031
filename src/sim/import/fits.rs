//! Fits of a line and of linear filters to the response of a JSBSim aircraft, for its import as a model.

use std::f64::consts::FRAC_PI_2;

use super::Polar;
use greylag_num::least_squares;
use greylag_num::statistics::mean;
use greylag_physics::servos::{Surface, Travel};

/// Range of the angle of attack in which the pitching moment is fitted by a line, degrees.
const LINE_DEG: [f64; 2] = [-4.0, 10.0];

/// Fits a line to the pitching moment coefficient over the angle of attack. Returns its intercept, its slope (1/rad), and the rms
/// residual as a fraction of the standard deviation of the coefficient.
pub(super) fn line(polar: &Polar) -> [f64; 3] {
    let [low, high] = LINE_DEG;
    let inside = |a: &f64| (low - 1e-6..=high + 1e-6).contains(&a.to_degrees());
    let pairs = polar.alpha.iter().zip(&polar.pitch).filter(|(a, _)| inside(a));
    let (rows, moments): (Vec<[f64; 2]>, Vec<f64>) = pairs.map(|(a, m)| ([1.0, *a], *m)).unzip();
    let [first, slope] = least_squares(&rows, &moments).unwrap_or_default();
    let middle = mean(&moments);
    let square = |f: &dyn Fn(usize) -> f64| (0..rows.len()).map(|k| f(k).powi(2)).sum::<f64>();
    let left = square(&|k| moments[k] - first - slope * rows[k][1]);
    [first, slope, (left / square(&|k| moments[k] - middle).max(1e-30)).sqrt()]
}

/// Natural frequency (rad/s) and damping ratio of the second-order filter whose response to a step of size `end` is closest to
/// the response `observed`, sampled every 0.01 s.
pub(super) fn second_order(observed: &[f64], end: f64) -> [f64; 2] {
    let miss = |frequency: f64, damping: f64| {
        let Surface { filter: [b, a1, a2], .. } =
            Surface::tustin(frequency, damping, Travel::symmetric(FRAC_PI_2), 0.01);
        let (mut y, mut u) = ([0.0; 2], [0.0; 2]);
        let errors = observed.iter().map(|x| {
            let next = b * (end + 2.0 * u[0] + u[1]) - a1 * y[0] - a2 * y[1];
            (y, u) = ([next, y[0]], [end, u[0]]);
            (x - next).powi(2)
        });
        errors.sum::<f64>()
    };
    let frequencies = (0..60).map(|k| 5.0 * 1.09_f64.powi(k));
    let all = frequencies.flat_map(|w| [0.5, 0.6, 0.707, 0.8, 1.0, 1.4].map(|z| [w, z]));
    all.min_by(|a, b| miss(a[0], a[1]).total_cmp(&miss(b[0], b[1]))).unwrap_or([50.0, 0.7])
}

/// Fraction of a throttle step below which the response counts as zero. A glider, for example, has no response.
const NO_ANSWER: f64 = 0.01;
/// Time constant that is used if the throttle has no effect, s.
const USUAL_LAG_S: f64 = 0.2;

/// Time constant (s) of the response `observed` to a throttle step of 0.5, sampled every 0.01 s. It is the time after which the
/// response has reached 63 % of the step.
pub(super) fn first_order(observed: &[f64]) -> f64 {
    let end = 0.5;
    match observed.iter().position(|x| *x >= 0.632 * end) {
        Some(k) => (0.01 * k as f64).max(0.01),
        // if 63 % is not reached, the time constant follows from the fraction of the step that is reached at the end
        None => {
            let last = observed.last().copied().unwrap_or(0.0) / end;
            if last < NO_ANSWER {
                return USUAL_LAG_S;
            }
            0.01 * observed.len() as f64 / -(1.0 - last.clamp(1e-3, 0.99)).ln()
        }
    }
}

/// Smallest and largest time constant that is tried, s: 0.01 s, and the largest value of the effect `thrust_lag`.
const THRUST_LAGS_S: [f64; 2] = [0.01, 10.0];
/// Residual of the fitted step response, as a fraction of the step, from which on a first-order lag does not describe the thrust.
const NO_LAG: f64 = 0.5;
/// Largest accepted ratio of the residual with the lag to the residual without a lag.
const MUCH_BETTER: f64 = 0.8;
/// Number of time constants that are tried, in geometric steps.
const THRUST_LAGS: usize = 400;

/// First-order lag between throttle position and thrust.
pub(super) struct ThrustLag {
    /// Time constant in s.
    pub lag: f64,
    /// RMS residual of the fitted step response, as a fraction of the change of the thrust.
    pub left: f64,
    /// Whether the lag describes the step response, and describes a sine of the throttle better than a model without a lag.
    pub better: bool,
}

/// The lag that fits the response `raised` to a throttle step best. The response `waved` to a sine of the throttle validates it.
/// Each response lists thrust (N) and throttle position after each time step `step` (s). At the throttle position δ, the steady
/// thrust is `slope` δ + `curve` δ² plus a constant. `None` if the thrust does not change, or if the lag is at most two steps.
pub(super) fn thrust_lag(
    [raised, waved]: [&[[f64; 2]]; 2],
    step: f64,
    [slope, curve]: [f64; 2],
) -> Option<ThrustLag> {
    let [first, last] = [raised.first()?, raised.last()?];
    let settled = |throttle: f64| (slope + curve * throttle) * throttle;
    let (rise, expected) = (last[0] - first[0], settled(last[1]) - settled(first[1]));
    let largest = last[0].abs().max(first[0].abs()).max(1.0);
    if (last[1] - first[1]).abs() < NO_ANSWER || rise.abs().min(expected.abs()) < 1e-3 * largest {
        return None;
    }
    // rms residual of the response `answer` with the time constant `lag`, as a fraction of the thrust step
    let misfit = |answer: &[[f64; 2]], lag: f64| {
        let [thrust, throttle] = answer.first().copied().unwrap_or_default();
        let (gain, keep) = (step / (2.0 * lag + step), (2.0 * lag - step) / (2.0 * lag + step));
        let (mut before, mut acts) = (throttle, throttle);
        let squares = answer.iter().map(|[now, position]| {
            acts = gain * (position + before) + keep * acts;
            before = *position;
            ((now - thrust) / rise - (settled(acts) - settled(throttle)) / expected).powi(2)
        });
        (squares.sum::<f64>() / answer.len().max(1) as f64).sqrt()
    };
    let [least, most] = THRUST_LAGS_S;
    let ratio = (most / least).powf(1.0 / (THRUST_LAGS - 1) as f64);
    let lags = (0..THRUST_LAGS).map(|k| least * ratio.powi(k as i32));
    let (lag, left) =
        lags.map(|lag| (lag, misfit(raised, lag))).min_by(|a, b| a.1.total_cmp(&b.1))?;
    let better = left < NO_LAG && misfit(waved, lag) < MUCH_BETTER * misfit(waved, 0.0);
    (lag > 2.0 * step).then_some(ThrustLag { lag, left, better })
}
