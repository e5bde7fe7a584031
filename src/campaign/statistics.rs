//! Statistics over runs with different seeds: median, interquartile mean and mean, each with its 95 % confidence interval.
//!
//! The method follows the package rliable (Agarwal et al. 2021). The interquartile mean omits the smallest and the largest
//! quarter of all scores. Intervals are percentiles of a bootstrap that draws runs with replacement within each stratum. A
//! stratum is a task: the runs that differ only in their seed. One definition differs from rliable: the median is taken
//! over all runs, not over the means of the tasks. The paper \[GSFM26\] (see `src/lib.rs`) does not state which of the two
//! medians its tables contain.

use greylag_num::bootstrap;
use greylag_num::statistics::{interquartile_mean, mean, quantile};

/// Seed of the bootstrap's random numbers. It is constant, so that the same runs give the same intervals.
const SEED: u64 = 95;

/// A statistic with its confidence interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Value of the statistic.
    pub value: f64,
    /// Bounds of its 95 % confidence interval.
    pub ci95: [f64; 2],
}

/// Summary of the scores of several runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aggregate {
    /// Number of runs.
    pub count: usize,
    /// Median of the scores.
    pub median: Estimate,
    /// Interquartile mean of the scores.
    pub iqm: Estimate,
    /// Mean of the scores.
    pub mean: Estimate,
    /// Smallest of all scores.
    pub min: f64,
    /// Largest of all scores.
    pub max: f64,
}

/// Summarises the scores of all runs. `strata` has one vector for each task, with one score for each seed. `None` if there
/// are no runs.
pub fn aggregate(strata: &[Vec<f64>]) -> Option<Aggregate> {
    let runs: Vec<f64> = strata.concat();
    let estimate = |statistic: &dyn Fn(&[f64]) -> f64| Estimate {
        value: statistic(&runs),
        ci95: bootstrap::stratified_interval(strata, SEED, statistic),
    };
    (!runs.is_empty()).then(|| Aggregate {
        count: runs.len(),
        median: estimate(&|x| quantile(x, 0.5)),
        iqm: estimate(&interquartile_mean),
        mean: estimate(&mean),
        min: quantile(&runs, 0.0),
        max: quantile(&runs, 1.0),
    })
}

/// Mean of `b` minus mean of `a`. For the interval, `a` and `b` are resampled independently. `None` if either is empty.
pub fn difference(a: &[f64], b: &[f64]) -> Option<Estimate> {
    if a.is_empty() || b.is_empty() {
        return None;
    }
    let gap = |runs: &[f64]| mean(&runs[a.len()..]) - mean(&runs[..a.len()]);
    let strata = [a.to_vec(), b.to_vec()];
    let ci95 = bootstrap::stratified_interval(&strata, SEED, gap);
    Some(Estimate { value: gap(&strata.concat()), ci95 })
}

/// Mean of paired differences. `strata` has one vector of differences for each stratum. For the interval, each stratum is
/// resampled separately. `None` if there are no pairs.
pub fn paired_difference(strata: &[Vec<f64>]) -> Option<Estimate> {
    let gaps = strata.concat();
    if gaps.is_empty() {
        return None;
    }
    let ci95 = bootstrap::stratified_interval(strata, SEED, mean);
    Some(Estimate { value: mean(&gaps), ci95 })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference values for ten runs from numpy and scipy, as in rliable: `np.median`, `scipy.stats.trim_mean(x,
    /// 0.25)`, `np.mean`.
    #[test]
    fn ten_runs_are_summed_up_as_rliable_does() {
        let runs = vec![0.91, 1.2, 0.7, 0.85, 1.4, 0.95, 1.05, 0.6, 2.5, 1.1];
        let all = aggregate(&[runs]).unwrap();
        assert_eq!(all.count, 10);
        for (value, wanted) in [
            (all.median.value, 1.0),
            // scipy omits int(0.25 · 10) = 2 runs at each end and averages 0.85, 0.91, 0.95, 1.05, 1.1 and 1.2
            (all.iqm.value, 6.06 / 6.0),
            (all.mean.value, 1.126),
            (all.min, 0.6),
            (all.max, 2.5),
        ] {
            assert!((value - wanted).abs() < 1e-12, "{value} {wanted}");
        }
        for e in [all.median, all.iqm, all.mean] {
            assert!(e.ci95[0] < e.value && e.value < e.ci95[1], "{e:?}");
        }
    }

    /// The scores of the two tasks differ by 10. Within a task all scores are equal. Resampling across tasks would give the
    /// mean an interval several units wide.
    #[test]
    fn strata_keep_the_difference_of_tasks_out_of_the_interval() {
        let all = aggregate(&[vec![1.0; 5], vec![11.0; 5]]).unwrap();
        assert_eq!((all.mean.value, all.mean.ci95), (6.0, [6.0, 6.0]));
        assert_eq!(difference(&[1.0; 3], &[3.0; 3]).unwrap().ci95, [2.0, 2.0]);
        assert!(aggregate(&[]).is_none() && difference(&[], &[1.0]).is_none());
    }
}
