//! Jacobians by forward-mode automatic differentiation, with respect to four inputs at a time.
//!
//! Four derivatives fill a SIMD register. The model's equations are compiled for this number only, because each further number
//! adds seconds to the compilation. The values of the derivatives do not depend on the number.

use greylag_num::{Dual, Real};

/// A number with its derivatives with respect to four inputs.
pub(super) type Four = Dual<4>;

/// The value of `f` at `x`, and the Jacobian of `f` there. Row i of the Jacobian holds ∂fᵢ/∂xⱼ for all j.
pub(super) fn jacobian<const N: usize, const M: usize>(
    x: &[f64; N],
    f: impl Fn([Four; N]) -> [Four; M],
) -> ([f64; M], [[f64; N]; M]) {
    let (mut values, mut rows) = ([0.0; M], [[0.0; N]; M]);
    for first in (0..N).step_by(4) {
        let of = std::array::from_fn(|i| match i.checked_sub(first) {
            Some(place) if place < 4 => Four::variable(x[i], place),
            _ => Four::from_f64(x[i]),
        });
        for ((value, row), out) in values.iter_mut().zip(&mut rows).zip(f(of)) {
            *value = out.value;
            for (to, from) in row[first..].iter_mut().zip(out.gradient) {
                *to = from;
            }
        }
    }
    (values, rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_input_has_its_own_column() {
        let x = [0.3, -0.7, 1.1, 2.0, 0.5, -1.3];
        let f = |x: [Four; 6]| [x[0] * x[4] + x[5].sin_cos().0, x[1] * x[2] * x[3]];
        let (values, rows) = jacobian(&x, f);
        assert_eq!(values, [x[0] * x[4] + x[5].sin(), x[1] * x[2] * x[3]]);
        let first = [x[4], 0.0, 0.0, 0.0, x[0], x[5].cos()];
        let second = [0.0, x[2] * x[3], x[1] * x[3], x[1] * x[2], 0.0, 0.0];
        for (row, exact) in rows.iter().zip([first, second]) {
            assert!(row.iter().zip(exact).all(|(a, b)| (a - b).abs() < 1e-15), "{row:?} {exact:?}");
        }
    }
}
