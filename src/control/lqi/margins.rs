//! Gain, phase and delay margins of the LQI, a linear-quadratic regulator with integral action. There is one loop per surface.
//! Each loop is opened at its surface while the other loops stay closed.

use std::f64::consts::{PI, TAU};

use nalgebra::{Complex, DMatrix, DVector, SMatrix};
use serde::Serialize;

use super::Weights;
use super::design::{ALL, Loops, STATES, loops};
use greylag_model::{GreyBox, STEP, Trim, TrimError};

/// Number of frequencies at which a loop transfer function is evaluated. They are spaced logarithmically from [`LOWEST`] to half
/// the sampling frequency.
const FREQUENCIES: usize = 1500;
/// Lowest frequency evaluated, rad/s.
const LOWEST: f64 = 0.05;

/// Stability margins of one loop with the other loops closed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LoopMargins {
    /// The surface at which the loop is opened.
    pub surface: &'static str,
    /// Lower and upper gain margin: the loop stays stable if its gain is multiplied by a factor between the two. The lower one is
    /// 0 and the upper one infinite if there is no such limit.
    pub gain: [f64; 2],
    /// Phase margin, rad. It is π if the loop gain never crosses 1.
    pub phase: f64,
    /// Delay margin, s. It is infinite if the loop gain never crosses 1.
    pub delay: f64,
    /// Highest gain crossover frequency, rad/s. It is zero if the loop gain never crosses 1.
    pub crossover: f64,
}

/// Reason why the margins could not be computed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MarginsError {
    /// The flight condition has no trim.
    #[error(transparent)]
    Trim(#[from] TrimError),
    /// No feedback gain stabilises the model in this flight condition.
    #[error(
        "model {model} cannot be stabilised at {airspeed_mps:.1} m/s: see that its surfaces act"
    )]
    Unstable {
        /// Name of the model.
        model: String,
        /// Airspeed of the flight condition, m/s.
        airspeed_mps: f64,
    },
}

/// The margins of `model`'s LQI loops in straight flight at `airspeed` (m/s) and at the model's reference altitude. The order
/// is aileron, elevator and, if there is one, rudder.
///
/// # Errors
///
/// If the model has no straight-flight trim at this airspeed, or no gain stabilises it there.
pub fn margins(
    model: &GreyBox,
    airspeed: f64,
    weights: &Weights,
) -> Result<Vec<LoopMargins>, MarginsError> {
    let altitude = model.airframe.reference.altitude;
    let trim = Trim::straight(model, airspeed, altitude)?;
    let unstable = || MarginsError::Unstable { model: model.name.clone(), airspeed_mps: airspeed };
    Ok(match loops(model, &trim, altitude, weights).ok_or_else(unstable)? {
        Loops::Two(a, b, k) => each::<STATES, 2>(&a, &b, &k),
        Loops::Three(a, b, k) => each::<ALL, 3>(&a, &b, &k),
    })
}

fn each<const N: usize, const M: usize>(
    a: &SMatrix<f64, N, N>,
    b: &SMatrix<f64, N, M>,
    k: &SMatrix<f64, M, N>,
) -> Vec<LoopMargins> {
    let names = ["aileron", "elevator", "rudder"];
    (0..M).map(|i| of_loop(names[i], &ratio(a, b, k, i))).collect()
}

