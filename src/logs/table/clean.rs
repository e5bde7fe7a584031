//! Selects the usable samples of a channel of a log: those with finite values at increasing times.

use std::borrow::Cow;

/// A time counts as damaged if the next two times are earlier by more than this, s.
const AHEAD_S: f64 = 1.0;

/// Returns the times and the values of the samples with finite values at increasing times. `all_times` has the time of each
/// sample, and each entry of `all` one value per sample. If all samples are usable, `all_times` is borrowed.
pub(super) fn cleaned(all_times: &[f64], all: Vec<Vec<f64>>) -> (Cow<'_, [f64]>, Vec<Vec<f64>>) {
    let increasing = all_times.windows(2).all(|w| w[0] < w[1]);
    let finite = |values: &[f64]| values.iter().all(|x| x.is_finite());
    if increasing && finite(all_times) && all.iter().all(|s| finite(s)) {
        return (Cow::Borrowed(all_times), all);
    }
    let mut times: Vec<f64> = Vec::with_capacity(all_times.len());
    let mut series: Vec<Vec<f64>> = vec![Vec::with_capacity(all_times.len()); all.len()];
    for (i, t) in all_times.iter().enumerate() {
        let last = times.last().copied().unwrap_or(f64::NEG_INFINITY);
        let usable = t.is_finite() && *t > last && !is_ahead(&all_times[i..], last);
        if usable && all.iter().all(|s| s[i].is_finite()) {
            times.push(*t);
            series.iter_mut().zip(&all).for_each(|(to, from)| to.push(from[i]));
        }
    }
    (Cow::Owned(times), series)
}

/// Whether the first of `times` is damaged: it is far ahead of the next two, and these are later than `last` (s), the last time
/// that was kept. If a damaged time were kept, the samples after it would be dropped as out of order.
fn is_ahead(times: &[f64], last: f64) -> bool {
    let [t, next @ ..] = times else { return false };
    let continues = |next: &f64| *next > last && *next < t - AHEAD_S;
    next.len() >= 2 && next[..2].iter().all(continues)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_damaged_time_costs_its_own_sample_only() {
        let mut times: Vec<f64> = (0..100).map(|k| 0.01 * f64::from(k)).collect();
        times[40] = 1e6;
        times[60] = 0.0;
        let values = vec![(0..100).map(f64::from).collect()];
        let (kept, series) = cleaned(&times, values);
        assert_eq!((kept.len(), series[0].len()), (98, 98));
        assert!(kept.windows(2).all(|w| w[0] < w[1]) && series[0][40] == 41.0);
        // the samples after a restart of the clock are dropped, because they belong to another recording
        let again: Vec<f64> = (0..100).map(|k| f64::from(k % 50)).collect();
        let (kept, _) = cleaned(&again, vec![vec![0.0; 100]]);
        assert_eq!(kept.len(), 50);
    }
}
