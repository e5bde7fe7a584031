//! Data of one flight over time, for the plots of a page.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::Value;

use super::tuned::Way;
use greylag_sysid::compare::{ChannelId, Comparison, ModelResult, RegimeVariable};
use greylag_sysid::weak_form::prepared::Prepared;

/// Largest number of rows per flight in the plots.
const ROWS: usize = 2500;

/// Data of one flight over time.
#[derive(Clone, Debug, Serialize)]
pub struct FlightData {
    /// Name of the flight.
    pub name: String,
    /// Time on the log's clock, s; `None` at a gap.
    pub time_s: Vec<Option<f64>>,
    /// The states by name, in °, °/s and m/s; `None` at a gap.
    pub states: BTreeMap<&'static str, Vec<Option<f32>>>,
    /// Aileron and elevator deflection in °, throttle 0..1; `None` at a gap.
    pub controls: BTreeMap<&'static str, Vec<Option<f32>>>,
    /// Middle of each window over which the channels are averaged, s; `None` between segments.
    pub window_s: Vec<Option<f64>>,
    /// Value of each regime variable (angle of attack, airspeed and so on) in each window; `None` between segments.
    pub regimes: BTreeMap<String, Vec<Option<f32>>>,
    /// Kind of each model: as given, with fitted coefficients, or with added effects.
    pub ways: Vec<Way>,
    /// Forces, moments and rates by symbol: the measured values, then the values of each model.
    pub channels: BTreeMap<&'static str, Vec<Vec<Option<f32>>>>,
}

/// Short names of the states, in the order of the traces.
const STATES: [&str; 8] = ["phi", "theta", "V", "p", "q", "r", "alpha", "beta"];

/// Data of the flight with index `k` in the comparison.
pub(super) fn data(
    flight: &Prepared,
    comparison: &Comparison,
    k: usize,
    ways: Vec<Way>,
) -> FlightData {
    let trace = &comparison.flights[k].trace;
    let every = trace.time_s.len().div_ceil(ROWS).max(1);
    let gap = |i: usize| trace.states[2][i].is_nan();
    let kept: Vec<usize> =
        (0..trace.time_s.len()).filter(|i| i.is_multiple_of(every) || gap(*i)).collect();
    let take = |list: &[f64], factor: f64| kept.iter().map(|i| some(factor * list[*i])).collect();
    let degrees = 1_f64.to_degrees();
    let [aileron, elevator, throttle] = &trace.controls;
    let controls = [
        ("aileron", take(aileron, degrees)),
        ("elevator", take(elevator, degrees)),
        ("throttle", take(throttle, 1.0)),
    ];
    let channels = |id: &ChannelId| {
        let of = |m: &ModelResult| m.traces[k].channels.iter().find(|c| c.channel == *id).cloned();
        let all: Vec<_> = comparison.models.iter().filter_map(of).collect();
        let measured = all.first()?.measured.iter().map(|x| some(*x)).collect();
        let predicted = all.iter().map(|c| c.predicted.iter().map(|x| some(*x)).collect());
        Some((id.symbol(), std::iter::once(measured).chain(predicted).collect()))
    };
    let windows = rows(flight);
    let regime = |(v, variable): (usize, &RegimeVariable)| {
        let values = windows.iter().map(|w| w.and_then(|w| some(flight.windows[w].regime[v])));
        (word(*variable), values.collect())
    };
    FlightData {
        ways,
        name: comparison.flights[k].name.clone(),
        time_s: kept.iter().map(|i| clock(trace.time_s[*i])).collect(),
        states: named(&trace.states, &kept),
        controls: controls.into_iter().collect(),
        window_s: comparison.models[0].traces[k]
            .channels
            .first()
            .map_or_else(Vec::new, |c| c.time_s.iter().map(|t| clock(*t)).collect()),
        regimes: RegimeVariable::CONTINUOUS.iter().enumerate().map(regime).collect(),
        channels: ChannelId::ALL.iter().filter_map(channels).collect(),
    }
}

/// Index of the window for each row of a channel's trace; `None` for the extra row between segments.
pub(super) fn rows(flight: &Prepared) -> Vec<Option<usize>> {
    let mut rows = Vec::with_capacity(flight.windows.len());
    for (k, window) in flight.windows.iter().enumerate() {
        if k > 0 && flight.windows[k - 1].segment != window.segment {
            rows.push(None);
        }
        rows.push(Some(k));
    }
    rows
}

/// The states by name, in °, °/s and m/s, at the rows `kept`.
pub(super) fn named(
    states: &[Vec<f64>; 8],
    kept: &[usize],
) -> BTreeMap<&'static str, Vec<Option<f32>>> {
    let of = |(name, list): (&&'static str, &Vec<f64>)| {
        let factor = if *name == "V" { 1.0 } else { 1_f64.to_degrees() };
        (*name, kept.iter().map(|i| some(factor * list[*i])).collect())
    };
    STATES.iter().zip(states).map(of).collect()
}

/// Name of a regime variable in JSON.
fn word(variable: RegimeVariable) -> String {
    match serde_json::to_value(variable) {
        Ok(Value::String(word)) => word,
        _ => variable.name().to_owned(),
    }
}

/// A value rounded to five significant digits, which exceeds the resolution of a screen; `None` if it is not finite.
fn some(x: f64) -> Option<f32> {
    if x == 0.0 {
        return Some(0.0);
    }
    let unit = 10_f64.powi(4 - x.abs().log10().floor() as i32);
    Some(((x * unit).round() / unit) as f32).filter(|x| x.is_finite())
}

/// A time rounded to 0.1 ms, s; `None` if it is not finite.
fn clock(time_s: f64) -> Option<f64> {
    Some((time_s * 1e4).round() / 1e4).filter(|t| t.is_finite())
}
