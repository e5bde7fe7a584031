//! Uncertainty of the estimates: posterior covariance, corrected for correlated residuals.

use nalgebra::{DMatrix, DVector};

/// Posterior covariance of all unknowns.
pub(super) struct Covariance {
    /// Standard deviations, in the order of the unknowns.
    pub sd: Vec<f64>,
    /// Inverse of the information matrix.
    inverse: DMatrix<f64>,
}

impl Covariance {
    /// Correlation of the errors of two unknowns.
    pub fn correlation(&self, a: usize, b: usize) -> f64 {
        let of = |a: usize, b: usize| self.inverse[(a, b)];
        of(a, b) / (of(a, a) * of(b, b)).sqrt()
    }
}

/// The covariance at the optimum; `None` if `information` is not positive definite.
///
/// `information` includes the prior. `prior` is the diagonal of the prior's information. Each of `scores` is the gradient
/// of the cost over one block of data; blocks are treated as independent.
///
/// The inverse information is the covariance if the weights are correct. The sandwich estimator does not need this
/// assumption, but it is biased low and uncertain for few blocks. The variance of each unknown is the larger of the two
/// variances, with the sandwich estimator multiplied by B/(B − 1) for B blocks.
pub(super) fn covariance(
    information: &DMatrix<f64>,
    prior: &DVector<f64>,
    scores: &[DVector<f64>],
) -> Option<Covariance> {
    let inverse = information.clone().cholesky()?.inverse();
    let mut meat = DMatrix::from_diagonal(prior);
    let blocks = scores.len() as f64;
    for score in scores {
        meat.ger(blocks / (blocks - 1.0).max(1.0), score, score, 1.0);
    }
    let sandwich = &inverse * meat * &inverse;
    let sd = (0..inverse.nrows()).map(|k| inverse[(k, k)].max(sandwich[(k, k)]).sqrt()).collect();
    Some(Covariance { sd, inverse })
}
