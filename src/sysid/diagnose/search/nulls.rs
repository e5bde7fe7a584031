//! Critical value of the evidence, from bootstrap draws under the null hypothesis that no effect is missing.
//!
//! The evidence is the test statistic of a candidate, a physical effect that the model may lack. A block is a section of a flight
//! with its own random sign.

use nalgebra::DVector;
use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

use crate::diagnose::regression::projected::Projected;
use crate::diagnose::regression::rank::{Draw, Trial};
use greylag_num::stream::stream;

/// Number of the random stream for the bootstrap draws.
const NULLS: u64 = 80;

/// Draw number `k` under the null hypothesis (wild block bootstrap): products of the candidates' regressors with noise alone.
/// The random sign of a block is common to all channels. Random errors of the prior means are added.
pub fn draw(p: &Projected, seed: u64, k: usize) -> Draw {
    let mut random = stream(seed, &[NULLS, k as u64]);
    let mut total = DVector::zeros(p.width());
    let blocks: Vec<DVector<f64>> = p
        .noise
        .iter()
        .map(|noise| {
            let sign = if random.random::<bool>() { 1.0 } else { -1.0 };
            let block = noise * sign;
            total += &block;
            block
        })
        .collect();
    let prior = DVector::from_fn(p.prior_root.ncols(), |_, _| StandardNormal.sample(&mut random));
    total += &p.prior_root * prior;
    Draw { total, blocks }
}

/// Evidence of the best candidate in each of `count` draws under the null hypothesis, in ascending order.
pub fn best(p: &Projected, trials: &[Trial], seed: u64, count: usize) -> Vec<f64> {
    let grams = p.grams();
    let mut best: Vec<f64> = (0..count)
        .into_par_iter()
        .map(|k| {
            let draw = draw(p, seed, k);
            let evidence = trials.iter().filter_map(|t| t.score(&grams, &draw)).map(|s| s.evidence);
            evidence.fold(f64::NEG_INFINITY, f64::max)
        })
        .collect();
    best.sort_by(f64::total_cmp);
    best
}

/// The quantile 1 − `level` of a Gumbel distribution with the mean and standard deviation of `sample`. Infinite for fewer than
/// five finite values.
///
/// The Gumbel distribution approximates the maximum of many values.
pub fn threshold(sample: &[f64], level: f64) -> f64 {
    let finite: Vec<f64> = sample.iter().copied().filter(|x| x.is_finite()).collect();
    let count = finite.len() as f64;
    if finite.len() < 5 {
        return f64::INFINITY;
    }
    let mean = finite.iter().sum::<f64>() / count;
    let variance = finite.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (count - 1.0);
    let scale = (6.0 * variance).sqrt() / std::f64::consts::PI;
    const EULER: f64 = 0.577_215_664_901_532_9;
    mean - EULER * scale - scale * (-(1.0 - level).ln()).ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_threshold_of_known_maxima() {
        // The largest of 20 values E = −2 ln U (chi-square with two degrees of freedom) has the 99 % quantile −2 ln(1 −
        // 0.99^(1/20)).
        let exact = -2.0 * (1.0 - 0.99_f64.powf(1.0 / 20.0)).ln();
        let mut random = stream(5, &[]);
        let mut largest =
            || (0..20).map(|_| -2.0 * random.random::<f64>().ln()).fold(0.0, f64::max);
        let sample: Vec<f64> = (0..4000).map(|_| largest()).collect();
        let found = threshold(&sample, 0.01);
        // 4000 draws: the standard deviation of the scale is about 2 %
        assert!((found / exact - 1.0).abs() < 0.06, "{found} {exact}");
    }
}
