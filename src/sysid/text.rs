//! Estimates as text.

/// Half width of a 95 % interval in standard deviations.
const INTERVAL: f64 = 1.96;

/// A value with the half width of its 95 % interval and its unit, as text. `sd` is the standard deviation of the value.
pub fn with_interval(value: f64, sd: f64, unit: &str) -> String {
    format!("{} ± {} {unit}", figures(value), figures(INTERVAL * sd)).trim_end().to_owned()
}

/// `x` to three significant figures.
pub fn figures(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return format!("{x}");
    }
    let places = (2 - x.abs().log10().floor() as i32).clamp(0, 9) as usize;
    format!("{x:.places$}")
}
