//! Quality of a channel's samples: rate of new values, interpolated values, frozen values, spikes.
//!
//! A table that was resampled to one clock has a value in every row. Between the samples of a slow sensor, the values were
//! interpolated on a straight line or held. Such values are not measurements. Second differences are zero on a straight line,
//! first differences are zero while a value is held. A kink is a sample at which two straight lines meet.

use serde::Serialize;

use super::topics::period_s;
use greylag_num::statistics::quantile;

/// Quality of the samples of a channel.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Quality {
    /// Rate of new values, Hz; 0 if the values change too rarely for an estimate.
    pub native_hz: f64,
    /// Whether most samples lie on straight lines between other samples.
    pub interpolated: bool,
    /// Decimal step to which the values are rounded, in the column's unit; 0 if there is none.
    pub quantum: f64,
    /// Intervals (from, to), s, in which the value stays constant for much longer than usual.
    pub frozen: Vec<(f64, f64)>,
    /// Number of spikes: short excursions far beyond the neighbouring samples.
    pub spikes: usize,
    /// Value of the largest spike, in the column's unit; 0 without spikes.
    pub largest_spike: f64,
}

/// Smallest number of samples for an assessment.
const ENOUGH: usize = 100;
/// Values count as interpolated if more than this fraction of the changing values lies on straight lines.
const STRAIGHT: f64 = 0.7;
/// Smallest median second difference at a kink, in multiples of the rounding error.
const KINK: f64 = 10.0;
/// Smallest median distance between kinks, samples.
const APART: f64 = 3.0;
/// A constant value counts as frozen if it lasts longer than both limits: a time in s, and a multiple of the usual time between
/// changes.
pub(super) const FROZEN_S: f64 = 0.5;
const FROZEN_STEPS: f64 = 20.0;
/// Number of samples on each side of a spike from which the median is computed.
const AROUND: usize = 4;
/// Smallest deviation of a spike from that median: in robust standard deviations, and as a fraction of the channel's median
/// magnitude.
const FAR_SD: f64 = 10.0;
const FAR_PART: f64 = 0.4;

impl Quality {
    /// The quality of a column's samples `values` at increasing `times` (s). All are finite.
    pub fn of(column: &str, times: &[f64], values: &[f64]) -> Quality {
        Quality::at(column, times, values, period_s(times))
    }

    /// The quality of samples with the median period `period` (s).
    pub(super) fn at(column: &str, times: &[f64], values: &[f64], period: f64) -> Quality {
        if values.len() < ENOUGH || period <= 0.0 {
            return Quality::default();
        }
        let quantum = quantum(values);
        let kinks = kinks(times, values, period, quantum);
        let changes = changes(times, values);
        let (spikes, largest_spike) = if column == SPIKY { spikes(values) } else { (0, 0.0) };
        let by_changes = quantile(&steps(&changes), 0.25);
        let native_hz = match kinks {
            Some(hz) => hz,
            None if by_changes > 0.0 => 1.0 / by_changes,
            None => 0.0,
        };
        Quality {
            native_hz,
            interpolated: kinks.is_some(),
            quantum,
            frozen: if hangs(column) { frozen(times, values, &changes) } else { Vec::new() },
            spikes,
            largest_spike,
        }
    }
}

/// The column in which spikes are sought. Water in the pitot tube or a loose hose causes them.
const SPIKY: &str = "airspeed_mps";

/// Whether a column comes from a sensor whose value never stays constant in flight.
fn hangs(column: &str) -> bool {
    let inertial = ["roll_rad", "pitch_rad", "yaw_rad", "p_radps", "q_radps", "r_radps"];
    let air = ["airspeed_mps", "alpha_rad", "beta_rad"];
    let path = ["ax_mps2", "ay_mps2", "az_mps2", "vn_mps", "ve_mps", "vd_mps"];
    [&inertial[..], &air, &path].iter().any(|group| group.contains(&column))
}

/// The decimal step to which the values are rounded, at least 1e-9; 0 if there is none.
fn quantum(values: &[f64]) -> f64 {
    let few: Vec<f64> = values.iter().step_by(1 + values.len() / 500).copied().collect();
    let whole = |k: &i32| {
        let scale = 10f64.powi(*k);
        few.iter().all(|x| (x * scale - (x * scale).round()).abs() < 1e-4)
    };
    (0..=9).find(whole).map_or(0.0, |k| 10f64.powi(-k))
}

