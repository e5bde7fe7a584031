//! Finds the cells in which a model fails, with a controlled false discovery rate.
//!
//! A cell is one channel (such as the lift) in one bin of a regime variable, which describes the flight condition (such as α).
//! The model fails in a cell if its mean residual there is not zero. A model has several hundred cells. By chance, one in
//! twenty of them has a 95 % interval that excludes zero. Benjamini and Hochberg's procedure (J. R. Stat. Soc. B 57, 1995, p.
//! 289) limits the expected fraction of such false cells among the reported cells to 5 %. Cells that share samples are
//! positively dependent. The procedure remains valid under positive dependence (Benjamini and Yekutieli, Ann. Stat. 29, 2001,
//! p. 1165).

use super::doubt::NORMAL_95;
use super::result::{Bin, RegimeBins};

/// False discovery rate among the cells reported as failing.
pub const FALSE_SHARE: f64 = 0.05;

/// Sets the q-value of every cell of a model that has enough independent samples. The q-values of other cells stay NaN.
pub fn control(channels: &mut [Vec<RegimeBins>]) {
    let mut cells: Vec<&mut Bin> = channels
        .iter_mut()
        .flatten()
        .flat_map(|b| &mut b.bins)
        .filter(|b| b.supported && p_value(b).is_finite())
        .collect();
    cells.sort_by(|a, b| p_value(a).total_cmp(&p_value(b)));
    let count = cells.len() as f64;
    let mut least = 1.0_f64;
    for (k, cell) in cells.iter_mut().enumerate().rev() {
        least = least.min(p_value(cell) * count / (k + 1) as f64);
        cell.q_value = least;
    }
}

/// Whether the model fails in a cell: the q-value is at most `FALSE_SHARE`.
pub fn found(bin: &Bin) -> bool {
    bin.q_value <= FALSE_SHARE
}

/// Two-sided p-value of the hypothesis that the mean is zero.
///
/// The distance of the mean from that end of its 95 % interval which is nearer to zero counts as 1.96 standard deviations of
/// a normal distribution.
fn p_value(bin: &Bin) -> f64 {
    let [low, high] = bin.interval;
    let half = if bin.mean > 0.0 { bin.mean - low } else { high - bin.mean };
    libm::erfc(NORMAL_95 * bin.mean.abs() / half / std::f64::consts::SQRT_2)
}

#[cfg(test)]
mod tests {
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::weak_form::channels::RegimeVariable;
    use greylag_num::stream::stream;

    /// Cells whose means have unit standard deviation; the first `real` cells have the expected mean 4, the others 0.
    fn cells(trial: u64, real: usize) -> Vec<RegimeBins> {
        let mut random = stream(trial, &[3]);
        let mut bin = |k: usize| {
            let noise: f64 = StandardNormal.sample(&mut random);
            let mean = noise + if k < real { 4.0 } else { 0.0 };
            Bin {
                low: 0.0,
                high: 1.0,
                center: 0.5,
                label: String::new(),
                mean,
                interval: [mean - 1.96, mean + 1.96],
                q_value: f64::NAN,
                measured: 0.0,
                independent: 50,
                supported: true,
            }
        };
        let bins = (0..200).map(&mut bin).collect();
        let variable = RegimeVariable::Alpha;
        vec![RegimeBins { variable, name: "", unit: "", explained: 0.0, bins }]
    }

    #[test]
    fn false_discoveries_stay_below_their_share_and_true_ones_are_found() {
        let (mut shares, mut hits) = (0.0, 0);
        for trial in 0..200 {
            let mut channels = vec![cells(trial, 20)];
            control(&mut channels);
            let bins = &channels[0][0].bins;
            let named: Vec<usize> = (0..200).filter(|k| found(&bins[*k])).collect();
            let wrong = named.iter().filter(|k| **k >= 20).count();
            shares += wrong as f64 / named.len().max(1) as f64;
            hits += named.len() - wrong;
        }
        // the expected fraction of false cells is 0.05 × 180 / 200; its standard error over 200 trials is 0.004
        assert!(shares / 200.0 < 0.06, "{}", shares / 200.0);
        // without the procedure, 95 % intervals would report 9 false cells in each trial, a third of all reported cells
        assert!(hits as f64 / (200.0 * 20.0) > 0.85, "{hits}");
    }

    #[test]
    fn where_nothing_is_wrong_hardly_anything_is_named() {
        let any = (0..200).filter(|trial| {
            let mut channels = vec![cells(*trial, 0)];
            control(&mut channels);
            channels[0][0].bins.iter().any(found)
        });
        // the expected count is 5 % of 200, and three binomial standard deviations are 9
        assert!(any.count() < 20);
    }
}
