//! Uncertainty of the estimates of a fit: posterior covariance, with standard deviations that allow for wrong weights of the
//! residuals.

use nalgebra::{DMatrix, DVector};

/// Posterior uncertainty of all unknowns of a fit.
pub(super) struct Covariance {
    /// Standard deviations, in the order of the unknowns.
    pub sd: Vec<f64>,
    /// Inverse of the information matrix, from which correlations are computed.
    inverse: DMatrix<f64>,
}

impl Covariance {
    /// Correlation of the errors of the unknowns `a` and `b`, given by their indices.
    pub fn correlation(&self, a: usize, b: usize) -> f64 {
        let of = |a: usize, b: usize| self.inverse[(a, b)];
        of(a, b) / (of(a, a) * of(b, b)).sqrt()
    }
}

/// The covariance at the optimum; `None` if `information` is not positive definite.
///
/// `information` is the information matrix, including that of the prior. `prior` is the diagonal of the prior's information.
/// Each of `scores` is the gradient of the cost over one block of data. The blocks are treated as independent.
///
/// The inverse of the information matrix is the covariance if the weights of the residuals are correct. The sandwich estimator
/// does not need this assumption, but with few blocks it is biased low and uncertain. The variance of each unknown is the larger
/// of the two. In the sandwich, the part of the data is multiplied by B/(B − 1) for B blocks.
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