/// Rate of the kinks, Hz, if the values lie on straight lines between kinks; otherwise `None`.
fn kinks(times: &[f64], values: &[f64], period: f64, quantum: f64) -> Option<f64> {
    let span = |f: fn(f64, f64) -> f64| values.iter().copied().reduce(f).unwrap_or(0.0);
    let range = span(f64::max) - span(f64::min);
    let rounding = (2.01 * quantum).max(1e-9 * range);
    let even = |i: usize| {
        let near = |step: f64| (step / period - 1.0).abs() < 0.05;
        near(times[i] - times[i - 1]) && near(times[i + 1] - times[i])
    };
    let (mut moving, mut straight) = (0usize, 0usize);
    let mut bent: Vec<(usize, f64)> = Vec::new();
    for i in (1..values.len() - 1).filter(|i| even(*i)) {
        let bend = (values[i - 1] - 2.0 * values[i] + values[i + 1]).abs();
        let moves = (values[i + 1] - values[i - 1]).abs() > 2.0 * rounding;
        moving += usize::from(moves);
        straight += usize::from(moves && bend <= rounding);
        if bend > rounding {
            bent.push((i, bend));
        }
    }
    let sizes: Vec<f64> = bent.iter().map(|(_, bend)| *bend).collect();
    let gaps: Vec<f64> = bent.windows(2).map(|w| (w[1].0 - w[0].0) as f64).collect();
    let lines = 2 * moving >= ENOUGH && straight as f64 > STRAIGHT * moving as f64;
    let sharp = quantile(&sizes, 0.5) > KINK * rounding;
    // A single kink, such as that of a held command, does not show interpolation. Several kinks with straight lines between
    // them show it.
    let apart = bent.len() >= 2 && quantile(&gaps, 0.5) >= APART;
    (lines && sharp && apart).then(|| 1.0 / (quantile(&gaps, 0.5) * period))
}

/// The times at which the value changes.
fn changes(times: &[f64], values: &[f64]) -> Vec<f64> {
    (1..values.len()).filter(|i| values[*i] != values[*i - 1]).map(|i| times[i]).collect()
}

fn steps(times: &[f64]) -> Vec<f64> {
    times.windows(2).map(|w| w[1] - w[0]).collect()
}

/// Selects the intervals that count as frozen from `stays`, the intervals (from, to), s, of constant value. `values` at `times`
/// (s) give the usual time between changes.
pub(super) fn frozen_of(
    column: &str,
    times: &[f64],
    values: &[f64],
    mut stays: Vec<(f64, f64)>,
) -> Vec<(f64, f64)> {
    if stays.is_empty() {
        return stays;
    }
    let limit = if hangs(column) { frozen_s(&changes(times, values)) } else { None };
    stays.retain(|(from, to)| limit.is_some_and(|limit| to - from > limit));
    stays
}

/// Time after which a constant value counts as frozen, s. `None` if there are too few changes.
fn frozen_s(changes: &[f64]) -> Option<f64> {
    let usual = quantile(&steps(changes), 0.9);
    let enough = changes.len() >= ENOUGH / 2 && !usual.is_nan();
    enough.then(|| FROZEN_S.max(FROZEN_STEPS * usual))
}

/// Intervals (from, to), s, in which a nonzero value stays constant for much longer than usual.
fn frozen(times: &[f64], values: &[f64], changes: &[f64]) -> Vec<(f64, f64)> {
    let Some(limit) = frozen_s(changes) else { return Vec::new() };
    let mut out = Vec::new();
    let mut start = 0;
    for i in 1..=values.len() {
        if i < values.len() && values[i] == values[start] {
            continue;
        }
        let long = times[i - 1] - times[start] > limit;
        if long && values[start] != 0.0 {
            out.push((times[start], times[i - 1]));
        }
        start = i;
    }
    out
}