/// The loop transfer function at each frequency (rad/s), with the loop opened at input `broken`.
fn ratio<const N: usize, const M: usize>(
    a: &SMatrix<f64, N, N>,
    b: &SMatrix<f64, N, M>,
    k: &SMatrix<f64, M, N>,
    broken: usize,
) -> Vec<(f64, Complex<f64>)> {
    let mut closed = *a;
    for i in (0..M).filter(|i| *i != broken) {
        closed -= b.column(i) * k.row(i);
    }
    let (column, row) = (b.column(broken), k.row(broken));
    let input = DVector::from_fn(N, |i, _| Complex::from(column[i]));
    let highest = PI / STEP;
    let at = |step: usize| {
        let part = step as f64 / (FREQUENCIES - 1) as f64;
        let frequency = LOWEST * (highest / LOWEST).powf(part);
        let z = Complex::from_polar(1.0, frequency * STEP);
        let system = DMatrix::from_fn(N, N, |i, j| {
            let shift = if i == j { z } else { Complex::from(0.0) };
            shift - closed[(i, j)]
        });
        let state = system.lu().solve(&input)?;
        let ratio = (0..N).map(|i| state[i] * row[i]).sum::<Complex<f64>>();
        Some((frequency, ratio))
    };
    (0..FREQUENCIES).filter_map(at).collect()
}

/// The margins of a loop from samples of its transfer function at increasing frequencies (rad/s), by linear interpolation.
fn of_loop(surface: &'static str, ratio: &[(f64, Complex<f64>)]) -> LoopMargins {
    let mut margins = LoopMargins {
        surface,
        gain: [0.0, f64::INFINITY],
        phase: PI,
        delay: f64::INFINITY,
        crossover: 0.0,
    };
    for pair in ratio.windows(2) {
        let ((w0, l0), (w1, l1)) = (pair[0], pair[1]);
        // gain crossover
        if (l0.norm() - 1.0) * (l1.norm() - 1.0) <= 0.0 && l0.norm() != l1.norm() {
            let part = (1.0 - l0.norm()) / (l1.norm() - l0.norm());
            let (w, l) = (w0 + part * (w1 - w0), l0 + (l1 - l0) * Complex::from(part));
            let lag = (l.arg() + PI).rem_euclid(TAU);
            margins.phase = margins.phase.min(lag).min(TAU - lag);
            margins.delay = margins.delay.min(lag / w);
            margins.crossover = margins.crossover.max(w);
        }
        // phase crossover
        if l0.im * l1.im <= 0.0 && l0.im != l1.im {
            let part = l0.im / (l0.im - l1.im);
            let real = l0.re + part * (l1.re - l0.re);
            if real < 0.0 {
                margins.note_gain(-1.0 / real);
            }
        }
    }
    // at half the sampling frequency the transfer function is real
    if let Some((_, last)) = ratio.last().filter(|(_, last)| last.re < 0.0) {
        margins.note_gain(-1.0 / last.re);
    }
    margins
}

impl LoopMargins {
    /// Records that the loop transfer function passes through −1 if it is multiplied by `factor`.
    fn note_gain(&mut self, factor: f64) {
        let [least, most] = &mut self.gain;
        if factor < 1.0 { *least = least.max(factor) } else { *most = most.min(factor) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix1, Matrix2, RowVector2, Vector2};

    #[test]
    fn an_integrator_with_delay_has_the_margins_of_the_textbook() {
        // L = k h / (z (z − 1)) is k/s with a delay of half a step from the hold and of one step from the second state
        let (h, k) = (STEP, 5.0);
        let a = Matrix2::new(1.0, h, 0.0, 0.0);
        let found = &each(&a, &Vector2::new(0.0, 1.0), &RowVector2::new(k, 0.0))[0];
        let late = 1.5 * h;
        assert!((found.crossover - k).abs() < 0.02 * k, "{found:?}");
        assert!((found.phase - (PI / 2.0 - k * late)).abs() < 0.01, "{found:?}");
        assert!((found.delay - (PI / 2.0 / k - late)).abs() < 0.003, "{found:?}");
        // z² − z + k h = 0 leaves the unit circle at k h = 1
        assert!((found.gain[1] * k * h - 1.0).abs() < 0.01, "{found:?}");
        let plain = &each(&Matrix1::new(1.0), &Matrix1::new(h), &Matrix1::new(k))[0];
        assert!((plain.gain[1] * k * h - 2.0).abs() < 0.01, "{plain:?}");
    }
}
