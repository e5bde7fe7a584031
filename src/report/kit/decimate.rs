//! Selects rows of a log for plots. The rows are in time order and interrupted at gaps. Thinning keeps the extremes.

use std::ops::Range;

/// Indices of the rows. A row whose time is not later than that of the row before is left out. `None` stands for a gap,
/// between two rows that are more than `gap_s` (s) apart.
pub(crate) fn rows_in_order(time_s: &[f64], gap_s: f64) -> Vec<Option<usize>> {
    let mut rows = Vec::with_capacity(time_s.len());
    let mut last = f64::NEG_INFINITY;
    for (i, &t) in time_s.iter().enumerate() {
        if !t.is_finite() || t <= last {
            continue;
        }
        if last.is_finite() && t - last > gap_s {
            rows.push(None);
        }
        rows.push(Some(i));
        last = t;
    }
    rows
}

/// The times of `rows`, s. The time of a gap is the mean of its neighbours' times.
pub(crate) fn times_of(rows: &[Option<usize>], time_s: &[f64]) -> Vec<f64> {
    let at = |k: usize| rows.get(k).copied().flatten().map_or(f64::NAN, |i| time_s[i]);
    (0..rows.len())
        .map(|k| match rows[k] {
            Some(i) => time_s[i],
            None => 0.5 * (at(k - 1) + at(k + 1)),
        })
        .collect()
}

/// The values of `rows`. A gap and a row beyond the end of `values` have the value NaN.
pub(crate) fn values_of(rows: &[Option<usize>], values: &[f64]) -> Vec<f64> {
    rows.iter().map(|row| row.and_then(|i| values.get(i)).copied().unwrap_or(f64::NAN)).collect()
}

/// Consecutive groups of at most `size` rows, as ranges of positions in `rows`. The first gap among every `size` rows is a
/// group of its own, so that the thinned line is interrupted there.
pub(crate) fn groups(rows: &[Option<usize>], size: usize) -> Vec<Range<usize>> {
    let mut groups = Vec::new();
    for (k, chunk) in rows.chunks(size).enumerate() {
        let (start, end) = (k * size, k * size + chunk.len());
        match chunk.iter().position(Option::is_none) {
            None => groups.push(start..end),
            Some(at) => {
                let gap = start + at;
                groups.extend([start..gap, gap..gap + 1, gap + 1..end]);
            }
        }
    }
    groups.retain(|group| !group.is_empty());
    groups
}

/// Two values for every group: the smallest and the largest, in their order in time. They are NaN if no value is finite. A
/// group of a single row gives one value.
pub(crate) fn extremes(values: &[f64], groups: &[Range<usize>]) -> Vec<f64> {
    let mut thin = Vec::with_capacity(2 * groups.len());
    for group in groups {
        let pair = pair_of_extremes(&values[group.clone()]);
        thin.extend_from_slice(&pair[..group.len().min(2)]);
    }
    thin
}

fn pair_of_extremes(chunk: &[f64]) -> [f64; 2] {
    let finite = || chunk.iter().enumerate().filter(|(_, v)| v.is_finite());
    let low = finite().min_by(|a, b| a.1.total_cmp(b.1));
    let high = finite().max_by(|a, b| a.1.total_cmp(b.1));
    match (low, high) {
        (Some((i, &low)), Some((j, &high))) if i <= j => [low, high],
        (Some((_, &low)), Some((_, &high))) => [high, low],
        _ => [f64::NAN; 2],
    }
}

/// The times for the values of [`extremes`], s: the start and the middle of every group, or the time of a single row.
pub(crate) fn pair_times(time_s: &[f64], groups: &[Range<usize>]) -> Vec<f64> {
    let mut times = Vec::with_capacity(2 * groups.len());
    for group in groups {
        let (first, last) = (time_s[group.start], time_s[group.end - 1]);
        times.push(first);
        if group.len() > 1 {
            times.push(0.5 * (first + last));
        }
    }
    times
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pause_becomes_a_gap_and_disorder_is_left_out() {
        let time = [0.0, 0.01, 0.005, f64::NAN, 0.02, 1.02];
        let rows = rows_in_order(&time, 0.1);
        assert_eq!(rows, [Some(0), Some(1), Some(4), None, Some(5)]);
        assert_eq!(times_of(&rows, &time), [0.0, 0.01, 0.02, 0.52, 1.02]);
        let values = values_of(&rows, &[1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(values[..3], [1.0, 2.0, 5.0]);
        // Value 3 belongs to the gap, and value 4 to row 5, which is beyond the end of the values.
        assert!(values[3].is_nan() && values[4].is_nan());
    }

    #[test]
    fn thinning_keeps_a_spike_of_one_sample() {
        let mut values = vec![0.0; 1000];
        values[503] = 9.0;
        values[504] = -7.0;
        let rows: Vec<Option<usize>> = (0..1000).map(Some).collect();
        let tens = groups(&rows, 10);
        let thin = extremes(&values, &tens);
        assert_eq!(thin.len(), 200);
        assert_eq!(thin[100..102], [9.0, -7.0]);
        let time: Vec<f64> = (0..1000).map(f64::from).collect();
        let thin_time = pair_times(&time, &tens);
        assert_eq!(thin_time.len(), thin.len());
        assert!(thin_time.windows(2).all(|w| w[0] < w[1]));
    }

    #[test]
    fn a_gap_within_a_group_interrupts_the_thinned_line() {
        let at = |i: i32| 0.01 * f64::from(i) + if i < 47 { 0.0 } else { 1.0 };
        let time: Vec<f64> = (0..100).map(at).collect();
        let rows = rows_in_order(&time, 0.1);
        let tens = groups(&rows, 10);
        let thin = extremes(&values_of(&rows, &[1.0; 100]), &tens);
        let thin_time = pair_times(&times_of(&rows, &time), &tens);
        assert_eq!(thin_time.len(), thin.len());
        assert!(thin_time.windows(2).all(|w| w[0] < w[1]));
        let gap = thin.iter().position(|v| v.is_nan()).expect("a gap");
        assert!(thin_time[gap - 1] < 0.47 && thin_time[gap + 1] > 1.46, "{thin_time:?}");
    }
}
