//! Constants that differ between the flights of one aircraft: trims (constants added to force and moment coefficients), and the
//! misalignment of the measured axes.
//!
//! Loading, the setting of a surface, a battery or a propeller may change between two flights. An autopilot's board or the
//! markers of motion capture may be removed and mounted again. In these cases the model does not lack an effect. The
//! constants are estimated only on request, for each flight, in addition to the coefficients common to all flights.

pub mod askew;
pub mod known;
pub mod trims;

use serde::Serialize;

/// Selection of the constants estimated for each flight.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PerFlight {
    /// Factor on the prior standard deviations of [`trims::TRIMS`]; `None` for the same trims in all flights.
    #[serde(rename = "flight_trims", skip_serializing_if = "Option::is_none")]
    pub trims: Option<f64>,
    /// Prior standard deviation of each of the three misalignment angles, °; `None` for aligned axes.
    #[serde(rename = "axes_askew_deg", skip_serializing_if = "Option::is_none")]
    pub askew_deg: Option<f64>,
    /// Use of the sensor errors that the fitted flights have in common.
    #[serde(rename = "sensor_errors", skip_serializing_if = "SensorErrors::is_judged")]
    pub sensors: SensorErrors,
}

/// Use of the errors of airspeed, angle of attack and sideslip that all fitted flights have in common. A fit always estimates
/// the sensor errors of its flights. If the common errors become errors of the installation, they correct other flights too.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SensorErrors {
    /// They become errors of the installation if the error of the held-out flights, which are not fitted, then decreases by more
    /// than 1 %.
    #[default]
    Judged,
    /// They become errors of the installation unless the error of the held-out flights then increases.
    Kept,
    /// They correct the fitted flights only.
    Dropped,
}

impl SensorErrors {
    fn is_judged(&self) -> bool {
        *self == SensorErrors::Judged
    }
}

/// A constant estimated for each flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constant {
    /// Name of the constant.
    pub name: &'static str,
    /// Prior standard deviation, rad for an angle, dimensionless for a trim. The prior mean is zero.
    pub width: f64,
}

impl PerFlight {
    /// Constants of a flight: first the misalignment angles (rad), then the trims. Empty if neither is selected.
    pub fn constants(&self) -> Vec<Constant> {
        let askew = self
            .askew_deg
            .map(|deg| askew::NAMES.map(|name| Constant { name, width: deg.to_radians() }));
        let trims = self
            .trims
            .map(|factor| trims::TRIMS.map(|t| Constant { name: t.name, width: factor * t.width }));
        askew.into_iter().flatten().chain(trims.into_iter().flatten()).collect()
    }

    /// Number of misalignment angles among the constants: 3 or 0.
    pub fn angles(&self) -> usize {
        if self.askew_deg.is_some() { askew::NAMES.len() } else { 0 }
    }

    /// Whether trims are estimated for each flight.
    pub fn has_trims(&self) -> bool {
        self.trims.is_some()
    }
}
