//! The mapping file as it is deserialised from TOML, and the checks of its parts. A mapping file states which fields of a log
//! fill the columns of Greylag's log format.

use std::collections::BTreeMap;

use serde::Deserialize;

use super::board::WrittenBoard;
use super::{Entry, Turn};
use crate::columns::index;
use crate::csv::Order;
use greylag_physics::Sensors;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Written {
    pub(super) schema: u32,
    #[serde(default)]
    pub(super) columns: BTreeMap<String, WrittenEntry>,
    pub(super) attitude: Option<WrittenTurn>,
    #[serde(default)]
    pub(super) derive: Derive,
    #[serde(default)]
    pub(super) sensors: Sensors,
    pub(super) board: Option<WrittenBoard>,
    #[serde(default)]
    pub(super) flight: WrittenFlight,
}

#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub(super) struct WrittenFlight {
    pub(super) from_mps: Option<f64>,
    pub(super) shortest_s: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct WrittenTurn {
    pub(super) quaternion: [String; 4],
    pub(super) order: Option<WrittenOrder>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum WrittenOrder {
    Wxyz,
    Xyzw,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub(super) struct Derive {
    pub(super) body_rates_over_s: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct WrittenEntry {
    pub(super) from: String,
    #[serde(default = "one")]
    pub(super) scale: f64,
    #[serde(default)]
    pub(super) offset: f64,
    pub(super) instance: Option<Instance>,
    pub(super) rate_over_s: Option<f64>,
}

#[derive(Deserialize)]
#[serde(untagged)]
pub(super) enum Instance {
    Number(u16),
    Source(String),
}

fn one() -> f64 {
    1.0
}

/// Smallest value that a mapping file may set for `flight.shortest_s`, s.
const SHORTEST_S: f64 = 0.5;

pub(super) fn thresholds(flight: WrittenFlight) -> Result<WrittenFlight, String> {
    if flight.from_mps.is_some_and(|v| !(v > 0.0 && v <= 400.0)) {
        return Err("flight.from_mps must lie above 0 and up to 400 m/s".into());
    }
    if flight.shortest_s.is_some_and(|t| !(SHORTEST_S..=60.0).contains(&t)) {
        return Err(format!("flight.shortest_s must lie within {SHORTEST_S} to 60 s"));
    }
    Ok(flight)
}

pub(super) fn turn(written: WrittenTurn) -> Result<Turn, String> {
    let split = |part: &String| part.split_once('.').map(|(a, b)| (a.to_owned(), b.to_owned()));
    let parts = written.quaternion.each_ref().map(split);
    let [Some(a), Some(b), Some(c), Some(d)] = parts else {
        return Err("attitude.quaternion names four of \"topic.field\"".into());
    };
    if [&b, &c, &d].iter().any(|other| other.0 != a.0) {
        return Err("attitude.quaternion names fields of one topic".into());
    }
    let order = written.order.map(|order| match order {
        WrittenOrder::Wxyz => Order::Wxyz,
        WrittenOrder::Xyzw => Order::Xyzw,
    });
    Ok(Turn { topic: a.0, fields: [a.1, b.1, c.1, d.1], order })
}

pub(super) fn entry(column: &str, e: WrittenEntry) -> Result<Entry, String> {
    if index(column).is_none() {
        return Err(format!(
            "`{column}` is no column of the log format; use one of its names, such as airspeed_mps"
        ));
    }
    let Some((topic, field)) = e.from.split_once('.') else {
        return Err(format!("column `{column}`: from = \"{}\" is not \"topic.field\"", e.from));
    };
    if !e.scale.is_finite() || !e.offset.is_finite() {
        return Err(format!("column `{column}`: scale and offset must be finite"));
    }
    over(&format!("column `{column}`: rate_over_s"), e.rate_over_s)?;
    let instance = match e.instance {
        None => None,
        Some(Instance::Number(n)) => Some(n),
        Some(Instance::Source(text)) => Some(source(&text).ok_or_else(|| {
            format!("column `{column}`: instance \"{text}\" is not \"system/component\"")
        })?),
    };
    Ok(Entry {
        topic: topic.to_owned(),
        field: field.to_owned(),
        scale: e.scale,
        offset: e.offset,
        instance,
        rate_over_s: e.rate_over_s,
    })
}

/// Refuses a time span over which a rate of change is to be fitted, unless it is above 0 and at most 10 s. `what` names the
/// setting in the error text.
pub(super) fn over(what: &str, time: Option<f64>) -> Result<(), String> {
    match time {
        Some(x) if !(x > 0.0 && x <= 10.0) => {
            Err(format!("{what} = {x} must lie above 0 and up to 10 s, and hold at least 5 rows"))
        }
        _ => Ok(()),
    }
}

/// The number that stands for the sender `system/component` of a MAVLink message; `None` if `text` has another form.
fn source(text: &str) -> Option<u16> {
    let (system, component) = text.split_once('/')?;
    Some(u16::from_be_bytes([system.trim().parse().ok()?, component.trim().parse().ok()?]))
}
