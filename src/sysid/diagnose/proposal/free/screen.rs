//! Computes how much of the residual of one channel (a force or a moment) each form explains. A form is a candidate formula
//! without its coefficient. It is a regressor in a linear regression of the residual.
//!
//! The regression is over windows, short stretches of flight over which data are averaged. Residual and regressors are whitened:
//! filtered so that the noise becomes white. The nuisance parameters (coefficients of the model, sensor errors) are projected out
//! of both. The statistics are those of the search in the catalogue of known effects
//! ([`Score`](crate::diagnose::regression::rank::Score)), but without its correction for noise in the regressors. The final
//! ranking applies this correction to the best forms.
//!
//! The same statistics are computed in bootstrap draws under the null hypothesis that the model lacks nothing. In a draw, each
//! block of windows has its noise with a random sign.

use nalgebra::{DMatrix, DVector};
use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};

use crate::diagnose::proposal::forward::ORDER;
use crate::diagnose::regression::cells::Placed;
use crate::diagnose::regression::projected::Known;
use crate::diagnose::search::round::Round;
use greylag_num::stream::stream;
use greylag_physics::Channel;

use super::samples::{Average, Samples};

/// Id of the random stream of the bootstrap draws.
const NULLS: u64 = 84;

/// One channel of all flights, prepared for the evaluation of any regressor.
pub struct Screen<'a> {
    round: &'a Round,
    samples: &'a Samples,
    /// Indices of the cells of the channel. A cell has the windows of one channel of one flight.
    cells: Vec<usize>,
    windows: Vec<Vec<Average<'a>>>,
    /// Whitened regressors of the nuisance parameters, one column for each.
    known: DMatrix<f64>,
    /// One over the prior standard deviation of each nuisance parameter; 0 without a prior.
    roots: DVector<f64>,
    /// Covariance of the nuisance parameters times `known`ᵀ.
    taken: DMatrix<f64>,
    /// Whitened residual of the re-estimated model. `noise` is the whitened noise.
    residual: DVector<f64>,
    noise: DVector<f64>,
    /// For each block: its first row, its last row + 1, and its number.
    blocks: Vec<(usize, usize, usize)>,
    block_count: usize,
    /// Number of independent rows of the regression.
    support: f64,
}

/// Statistics of a regressor after the nuisance parameters were projected out of it.
#[derive(Clone, Debug)]
pub struct Kept {
    /// Squared norm of the projected regressor.
    square: f64,
    /// Product of the projected regressor with the residual.
    linear: f64,
    /// Part of `square` that comes from the prior, which acts like further rows (pseudo-observations).
    prior: f64,
    /// For each block: scalar products of the projected regressor with the residual, with the noise and with itself.
    blocks: Vec<[f64; 3]>,
    /// Regression coefficients of the regressor on the nuisance parameters, divided by their prior standard deviations.
    prior_shift: Vec<f64>,
}

/// The score of a form.
#[derive(Clone, Copy, Debug)]
pub struct Reached {
    /// Reduction of the sum of squares of the whitened residual.
    pub fall: f64,
    /// Evidence: the reduction less a penalty, or the Wald statistic, whichever is smaller. The Wald statistic allows for
    /// correlation within blocks. The penalty is ln n for the coefficient and for each constant, with n independent rows.
    pub evidence: f64,
}

/// A bootstrap draw under the null hypothesis: a sign for the noise of each block, and errors of the nuisance parameters in units
/// of their prior standard deviations.
pub struct Null {
    signs: Vec<f64>,
    prior: DVector<f64>,
}

