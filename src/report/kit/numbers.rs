//! Formats numbers for display.

/// Half width of the 95 % interval of a normal distribution, in standard deviations.
pub(crate) const NORMAL_95: f64 = 1.96;

/// Formats a number with three significant digits and a true minus sign; a dash for NaN and infinity.
pub(crate) fn number(value: f64) -> String {
    if !value.is_finite() {
        return "–".into();
    }
    let size = value.abs();
    let text = match size {
        0.0 => "0".into(),
        _ if !(1e-4..1e6).contains(&size) => format!("{value:.2e}"),
        _ => format!("{value:.*}", (2 - size.log10().floor() as i32).clamp(0, 6) as usize),
    };
    text.replace('-', "−")
}

/// Formats a commanded attitude (roll and pitch, degrees) in whole degrees with signs.
pub(crate) fn attitude(deg: [f64; 2]) -> String {
    let whole = |deg: f64| match deg.round() {
        0.0 => "0".into(),
        deg => format!("{deg:+.0}").replace('-', "−"),
    };
    let [roll, pitch] = deg.map(whole);
    format!("roll {roll}°, pitch {pitch}°")
}

/// Formats evidence (a test statistic) with one decimal, without decimals from 100 on; a dash for NaN and infinity.
pub(crate) fn evidence(value: f64) -> String {
    let text = match value {
        v if !v.is_finite() => return "–".into(),
        v if v.abs() < 99.95 => format!("{v:.1}"),
        v if v.abs() < 1e6 => format!("{v:.0}"),
        v => format!("{v:.1e}"),
    };
    text.replace('-', "−")
}

/// Formats a share (0..1) in percent, rounded to an integer; a dash for NaN and infinity.
pub(crate) fn percent(share: f64) -> String {
    if share.is_finite() {
        format!("{:.0}", 100.0 * share).replace('-', "−")
    } else {
        "–".into()
    }
}

/// Text of an interval with both ends.
pub(crate) fn interval(low: f64, high: f64) -> String {
    format!("{} to {}", number(low), number(high))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_three_digits_and_what_is_none_is_a_dash() {
        assert_eq!(number(-0.012_345), "−0.0123");
        assert_eq!(number(1234.5), "1234");
        assert_eq!(number(2e-7), "2.00e−7");
        assert_eq!([number(f64::NAN), percent(f64::NAN)], ["–", "–"]);
        assert_eq!([percent(0.123), percent(-0.5)], ["12", "−50"]);
    }
}
