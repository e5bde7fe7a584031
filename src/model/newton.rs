//! Newton's method for a few equations, with exact derivatives from dual numbers.

use nalgebra::{DMatrix, DVector};

use super::jacobian::{Four, jacobian};

/// Root of `f` near `start`. `None` if the iteration does not converge in 60 steps.
///
/// Convergence means that the magnitude of every residual is below 1e-10. `largest` limits the step of each unknown in one
/// iteration. Without this limit, the iteration could leave the region in which the equations are valid after a poor start.
pub(super) fn solve<const N: usize>(
    start: [f64; N],
    largest: [f64; N],
    f: impl Fn([Four; N]) -> [Four; N],
) -> Option<[f64; N]> {
    let mut x = start;
    for _ in 0..60 {
        let (residual, slopes) = jacobian(&x, &f);
        if residual.iter().all(|r| r.abs() < 1e-10) {
            return Some(x);
        }
        let slopes = DMatrix::from_fn(N, N, |i, j| slopes[i][j]);
        let step = slopes.lu().solve(&DVector::from_column_slice(&residual))?;
        let ratio = (0..N).map(|i| step[i].abs() / largest[i]).fold(1.0, f64::max);
        for i in 0..N {
            x[i] -= step[i] / ratio;
        }
        if !x.iter().all(|v| v.is_finite()) {
            return None;
        }
    }
    None
}
