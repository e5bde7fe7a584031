//! Part of the residual that a flexible model without physics (a ridge regression on many features) could remove,
//! cross-validated by flight.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rand::RngExt;
use rayon::prelude::*;

use crate::diagnose::regression::projected::scaled_inverse;
use crate::diagnose::search::nulls::threshold;
use crate::diagnose::search::round::Round;
use greylag_num::stream::stream;

/// Ridge parameters that are tried, relative to the mean squared norm of a feature.
const RIDGES: [f64; 4] = [1e-3, 1e-2, 1e-1, 1.0];
/// Id of the random stream for the draws of noise.
const NULLS: u64 = 83;
/// Number of folds into which a single flight is divided. With several flights, each flight is a fold.
const FOLDS: usize = 3;

/// Reduction of the residual by the flexible model, for each channel and in total.
#[derive(Clone, Debug)]
pub struct Remainder {
    /// Reduction of the whitened residual sum of squares for each channel, on flights to which the flexible model was not
    /// fitted.
    pub removable: [f64; 6],
    /// Critical value of the reduction for each channel, from pure noise.
    pub threshold: [f64; 6],
    /// Sum of the reductions over all channels.
    pub total: f64,
    /// Critical value of this sum, from pure noise.
    pub total_threshold: f64,
}

/// Data of one channel, divided into the folds of the cross-validation.
struct Channel {
    folds: Vec<Fold>,
}

struct Fold {
    features: DMatrix<f64>,
    target: DVector<f64>,
    noise: DVector<f64>,
    blocks: Vec<usize>,
    /// Cholesky factors of the normal equations of all other folds, one for each ridge parameter.
    others: Vec<Cholesky<f64, Dyn>>,
}

/// Computes the part of the residual of `round` that a flexible model could remove. The critical values come from `count` draws
/// of noise. The significance level is `level` for the total and `level` / 6 for each channel.
pub fn remainder(round: &Round, count: usize, level: f64) -> Remainder {
    let channels: Vec<Option<Channel>> =
        (0..6).into_par_iter().map(|c| channel(round, c)).collect();
    let gain = |sign: Option<&[f64]>| -> [f64; 6] {
        std::array::from_fn(|c| channels[c].as_ref().map_or(0.0, |ch| ch.gain(sign)))
    };
    let removable = gain(None);
    let blocks = round.cells.blocks();
    let nulls: Vec<[f64; 6]> = (0..count)
        .into_par_iter()
        .map(|k| {
            let mut random = stream(round.seed, &[NULLS, k as u64]);
            let signs: Vec<f64> =
                (0..blocks).map(|_| if random.random::<bool>() { 1.0 } else { -1.0 }).collect();
            gain(Some(&signs))
        })
        .collect();
    let over = |of: &dyn Fn(&[f64; 6]) -> f64, level: f64| {
        let values: Vec<f64> = nulls.iter().map(of).collect();
        threshold(&values, level)
    };
    Remainder {
        removable,
        threshold: std::array::from_fn(|c| over(&|n| n[c], level / 6.0)),
        total: removable.iter().sum(),
        total_threshold: over(&|n| n.iter().sum(), level),
    }
}

fn channel(round: &Round, channel: usize) -> Option<Channel> {
    let cells: Vec<usize> =
        (0..round.cells.list.len()).filter(|k| round.cells.list[*k].channel == channel).collect();
    let pieces = if cells.len() >= 2 { 1 } else { FOLDS };
    let projected = projected_features(round, &cells)?;
    let mut folds = Vec::new();
    for (k, (features, noise, target)) in cells.iter().zip(projected) {
        let rows = features.nrows();
        for piece in 0..pieces {
            let (from, to) = (rows * piece / pieces, rows * (piece + 1) / pieces);
            folds.push(Fold {
                features: features.rows(from, to - from).into_owned(),
                target: target.rows(from, to - from).into_owned(),
                noise: noise.rows(from, to - from).into_owned(),
                blocks: round.cells.list[*k].blocks[from..to].to_vec(),
                others: Vec::new(),
            });
        }
    }
    let grams: Vec<DMatrix<f64>> = folds.iter().map(|f| f.features.tr_mul(&f.features)).collect();
    let count = folds.len();
    for (own, fold) in folds.iter_mut().enumerate() {
        let width = fold.features.ncols();
        let sum = (0..count)
            .filter(|k| *k != own)
            .fold(DMatrix::zeros(width, width), |s, k| s + &grams[k]);
        let scale = sum.trace() / width as f64;
        for ridge in RIDGES {
            let ridged = &sum + DMatrix::identity(width, width) * (ridge * scale + 1e-9);
            fold.others.push(ridged.cholesky()?);
        }
    }
    Some(Channel { folds })
}

