//! Words the result of a comparison for one channel as a sentence. A channel is a force, a moment or the rate of a state. The
//! residual is its measured minus its modelled value. A regime is a range of a variable, such as α > 9°, in which the
//! residual is evaluated.

use super::answer::multiple;
use super::finding::{Finding, Trend};
use super::result::Regime;
use crate::weak_form::channels::{ChannelId, RegimeVariable};

/// A channel counts as explained if the model leaves less than this fraction of its variance unexplained.
const EXPLAINED: f64 = 0.01;
/// Unexplained fraction of the variance below which the sentence names no regime.
pub const NOTHING_LEFT: f64 = 0.001;

/// Results from which the sentence of a channel is written.
pub struct Subject<'a> {
    /// Identifier of the channel.
    pub channel: ChannelId,
    /// Fraction of the channel's variance that the model leaves unexplained; NaN if it is not known.
    pub unexplained: f64,
    /// Reason for a NaN in `unexplained`.
    pub unknown: &'a str,
    /// The regime in which the model is worst; `None` if it is not surely wrong in any.
    pub finding: Option<&'a Finding>,
    /// The variable on which the residual mainly depends; `None` if there is none.
    pub follows: Option<RegimeVariable>,
    /// Whether sensor errors within their 95 % uncertainty may explain the whole residual.
    pub within_doubt: bool,
    /// Mass of the aircraft in the model, kg.
    pub mass: f64,
    /// Number of flights compared.
    pub flights: usize,
}

/// The sentence, without a full stop and beginning with a lower-case letter.
pub fn sentence(subject: &Subject) -> String {
    let noun = noun(subject.channel);
    if subject.unexplained.is_nan() {
        return format!("{noun}: {}, so nothing can be said", subject.unknown);
    }
    let share = percent(100.0 * subject.unexplained);
    if subject.unexplained < NOTHING_LEFT {
        return format!("{noun} is explained: {share} of its variation is left");
    }
    let Some(finding) = subject.finding else {
        let why = match subject.follows {
            _ if subject.within_doubt => {
                "which the uncertainty of the sensor errors may explain: these flights cannot judge \
                 the model more closely"
                    .into()
            }
            Some(RegimeVariable::Flight) => {
                "which differs from flight to flight; the samples are too few to say by how much".into()
            }
            Some(variable) => format!(
                "which follows {}; the samples are too few to say by how much",
                spoken(variable)
            ),
            None => "with no regime in which the model is surely off".into(),
        };
        if let Some(times) = multiple(subject.unexplained) {
            return format!(
                "{noun} hardly varies in these flights (a quiet axis): {times} is unexplained, {why}"
            );
        }
        return format!("{noun}: {share} of its variation is unexplained, {why}");
    };
    let what = error(subject, &finding.regime);
    let place = place(subject, finding);
    let who = who(&finding.regime, subject.flights);
    if subject.unexplained < EXPLAINED {
        return format!(
            "{noun} is explained but for {share} of its variation; at worst it is {what}{place}, {who}"
        );
    }
    format!("{noun} is {what}{place}, {who}")
}

fn noun(channel: ChannelId) -> &'static str {
    match channel {
        ChannelId::Drag => {
            "forward force along the flight path (thrust less drag, airspeed channel)"
        }
        ChannelId::Lift => "lift",
        ChannelId::Side => "side force",
        ChannelId::Roll => "rolling moment",
        ChannelId::Pitch => "pitching moment",
        ChannelId::Yaw => "yawing moment",
        ChannelId::Airspeed => "rate of airspeed (airspeed channel)",
        ChannelId::Alpha => "rate of angle of attack",
        ChannelId::Beta => "rate of sideslip",
    }
}

/// Descriptions of the model's error, first for a positive residual (measured − model), then for a negative one.
fn directions(channel: ChannelId) -> (&'static str, &'static str) {
    match channel {
        // the channel is drag less thrust, the sentence describes the forward force
        ChannelId::Drag => ("too high", "too low"),
        ChannelId::Lift | ChannelId::Airspeed | ChannelId::Alpha => ("too low", "too high"),
        ChannelId::Side | ChannelId::Beta | ChannelId::Yaw => {
            ("too far to the left", "too far to the right")
        }
        ChannelId::Roll => ("too far to the left", "too far to the right"),
        ChannelId::Pitch => ("too far nose down", "too far nose up"),
    }
}

/// The model's error in words: "8.2 ± 0.3 N too low" or "28 ± 4 % too high".
fn error(subject: &Subject, regime: &Regime) -> String {
    let [least, most] = regime.interval;
    // The interval may not be symmetric. The half width on the side of zero is printed, so that an interval without zero
    // does not appear to contain zero.
    let half = if regime.mean > 0.0 { regime.mean - least } else { most - regime.mean };
    let (low, high) = directions(subject.channel);
    if subject.channel == ChannelId::Lift && regime.relative_percent.is_finite() {
        let half = half * (regime.relative_percent / regime.mean).abs();
        let way = if regime.relative_percent > 0.0 { high } else { low };
        return format!("{} % {way}", plus_minus(regime.relative_percent.abs(), half));
    }
    let way = if regime.mean > 0.0 { low } else { high };
    let (scale, unit) = match subject.channel {
        ChannelId::Alpha | ChannelId::Beta => (1_f64.to_degrees(), "°/s"),
        other => (1.0, other.unit()),
    };
    let size = format!("{} {unit} {way}", plus_minus(regime.mean.abs() * scale, half * scale));
    match subject.channel {
        ChannelId::Drag => {
            let acceleration = regime.mean.abs() / subject.mass;
            format!("{size} ({} m/s² of airspeed)", significant(acceleration, 2))
        }
        _ => size + &strength(subject.channel, regime),
    }
}