impl<'a> Screen<'a> {
    /// Prepares the channel `channel` of `round`; `None` if no flight measures it.
    pub fn new(round: &'a Round, samples: &'a Samples, channel: Channel) -> Option<Screen<'a>> {
        let place = ORDER.iter().position(|c| *c == channel)?;
        let all = &round.cells.list;
        let cells: Vec<usize> = (0..all.len()).filter(|k| all[*k].channel == place).collect();
        let rows: usize = cells.iter().map(|k| all[*k].windows.len()).sum();
        if rows == 0 {
            return None;
        }
        let na = round.known.len();
        let mut known = DMatrix::zeros(rows, na);
        let (mut residual, mut noise) = (Vec::new(), Vec::new());
        let mut blocks = Vec::new();
        let whitener = &round.noise.whiteners[place];
        for k in &cells {
            let first = residual.len();
            let own: Placed =
                round.placed[all[*k].flight].iter().take_while(|(p, _)| *p < na).cloned().collect();
            let (places, z) = all[*k].matrix(&own, whitener);
            for (i, p) in places.iter().enumerate() {
                known.view_mut((first, *p), (z.nrows(), 1)).copy_from(&z.column(i));
            }
            let projected = &round.projected.rows[*k];
            residual.extend(projected.column(projected.ncols() - 1).iter());
            noise.extend(&round.noise.residuals[*k]);
            let own = all[*k].rows_of_blocks();
            blocks.extend(own.into_iter().map(|(b, from, to)| (first + from, first + to, b)));
        }
        let root = |k: &Known| {
            if k.width.is_finite() && k.width > 0.0 { 1.0 / k.width } else { 0.0 }
        };
        Some(Screen {
            windows: cells.iter().map(|k| samples.windows(round, *k)).collect(),
            taken: &round.projected.covariance * known.transpose(),
            roots: DVector::from_iterator(na, round.known.iter().map(root)),
            residual: DVector::from_vec(residual),
            noise: DVector::from_vec(noise),
            // neighbouring windows overlap by half, so the rows count half as independent samples
            support: 0.5 * rows as f64,
            block_count: round.cells.blocks(),
            round,
            samples,
            cells,
            known,
            blocks,
        })
    }

    /// The whitened regressor of a form with the values `values` at the samples, which are averaged over the windows.
    pub fn column(&self, values: Vec<f64>) -> Vec<f64> {
        let values = self.samples.merged(values);
        let mut rows = Vec::with_capacity(self.residual.len());
        for (cell, windows) in self.cells.iter().zip(&self.windows) {
            let cell = &self.round.cells.list[*cell];
            let whitener = &self.round.noise.whiteners[cell.channel];
            let raw: Vec<f64> = windows.iter().map(|w| w.of(&values)).collect();
            let mut from = 0;
            for &to in &cell.runs {
                rows.extend(whitener.apply(&raw[from..to]));
                from = to;
            }
        }
        rows
    }

    /// The statistics of each column of `columns`, a matrix of whitened regressors.
    pub fn keep(&self, columns: &DMatrix<f64>) -> Vec<Kept> {
        let taken = &self.taken * columns;
        let left = columns - &self.known * &taken;
        let one = |k: usize| {
            let (x, own) = (columns.column(k), left.column(k));
            let prior_shift: Vec<f64> =
                taken.column(k).iter().zip(self.roots.iter()).map(|(t, w)| t * w).collect();
            let mut blocks = vec![[0.0; 3]; self.block_count];
            for &(from, to, b) in &self.blocks {
                let part = own.rows(from, to - from);
                blocks[b][0] += part.dot(&self.residual.rows(from, to - from));
                blocks[b][1] += part.dot(&self.noise.rows(from, to - from));
                blocks[b][2] += part.norm_squared();
            }
            Kept {
                square: x.dot(&own),
                linear: x.dot(&self.residual),
                prior: prior_shift.iter().map(|t| t * t).sum(),
                blocks,
                prior_shift,
            }
        };
        (0..columns.ncols()).map(one).collect()
    }

    /// The regressor `column` less the part that the nuisance parameters explain, followed by the rows of the prior.
    pub fn projected(&self, column: &DVector<f64>) -> DVector<f64> {
        let taken = &self.taken * column;
        stacked(column - &self.known * &taken, -self.roots.component_mul(&taken))
    }

    /// Whitened residual of the re-estimated model, followed by the rows of the prior.
    pub fn residual(&self) -> DVector<f64> {
        let tuned = self.round.known.iter().zip(self.round.projected.tuned.iter());
        let off = DVector::from_iterator(self.roots.len(), tuned.map(|(k, t)| k.offset - t));
        stacked(self.residual.clone(), self.roots.component_mul(&off))
    }

    /// The bootstrap draw number `k`. It depends on `seed` and `k` only.
    pub fn null(&self, seed: u64, k: usize) -> Null {
        let mut random = stream(seed, &[NULLS, k as u64]);
        let mut sign = || if random.random::<bool>() { 1.0 } else { -1.0 };
        let signs = (0..self.block_count).map(|_| sign()).collect();
        let prior = DVector::from_fn(self.roots.len(), |_, _| StandardNormal.sample(&mut random));
        Null { signs, prior }
    }

    /// Whitened residual of the re-estimated model in the draw `null`, followed by the rows of the prior.
    pub fn residual_of(&self, null: &Null) -> DVector<f64> {
        let mut noise = self.noise.clone();
        for &(from, to, b) in &self.blocks {
            noise.rows_mut(from, to - from).scale_mut(null.signs[b]);
        }
        let wrong = &self.round.projected.covariance * self.roots.component_mul(&null.prior);
        let taken = &self.taken * &noise + wrong;
        let prior = &null.prior - self.roots.component_mul(&taken);
        stacked(noise - &self.known * taken, prior)
    }

    /// The score in the measured flights of a form with the statistics `kept` and `constants` constants.
    pub fn measured(&self, kept: &Kept, constants: usize) -> Reached {
        let product = |b: usize| kept.blocks[b][0];
        self.reached(kept, kept.linear, product, constants)
    }

    /// The score in the draw `null` of a form with the statistics `kept` and `constants` constants.
    pub fn by_chance(&self, kept: &Kept, null: &Null, constants: usize) -> Reached {
        let product = |b: usize| null.signs[b] * kept.blocks[b][1];
        let noise: f64 = (0..self.block_count).map(product).sum();
        let prior: f64 = kept.prior_shift.iter().zip(null.prior.iter()).map(|(t, g)| t * g).sum();
        self.reached(kept, noise - prior, product, constants)
    }

    fn reached(
        &self,
        kept: &Kept,
        linear: f64,
        product: impl Fn(usize) -> f64,
        constants: usize,
    ) -> Reached {
        let amount = linear / kept.square;
        let fall = linear * amount;
        let count = self.block_count as f64;
        let scatter: f64 =
            (0..self.block_count).map(|b| (product(b) - kept.blocks[b][2] * amount).powi(2)).sum();
        let meat = kept.prior + count / (count - 1.0).max(1.0) * scatter;
        let wald = if meat > 0.0 { linear * linear / meat } else { 0.0 };
        let gain = fall - self.price(constants);
        let evidence = gain.min(wald);
        match evidence.is_finite() {
            true => Reached { fall, evidence },
            // the regressor is zero, not finite, or a linear combination of the regressors of the nuisance parameters
            false => Reached { fall: 0.0, evidence: f64::NEG_INFINITY },
        }
    }

    /// The penalty for a coefficient and `constants` constants, in units of the sum of squares of the whitened residual.
    pub fn price(&self, constants: usize) -> f64 {
        (1 + constants) as f64 * self.support.max(2.0).ln()
    }
}

fn stacked(rows: DVector<f64>, prior: DVector<f64>) -> DVector<f64> {
    let count = rows.len();
    let mut all = rows.resize_vertically(count + prior.len(), 0.0);
    all.rows_mut(count, prior.len()).copy_from(&prior);
    all
}