/// Number of spikes, and the value of the largest one.
fn spikes(values: &[f64]) -> (usize, f64) {
    let usual = quantile(&values.iter().map(|x| x.abs()).collect::<Vec<_>>(), 0.5);
    let middle = |i: usize| {
        let window = &values[i.saturating_sub(AROUND)..(i + AROUND + 1).min(values.len())];
        quantile(window, 0.5)
    };
    let out: Vec<f64> = (0..values.len()).map(|i| values[i] - middle(i)).collect();
    let sd = 1.4826 * quantile(&out.iter().map(|x| x.abs()).collect::<Vec<_>>(), 0.5);
    let far = |i: &usize| out[*i].abs() > FAR_SD * sd && out[*i].abs() > FAR_PART * usual;
    let all: Vec<usize> = (0..values.len()).filter(far).collect();
    let apart = all.iter().enumerate().filter(|(k, i)| *k == 0 || **i > all[*k - 1] + 1).count();
    let largest = all.iter().map(|i| values[*i]).max_by(|a, b| a.abs().total_cmp(&b.abs()));
    (apart, largest.unwrap_or(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Deterministic noise of sample `i` with all digits of a float.
    fn noise(i: usize) -> f64 {
        ((i as f64 * 12.9898).sin() * 43758.5453).fract()
    }

    fn times(n: usize) -> Vec<f64> {
        (0..n).map(|i| i as f64 * 0.01).collect()
    }

    fn rounded(x: f64) -> f64 {
        (x * 1e5).round() * 1e-5
    }

    #[test]
    fn lines_between_slow_samples_are_found_with_the_rate_of_the_samples() {
        // a sample every 0.25 s, with straight lines between them, rounded to five decimals
        let line = |i: usize| {
            let (k, f) = (i / 25, (i % 25) as f64 / 25.0);
            rounded(noise(k) * (1.0 - f) + noise(k + 1) * f)
        };
        let found =
            Quality::of("airspeed_mps", &times(2000), &(0..2000).map(line).collect::<Vec<_>>());
        assert!(found.interpolated && (found.native_hz - 4.0).abs() < 0.2, "{found:?}");
    }

    #[test]
    fn smooth_motion_noise_and_steps_are_not_lines() {
        let smooth = |i: usize| rounded((i as f64 * 0.02).sin());
        let coarse = |i: usize| ((i as f64 * 0.01).sin() * 10.0 * 100.0).round() / 100.0;
        let noisy = |i: usize| rounded(noise(i));
        let steps = |i: usize| if (i / 150).is_multiple_of(2) { 0.3 } else { -0.2 };
        let waves: [&dyn Fn(usize) -> f64; 4] = [&smooth, &coarse, &noisy, &steps];
        for (k, wave) in waves.iter().enumerate() {
            let found =
                Quality::of("airspeed_mps", &times(2000), &(0..2000).map(wave).collect::<Vec<_>>());
            assert!(!found.interpolated, "wave {k}: {found:?}");
        }
    }

    #[test]
    fn a_held_sensor_has_its_own_rate_and_a_stuck_one_is_frozen() {
        let held = |i: usize| rounded(15.0 + noise(i / 20));
        let found =
            Quality::of("airspeed_mps", &times(2000), &(0..2000).map(held).collect::<Vec<_>>());
        assert!((found.native_hz - 5.0).abs() < 0.3 && found.frozen.is_empty(), "{found:?}");
        let stuck =
            |i: usize| if (500..1000).contains(&i) { 15.5 } else { rounded(15.0 + noise(i)) };
        let found =
            Quality::of("airspeed_mps", &times(2000), &(0..2000).map(stuck).collect::<Vec<_>>());
        let [(from, to)] = found.frozen[..] else { panic!("{found:?}") };
        assert!((from - 5.0).abs() < 0.02 && (to - 9.99).abs() < 0.02, "{found:?}");
    }

    #[test]
    fn spikes_are_counted() {
        let spiky = |i: usize| if i % 400 == 7 { 95.0 } else { 17.0 + 0.3 * noise(i) };
        let found =
            Quality::of("airspeed_mps", &times(2000), &(0..2000).map(spiky).collect::<Vec<_>>());
        assert_eq!((found.spikes, found.largest_spike), (5, 95.0));
        let gusty = |i: usize| 17.0 + 3.0 * (i as f64 * 0.01).sin() + 0.3 * noise(i);
        let found =
            Quality::of("airspeed_mps", &times(2000), &(0..2000).map(gusty).collect::<Vec<_>>());
        assert_eq!(found.spikes, 0);
    }
}
