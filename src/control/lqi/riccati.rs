//! Solution of the discrete algebraic Riccati equation by structured doubling.

use nalgebra::{DMatrix, SMatrix};

/// The gain K of the feedback u = −K x that minimises Σ xᵀqx + uᵀru for x₊ = ax + bu. `None` if `r` is singular, or if the
/// doubling does not converge because the feedback cannot stabilise the system.
///
/// Each iteration doubles the horizon: E. Chu, H. Fan, W. Lin, C. Wang, "Structure-preserving algorithms for periodic
/// discrete-time algebraic Riccati equations", Int. J. Control 77 (2004).
pub(super) fn gain<const N: usize, const M: usize>(
    a: &SMatrix<f64, N, N>,
    b: &SMatrix<f64, N, M>,
    q: &SMatrix<f64, N, N>,
    r: &SMatrix<f64, M, M>,
) -> Option<SMatrix<f64, M, N>> {
    let dynamic = |rows, columns, m: &[f64]| DMatrix::from_column_slice(rows, columns, m);
    let (a0, b0) = (dynamic(N, N, a.as_slice()), dynamic(N, M, b.as_slice()));
    let r0 = dynamic(M, M, r.as_slice());
    let mut a = a0.clone();
    let mut g = &b0 * r0.clone().try_inverse()? * b0.transpose();
    let mut h = dynamic(N, N, q.as_slice());
    let one = DMatrix::<f64>::identity(N, N);
    for _ in 0..60 {
        let w = (&one + &g * &h).lu();
        let wa = w.solve(&a)?;
        let wg = w.solve(&g)?;
        let growth = a.transpose() * &h * &wa;
        g += &a * wg * a.transpose();
        a = &a * wa;
        h += &growth;
        h = (&h + h.transpose()) * 0.5;
        if !h.iter().all(|x| x.is_finite()) {
            return None;
        }
        if growth.amax() <= 1e-12 * h.amax() {
            let bh = b0.transpose() * &h;
            let k = (r0 + &bh * &b0).lu().solve(&(&bh * &a0))?;
            return Some(SMatrix::from_fn(|i, j| k[(i, j)]));
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix1, Matrix2, Vector2};

    #[test]
    fn scalar_gain_solves_its_equation() {
        let (a, b, q, r) = (1.2, 0.5, 1.0, 0.3);
        let k = gain(&Matrix1::new(a), &Matrix1::new(b), &Matrix1::new(q), &Matrix1::new(r))
            .unwrap()[0];
        // the positive root of b²p² + (r − a²r − qb²)p − qr = 0
        let (qa, qb, qc) = (b * b, r - a * a * r - q * b * b, -q * r);
        let p = (-qb + (qb * qb - 4.0 * qa * qc).sqrt()) / (2.0 * qa);
        assert!((k - b * p * a / (r + b * b * p)).abs() < 1e-12);
    }

    #[test]
    fn refuses_what_cannot_be_stabilised() {
        let a = Matrix2::new(1.5, 0.0, 0.0, 0.5);
        let b = Vector2::new(0.0, 1.0);
        assert!(gain(&a, &b, &Matrix2::identity(), &Matrix1::new(1.0)).is_none());
    }
}
