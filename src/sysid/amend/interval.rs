//! How well coefficients are known: posterior covariance, corrected for errors that hang together.

use nalgebra::{DMatrix, DVector};

/// What is left in doubt of every unknown.
pub(super) struct Covariance {
    /// Standard deviations, in the order of the unknowns.
    pub sd: Vec<f64>,
    /// The inverse information.
    inverse: DMatrix<f64>,
}

impl Covariance {
    /// How two unknowns' errors go together.
    pub fn correlation(&self, a: usize, b: usize) -> f64 {
        let of = |a: usize, b: usize| self.inverse[(a, b)];
        of(a, b) / (of(a, a) * of(b, b)).sqrt()
    }
}

/// The covariance at the optimum: `information` with the prior's, whose diagonal is `prior`, and the
/// `scores` (gradients of the data's cost) of blocks of data that are taken for independent.
///
/// The inverse information holds if the weights tell the truth, the sandwich between the blocks' scores
/// if there are many blocks. With few, the sandwich is both narrow and uncertain, so each unknown's
/// variance is the larger of the two, the sandwich multiplied by B/(B − 1).
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
