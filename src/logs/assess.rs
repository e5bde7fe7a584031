//! Assessment of a log's channels: which of them are too slow or frozen. A channel is a group of columns that are sampled
//! together. It is frozen while a value stays for much longer than usual.

use super::Sample;
use super::columns::{COLUMNS, index};
use super::finding::Finding;
use super::load::Channel;
use super::phases::{self, Flying, PhaseKind};

/// Sample rate of body rates and commands that comparison and diagnosis need, Hz.
pub(super) const WANTED_HZ: f64 = 10.0;
/// Fraction of a required rate below which a channel is too slow. The margin is for uneven sample times.
const SLACK: f64 = 0.8;
/// Sample rates of attitude and airspeed that comparison and diagnosis need, Hz.
const ATTITUDE_HZ: f64 = 5.0;
const AIRSPEED_HZ: f64 = 1.0;

/// Sample rate of `column` that comparison and diagnosis need, Hz; `None` for a column that may be slow.
pub(super) fn wanted_hz(column: &str) -> Option<f64> {
    match column {
        "p_radps" | "q_radps" | "r_radps" => Some(WANTED_HZ),
        "aileron_cmd" | "elevator_cmd" | "aileron_rad" | "elevator_rad" => Some(WANTED_HZ),
        "roll_rad" | "pitch_rad" => Some(ATTITUDE_HZ),
        "airspeed_mps" => Some(AIRSPEED_HZ),
        _ => None,
    }
}

/// Rate of measured values of a channel, Hz. Interpolated values do not count.
pub(super) fn real_hz(channel: &Channel) -> f64 {
    match channel.quality.interpolated {
        true => channel.quality.native_hz.min(channel.rate_hz),
        false => channel.rate_hz,
    }
}

/// The required rate of `column`, Hz, if its channel is too slow; `None` if it is fast enough.
pub(super) fn too_slow(channel: &Channel, column: &str) -> Option<f64> {
    wanted_hz(column).filter(|wanted| real_hz(channel) < SLACK * wanted)
}

/// Returns findings about interpolated samples, and about spikes if the log has a flight.
pub(super) fn channels(channels: &[Channel], rows: &[Sample], flies: &Flying) -> Vec<Finding> {
    let lines = |wrong: bool| -> Vec<String> {
        let lines = channels.iter().filter(|c| c.quality.interpolated);
        let of = lines.filter(|c| c.columns.iter().any(|x| too_slow(c, x).is_some()) == wrong);
        of.map(|c| format!("{} ({:.1} Hz)", c.columns.join(", "), c.quality.native_hz)).collect()
    };
    let text = |list: &[String]| {
        format!(
            "straight lines between slower samples, so that most rows are no measurements: {}",
            list.join("; ")
        )
    };
    let (wrong, slow) = (lines(true), lines(false));
    let mut out = Vec::new();
    if !wrong.is_empty() {
        out.push(Finding::problem(format!(
            "{}; give the log with its own samples, empty fields between them",
            text(&wrong)
        )));
    }
    if !slow.is_empty() {
        out.push(Finding::warning(text(&slow)));
    }
    // On the ground a gust or the propeller's slipstream may look like a spike.
    let flies = phases::phases(rows, flies).iter().any(|p| p.kind == PhaseKind::Flight);
    let spiky = channels.iter().filter(|c| flies && c.quality.spikes > 0);
    out.extend(spiky.map(|c| {
        let quality = &c.quality;
        Finding::warning(format!(
            "{}: {} spikes, the largest to {:.1}",
            c.columns.join(", "),
            quality.spikes,
            quality.largest_spike
        ))
    }));
    out
}

/// Sets values that are frozen in flight to NaN. Returns one finding for each frozen channel.
pub(super) fn freeze(rows: &mut [Sample], channels: &[Channel], flies: &Flying) -> Vec<Finding> {
    let flights: Vec<(f64, f64)> = phases::phases(rows, flies)
        .into_iter()
        .filter(|p| p.kind == PhaseKind::Flight)
        .map(|p| (p.from_s, p.to_s))
        .collect();
    let in_flight = |(from, to): &(f64, f64)| flights.iter().any(|(a, b)| from < b && to > a);
    let mut out = Vec::new();
    for channel in channels {
        let spans: Vec<(f64, f64)> =
            channel.quality.frozen.iter().copied().filter(|span| in_flight(span)).collect();
        if spans.is_empty() {
            continue;
        }
        for column in channel.columns.iter().filter_map(|c| index(c)) {
            let hangs = |t: f64| spans.iter().any(|(from, to)| t > *from && t <= *to);
            let hanging = rows.iter_mut().filter(|row| hangs(row.time_s));
            hanging.for_each(|row| *COLUMNS[column].2(row) = f64::NAN);
        }
        let list: Vec<String> =
            spans.iter().map(|(a, b)| format!("from {a:.2} to {b:.2} s")).collect();
        out.push(Finding::warning(format!(
            "{} does not change in flight {}: frozen; these rows count as missing",
            channel.columns.join(", "),
            list.join(", ")
        )));
    }
    out
}

/// Columns whose frozen values make a row unusable. A row without airspeed stays usable.
const OF_A_ROW: [&str; 5] = ["roll_rad", "pitch_rad", "p_radps", "q_radps", "r_radps"];

/// Whether the row lacks a required column because its channel is frozen.
pub(super) fn hangs(row: &Sample, channels: &[Channel]) -> bool {
    let hanging = channels.iter().filter(|c| !c.quality.frozen.is_empty());
    hanging
        .flat_map(|c| &c.columns)
        .filter(|c| OF_A_ROW.contains(&c.as_str()))
        .any(|column| index(column).is_some_and(|i| COLUMNS[i].1(row).is_nan()))
}
