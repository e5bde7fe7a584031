//! Linear least squares with a few unknowns.

use nalgebra::{DMatrix, DVector};

/// Least-squares solution x of `rows` · x = `values`. If there are several solutions, the function returns the one of
/// minimum norm. It returns `None` if an input is not finite or if there are no rows.
pub fn least_squares<const N: usize>(rows: &[[f64; N]], values: &[f64]) -> Option<[f64; N]> {
    if rows.is_empty() || !rows.iter().flatten().chain(values).all(|x| x.is_finite()) {
        return None;
    }
    let matrix = DMatrix::from_fn(rows.len(), N, |i, j| rows[i][j]);
    let target = DVector::from_column_slice(values);
    let found = matrix.svd(true, true).solve(&target, 1e-9).ok()?;
    Some(std::array::from_fn(|i| found[i]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_is_found_again() {
        let rows: Vec<[f64; 3]> = (0..9).map(f64::from).map(|x| [1.0, x, x * x]).collect();
        let values: Vec<f64> = rows.iter().map(|r| 2.0 - 0.5 * r[1] + 0.25 * r[2]).collect();
        let found = least_squares(&rows, &values).unwrap();
        assert!((found[0] - 2.0).abs() < 1e-9 && (found[2] - 0.25).abs() < 1e-9, "{found:?}");
        assert_eq!(least_squares(&[[f64::NAN]], &[1.0]), None);
        assert_eq!(least_squares::<2>(&[], &[]), None);
    }
}
