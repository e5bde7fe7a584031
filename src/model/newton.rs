//! Newton's method for a few equations, with exact derivatives from dual numbers.

use nalgebra::{DMatrix, DVector};

use greylag_num::Dual;

/// Root of `f` near `start`; `None` if it does not converge in 60 damped steps.
///
/// `largest` limits the step of each unknown, so that a poor start does not leave the region in which the equations
/// are valid. Convergence: every residual below 1e-10.
pub(super) fn solve<const N: usize>(
    start: [f64; N],
    largest: [f64; N],
    f: impl Fn([Dual<N>; N]) -> [Dual<N>; N],
) -> Option<[f64; N]> {
    let mut x = start;
    for _ in 0..60 {
        let residual = f(std::array::from_fn(|i| Dual::variable(x[i], i)));
        if residual.iter().all(|r| r.value.abs() < 1e-10) {
            return Some(x);
        }
        let jacobian = DMatrix::from_fn(N, N, |i, j| residual[i].gradient[j]);
        let value = DVector::from_fn(N, |i, _| residual[i].value);
        let step = jacobian.lu().solve(&value)?;
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