/// Phrase on the error of a moment relative to the measured moment. It is empty for other channels, and if the measured
/// moment does not keep its sign in the regime.
fn strength(channel: ChannelId, regime: &Regime) -> String {
    let moment = matches!(channel, ChannelId::Roll | ChannelId::Pitch | ChannelId::Yaw);
    match regime.relative_percent {
        x if !moment || x.is_nan() => String::new(),
        x if x < -100.0 => " (it has the wrong sign)".into(),
        x if x < 0.0 => format!(" ({} % too weak)", significant(-x, 2)),
        x => format!(" ({} % too strong)", significant(x, 2)),
    }
}

/// The regime in words (" for α > 9°"), with the trend of the residual over the regime's variable.
fn place(subject: &Subject, Finding { regime, trend }: &Finding) -> String {
    let Some(variable) = regime.variable else {
        let along = subject.follows.map(|v| match v {
            RegimeVariable::Flight => ", and differs from flight to flight".into(),
            v => format!(", and the error follows {}", spoken(v)),
        });
        return format!(" throughout{}", along.unwrap_or_default());
    };
    let whole = regime.low.is_nan() && regime.high.is_nan();
    let name = spoken(variable);
    let trend = match trend {
        Trend::Grows => format!(", and the error grows with {name}"),
        Trend::Falls => format!(", and the error falls as {name} rises"),
        Trend::Reverses => format!(", and the error changes sign with {name}"),
        Trend::None => String::new(),
    };
    match variable {
        RegimeVariable::Flight => " in one flight".into(),
        _ if whole => format!(" throughout{trend}"),
        _ => format!(" for {}{trend}", range(regime, variable)),
    }
}

fn spoken(variable: RegimeVariable) -> &'static str {
    match variable {
        RegimeVariable::Alpha => "α",
        RegimeVariable::Beta => "β",
        RegimeVariable::AileronRate => "how fast the aileron moves",
        RegimeVariable::ElevatorRate => "how fast the elevator moves",
        other => other.name(),
    }
}

/// The range of the variable in words: "α > 9°", "throttle 0.2 to 0.4", "the aileron moving right faster than 20 °/s".
fn range(regime: &Regime, variable: RegimeVariable) -> String {
    use RegimeVariable::{AileronRate, ElevatorRate};
    let (low, high) = (regime.low, regime.high);
    match (variable, low >= 0.0, high <= 0.0) {
        (AileronRate, true, _) => format!("the aileron moving right {}", speed(low, high)),
        (AileronRate, _, true) => format!("the aileron moving left {}", speed(-high, -low)),
        (ElevatorRate, true, _) => format!("the elevator moving down {}", speed(low, high)),
        (ElevatorRate, _, true) => format!("the elevator moving up {}", speed(-high, -low)),
        (AileronRate, ..) => format!("aileron movement{}", between(low, high, variable.unit())),
        (ElevatorRate, ..) => format!("elevator movement{}", between(low, high, variable.unit())),
        _ => format!("{}{}", spoken(variable), between(low, high, variable.unit())),
    }
}

fn speed(low: f64, high: f64) -> String {
    match (low, high.is_finite()) {
        (low, false) => format!("faster than {} °/s", significant(low, 3)),
        (0.0, true) => format!("slower than {} °/s", significant(high, 3)),
        (low, true) => format!("at {} to {} °/s", significant(low, 3), significant(high, 3)),
    }
}

fn between(low: f64, high: f64, unit: &str) -> String {
    let gap = if unit == "°" || unit.is_empty() { "" } else { " " };
    let value = |x: f64| format!("{}{gap}{unit}", significant(x, 3));
    match (low.is_finite(), high.is_finite()) {
        (true, false) => format!(" > {}", value(low)),
        (false, true) => format!(" < {}", value(high)),
        (true, true) => format!(" {} to {}", significant(low, 3), value(high)),
        (false, false) => String::new(),
    }
}

/// The numbers of samples and flights of the regime in words: "210 samples, both flights".
fn who(regime: &Regime, flights: usize) -> String {
    let seen = regime.flights.len();
    let who = match (seen, flights) {
        (_, 1) => "one flight".into(),
        (2, 2) => "both flights".into(),
        (a, b) if a == b => format!("all {b} flights"),
        (1, _) => format!("flight {} only", regime.flights[0]),
        (a, b) => format!("{a} of {b} flights"),
    };
    format!("{} samples, {who}", regime.independent)
}

