//! Selects rows for plots: in time order, separated at gaps, thinned without loss of extremes.

/// Indices of the rows whose times ascend, with `None` between two rows that are more than `gap_s`, s, apart.
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

/// The times of `rows`, s; a gap gets the mean of its neighbours' times.
pub(crate) fn times_of(rows: &[Option<usize>], time_s: &[f64]) -> Vec<f64> {
    let at = |k: usize| rows.get(k).copied().flatten().map_or(f64::NAN, |i| time_s[i]);
    (0..rows.len())
        .map(|k| match rows[k] {
            Some(i) => time_s[i],
            None => 0.5 * (at(k - 1) + at(k + 1)),
        })
        .collect()
}

/// The values of `rows`; NaN at a gap and beyond the end of `values`.
pub(crate) fn values_of(rows: &[Option<usize>], values: &[f64]) -> Vec<f64> {
    rows.iter().map(|row| row.and_then(|i| values.get(i)).copied().unwrap_or(f64::NAN)).collect()
}

/// Two values for every `group` values: the smallest and the largest, in their original order; NaN without finite values.
pub(crate) fn extremes(values: &[f64], group: usize) -> Vec<f64> {
    values.chunks(group).flat_map(pair_of_extremes).collect()
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

/// The times for the values of [`extremes`], s: the start and the middle of every group.
pub(crate) fn pair_times(time_s: &[f64], group: usize) -> Vec<f64> {
    time_s
        .chunks(group)
        .flat_map(|chunk| {
            let (first, last) = (chunk[0], chunk[chunk.len() - 1]);
            // A last group of a single row also needs two ascending times.
            let middle = if last > first { 0.5 * (first + last) } else { first + 1e-3 };
            [first, middle]
        })
        .collect()
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
        // The first is the gap; the second is the row beyond the end of `values`.
        assert!(values[3].is_nan() && values[4].is_nan());
    }

    #[test]
    fn thinning_keeps_a_spike_of_one_sample() {
        let mut values = vec![0.0; 1000];
        values[503] = 9.0;
        values[504] = -7.0;
        let thin = extremes(&values, 10);
        assert_eq!(thin.len(), 200);
        assert_eq!(thin[100..102], [9.0, -7.0]);
        let time: Vec<f64> = (0..1000).map(f64::from).collect();
        let thin_time = pair_times(&time, 10);
        assert_eq!(thin_time.len(), thin.len());
        assert!(thin_time.windows(2).all(|w| w[0] < w[1]));
    }
}
