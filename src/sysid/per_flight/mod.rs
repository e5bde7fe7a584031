//! What may differ from flight to flight of one aircraft: its trims, and how its measured axes stand.
//!
//! Loading, the setting of a surface, a battery or a propeller change between flights; an autopilot's board and the
//! markers of motion capture are mounted anew. Neither is an effect that the model lacks. Both are estimated only where
//! they are asked for, each flight's own beside what all flights have in common.

pub mod askew;
pub mod known;
pub mod trims;

use serde::Serialize;

/// What each flight is to have of its own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PerFlight {
    /// Its trims, with the widths of [`trims::TRIMS`] times this; `None` for one set of trims for all flights.
    #[serde(rename = "flight_trims", skip_serializing_if = "Option::is_none")]
    pub trims: Option<f64>,
    /// How its measured axes stand against the body's: standard deviation of each of three angles before the flight
    /// is seen, °; `None` for axes that are the body's.
    #[serde(rename = "axes_askew_deg", skip_serializing_if = "Option::is_none")]
    pub askew_deg: Option<f64>,
}

/// A constant that each flight has of its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constant {
    /// Its name.
    pub name: &'static str,
    /// Its standard deviation before the flight is seen; its mean is zero.
    pub width: f64,
}

impl PerFlight {
    /// The constants of a flight: the angles of its axes (rad), then its trims; empty if nothing is asked for.
    pub fn constants(&self) -> Vec<Constant> {
        let askew = self
            .askew_deg
            .map(|deg| askew::NAMES.map(|name| Constant { name, width: deg.to_radians() }));
        let trims = self
            .trims
            .map(|factor| trims::TRIMS.map(|t| Constant { name: t.name, width: factor * t.width }));
        askew.into_iter().flatten().chain(trims.into_iter().flatten()).collect()
    }

    /// How many of them are angles of axes; the trims stand behind.
    pub fn angles(&self) -> usize {
        if self.askew_deg.is_some() { askew::NAMES.len() } else { 0 }
    }

    /// Whether each flight has trims of its own.
    pub fn has_trims(&self) -> bool {
        self.trims.is_some()
    }
}
