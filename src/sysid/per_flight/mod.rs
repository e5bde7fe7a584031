//! Constants that differ from flight to flight of one aircraft: its trims, and the misalignment of its measured axes.
//!
//! Loading, the setting of a surface, a battery or a propeller change between flights; an autopilot's board and the
//! markers of motion capture are mounted again. Neither is an effect that the model lacks. Both are estimated only on
//! request, for each flight beside the coefficients common to all flights.

pub mod askew;
pub mod known;
pub mod trims;

use serde::Serialize;

/// Selection of the constants estimated for each flight.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PerFlight {
    /// Trims, with this multiple of the widths of [`trims::TRIMS`]; `None` for one set of trims for all flights.
    #[serde(rename = "flight_trims", skip_serializing_if = "Option::is_none")]
    pub trims: Option<f64>,
    /// Misalignment of the measured axes: prior standard deviation of each of three angles, °; `None` for aligned
    /// axes.
    #[serde(rename = "axes_askew_deg", skip_serializing_if = "Option::is_none")]
    pub askew_deg: Option<f64>,
}

/// A constant estimated for each flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constant {
    /// Name of the constant.
    pub name: &'static str,
    /// Prior standard deviation; the prior mean is zero.
    pub width: f64,
}

impl PerFlight {
    /// Constants of a flight: misalignment angles (rad), then trims; empty if nothing is selected.
    pub fn constants(&self) -> Vec<Constant> {
        let askew = self
            .askew_deg
            .map(|deg| askew::NAMES.map(|name| Constant { name, width: deg.to_radians() }));
        let trims = self
            .trims
            .map(|factor| trims::TRIMS.map(|t| Constant { name: t.name, width: factor * t.width }));
        askew.into_iter().flatten().chain(trims.into_iter().flatten()).collect()
    }

    /// Number of misalignment angles; the trims follow.
    pub fn angles(&self) -> usize {
        if self.askew_deg.is_some() { askew::NAMES.len() } else { 0 }
    }

    /// Whether trims are estimated for each flight.
    pub fn has_trims(&self) -> bool {
        self.trims.is_some()
    }
}