/// Features, noise and residual of one channel of one flight.
type Projected = (DMatrix<f64>, DVector<f64>, DVector<f64>);

/// Returns whitened features of unit RMS, noise and residual of each of `cells`. A cell has the data of one channel of one
/// flight. The nuisance parameters are projected out.
///
/// The nuisance parameters are fitted by ordinary least squares, without the errors-in-variables correction. That correction
/// leaves a bias in the residual, which the flexible model would fit.
fn projected_features(round: &Round, cells: &[usize]) -> Option<Vec<Projected>> {
    let na = round.known.len();
    let mut all = Vec::new();
    for k in cells {
        let cell = &round.cells.list[*k];
        let whitener = &round.noise.whiteners[cell.channel];
        let (places, z) = cell.matrix(&round.placed[cell.flight], whitener);
        let known = places.iter().take_while(|p| **p < na).count();
        let first = places.iter().take_while(|p| **p <= round.last).count();
        let mut a = DMatrix::zeros(z.nrows(), na);
        (0..known).for_each(|i| a.set_column(places[i], &z.column(i)));
        let mut y = z.columns(first, z.ncols() - first).into_owned();
        y = y.insert_columns(0, 2, 0.0);
        y.set_column(0, &DVector::from_column_slice(&round.noise.residuals[*k]));
        y.set_column(1, &z.column(first - 1));
        all.push((a, y));
    }
    let mut gram = DMatrix::zeros(na, na);
    let mut products = DMatrix::zeros(na, all.first()?.1.ncols());
    for (a, y) in &all {
        gram += a.tr_mul(a);
        products += a.tr_mul(y);
    }
    for (k, known) in round.known.iter().enumerate() {
        gram[(k, k)] += known.width.powi(-2).max(1e-12);
    }
    let taken = scaled_inverse(&gram)? * products;
    let mut square: DVector<f64> = DVector::zeros(taken.ncols());
    let mut rest: Vec<DMatrix<f64>> = Vec::new();
    for (a, y) in all {
        let left = y - a * &taken;
        for (j, column) in left.column_iter().enumerate() {
            square[j] += column.norm_squared();
        }
        rest.push(left);
    }
    let rows: usize = rest.iter().map(DMatrix::nrows).sum();
    let split = |left: DMatrix<f64>| {
        let noise = left.column(0).into_owned();
        let target = left.column(1).into_owned();
        let mut features = left.remove_columns(0, 2);
        for (j, mut column) in features.column_iter_mut().enumerate() {
            let size: f64 = (square[j + 2] / rows as f64).sqrt();
            column /= size.max(1e-12);
        }
        (features, noise, target)
    };
    Some(rest.into_iter().map(split).collect())
}

impl Channel {
    /// Reduction of the target's sum of squares, summed over the held-out folds, with the best ridge parameter; at least zero.
    /// The target is the residual. If `signs` is given, the target is the noise, multiplied by the sign of each block.
    fn gain(&self, signs: Option<&[f64]>) -> f64 {
        let targets: Vec<DVector<f64>> = self
            .folds
            .iter()
            .map(|f| match signs {
                None => f.target.clone(),
                Some(s) => DVector::from_fn(f.noise.len(), |i, _| f.noise[i] * s[f.blocks[i]]),
            })
            .collect();
        let products: Vec<DVector<f64>> =
            self.folds.iter().zip(&targets).map(|(f, y)| f.features.tr_mul(y)).collect();
        let whole = products.iter().fold(DVector::zeros(products[0].len()), |s, p| s + p);
        let of_ridge = |ridge: usize| {
            let folds = self.folds.iter().zip(&targets).zip(&products);
            let of = |((fold, target), own): ((&Fold, &DVector<f64>), &DVector<f64>)| {
                let weights = fold.others[ridge].solve(&(&whole - own));
                let left = target - &fold.features * weights;
                target.norm_squared() - left.norm_squared()
            };
            folds.map(of).sum::<f64>()
        };
        (0..RIDGES.len()).map(of_ridge).fold(0.0, f64::max)
    }
}