/// Value and uncertainty, rounded to the decimals of the uncertainty: "8.2 ± 0.3".
fn plus_minus(value: f64, half: f64) -> String {
    if !(half.is_finite() && half > 0.0) {
        return significant(value, 3);
    }
    // the uncertainty has one significant figure, or two if the first is 1; it is at least a thousandth of the value
    let half = half.max(1e-3 * value.abs());
    let power = half.log10().floor();
    let power = if half / 10_f64.powf(power) < 2.0 { power - 1.0 } else { power };
    let places = (-power).max(0.0) as usize;
    format!("{value:.places$} ± {half:.places$}")
}

/// `x` with `figures` significant figures, without trailing zeros after the decimal point, and with the minus sign U+2212.
fn significant(x: f64, figures: i32) -> String {
    if x == 0.0 || !x.is_finite() {
        return "0".into();
    }
    let places = (figures - 1 - x.abs().log10().floor() as i32).max(0) as usize;
    let text = format!("{x:.places$}").replace('-', "−");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').into(),
        false => text,
    }
}

fn percent(x: f64) -> String {
    match x {
        x if x < 0.1 => "less than 0.1 %".into(),
        x => format!("{} %", significant(x, 2)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn regime(variable: RegimeVariable, low: f64, high: f64, mean: f64, half: f64) -> Regime {
        Regime {
            variable: Some(variable),
            low,
            high,
            unit: variable.unit(),
            mean,
            interval: [mean - half, mean + half],
            relative_percent: f64::NAN,
            independent: 210,
            flights: vec!["a.csv".into(), "b.csv".into()],
        }
    }

    fn say(channel: ChannelId, regime: Regime, trend: Trend) -> String {
        let finding = Finding { regime, trend };
        sentence(&Subject {
            channel,
            unexplained: 0.4,
            unknown: "",
            within_doubt: false,
            finding: Some(&finding),
            follows: None,
            mass: 3.364,
            flights: 2,
        })
    }

    #[test]
    fn a_quiet_axis_gets_no_percentage() {
        let of = |unexplained: f64| {
            sentence(&Subject {
                channel: ChannelId::Roll,
                unexplained,
                unknown: "it is unknown",
                within_doubt: false,
                finding: None,
                follows: None,
                mass: 3.364,
                flights: 1,
            })
        };
        let quiet = of(4232.66);
        assert!(quiet.contains("rolling moment hardly varies") && !quiet.contains('%'), "{quiet}");
        assert!(quiet.contains("4233 times its variance is unexplained"), "{quiet}");
        assert!(of(f64::NAN).ends_with(": it is unknown, so nothing can be said"));
        assert!(of(7.18).contains("718 % of its variation is unexplained"), "{}", of(7.18));
    }

    #[test]
    fn the_sentence_of_the_issue() {
        // measured 25 N, model 32 N: the residual is −7 ± 1 N, the model 28 ± 4 % too high
        let mut at = regime(RegimeVariable::Alpha, 9.0, f64::NAN, -7.0, 1.0);
        at.relative_percent = 28.0;
        let said = say(ChannelId::Lift, at, Trend::None);
        assert_eq!(said, "lift is 28 ± 4 % too high for α > 9°, 210 samples, both flights");
    }

    #[test]
    fn forces_and_moments_say_their_direction_in_words() {
        // drag minus thrust as measured is 8.2 N below that of the model, so the model's forward force is too low
        let at = regime(RegimeVariable::Throttle, 0.4, f64::NAN, -8.2, 0.31);
        assert_eq!(
            say(ChannelId::Drag, at, Trend::Grows),
            "forward force along the flight path (thrust less drag, airspeed channel) is \
             8.2 ± 0.3 N too low (2.4 m/s² of airspeed) for throttle > 0.4, and the error grows \
             with throttle, 210 samples, both flights"
        );
        let mut at = regime(RegimeVariable::AileronRate, 20.0, 40.0, 0.9, 0.12);
        at.relative_percent = -130.0;
        at.flights.pop();
        assert_eq!(
            say(ChannelId::Yaw, at, Trend::Reverses),
            "yawing moment is 0.90 ± 0.12 N m too far to the left (it has the wrong sign) for \
             the aileron moving right at 20 to 40 °/s, and the error changes sign with how fast the aileron \
             moves, 210 samples, flight a.csv only"
        );
        let at = regime(RegimeVariable::Q, f64::NAN, -30.0, 0.04, 0.0);
        let said = say(ChannelId::Pitch, at, Trend::None);
        assert!(said.contains("is 0.04 N m too far nose down for pitch rate < −30 °/s"), "{said}");
    }

    #[test]
    fn numbers_carry_the_places_that_their_uncertainty_warrants() {
        assert_eq!(plus_minus(8.2345, 0.312), "8.2 ± 0.3");
        assert_eq!(plus_minus(8.2345, 0.17), "8.23 ± 0.17");
        assert_eq!(plus_minus(123.4, 31.0), "123 ± 31");
        assert_eq!(significant(0.4000001, 3), "0.4");
        assert_eq!(significant(1234.5, 2), "1234");
        assert_eq!(percent(0.01), "less than 0.1 %");
    }
}
