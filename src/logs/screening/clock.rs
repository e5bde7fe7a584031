//! Checks whether the times of a log are in seconds, or in milliseconds, microseconds or nanoseconds.

use super::cured;
use super::relation::{near, quantile, through_origin, values};
use crate::Sample;
use crate::finding::Finding;

/// Median difference between the times of two rows from which the unit of time is checked, s. With one row per second, a log
/// would be unusable even if its times were in seconds.
const SUSPICIOUS_S: f64 = 0.9;
/// Number of rows over which the change of roll is compared with the integral of the roll rate.
const SPAN: usize = 20;

/// Compares the change of the roll angle with the integral of the roll rate over the logged time. Returns a finding
/// if the time is not in seconds.
pub fn check(rows: &[Sample]) -> Option<Finding> {
    let times = values(rows, |s| s.time_s);
    let periods: Vec<f64> = times.windows(2).map(|w| w[1] - w[0]).filter(|p| *p > 0.0).collect();
    let period = quantile(&periods, 0.5)?;
    if period < SUSPICIOUS_S {
        return None;
    }
    let pairs = rows.chunks(SPAN).filter(|c| c.len() == SPAN).map(|c| {
        let step = |w: &[Sample]| {
            0.5 * (w[0].rates_radps[0] + w[1].rates_radps[0]) * (w[1].time_s - w[0].time_s)
        };
        let turned: f64 = c.windows(2).map(step).sum();
        (turned, c[SPAN - 1].attitude_rad[0] - c[0].attitude_rad[0])
    });
    let slope = through_origin(pairs)?.slope.abs();
    [("milliseconds", 1e-3), ("microseconds", 1e-6), ("nanoseconds", 1e-9)]
        .into_iter()
        .find(|(_, factor)| near(slope, *factor, 0.7))
        .map(|(unit, factor)| {
            cured(
                format!("time_s looks like {unit}, not seconds (its rows are {period:.0} apart)"),
                "time_s",
                factor,
            )
        })
}
