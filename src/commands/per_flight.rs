//! Options of a fit: constants that are estimated for each flight, and the use of sensor errors common to all flights.

use crate::sysid::per_flight::{PerFlight, SensorErrors};

/// Largest standard deviation of a misalignment angle, °. For larger angles the small-angle approximation is inaccurate.
const MOST_DEG: f64 = 10.0;
/// Largest factor on the prior standard deviations of the trim coefficients.
const MOST_TIMES: f64 = 100.0;

/// Options for the constants that are estimated for each flight.
#[derive(clap::Args, Clone, Copy, Debug)]
pub struct PerFlightArguments {
    /// Estimate trims for each flight (CD0, CL0, CY0, Cl0, Cm0, Cn0, a fraction of the thrust) together
    /// with the common coefficients; FACTOR multiplies their usual prior standard deviations.
    #[arg(long, value_name = "FACTOR", num_args = 0..=1, require_equals = true, default_missing_value = "1",
          value_parser = factor)]
    flight_trims: Option<f64>,
    /// Estimate three small constant angles by which each flight's measured axes (the autopilot's board, the markers of
    /// motion capture) are rotated against the body axes, with this prior standard deviation in degrees.
    #[arg(long, value_name = "DEG", value_parser = degrees)]
    axes_askew: Option<f64>,
}

/// Options for the constants of each flight and for the sensor errors common to all flights.
#[derive(clap::Args, Clone, Copy, Debug)]
pub struct FitConstantsArguments {
    #[command(flatten)]
    per_flight: PerFlightArguments,
    /// Use of the errors of airspeed, angle of attack and sideslip that the fitted flights have in common. As errors of the
    /// installation they also correct flights that were not fitted.
    #[arg(long, value_enum, value_name = "USE", default_value = "judged")]
    sensor_errors: Use,
}

/// Use of the sensor errors that the fitted flights have in common.
#[derive(clap::ValueEnum, Clone, Copy, Debug)]
enum Use {
    /// Kept as errors of the installation if the model's error on the flights not fitted then falls by more than 1 %.
    Judged,
    /// Kept as errors of the installation unless the model's error on the flights not fitted then rises.
    Kept,
    /// Used to correct the fitted flights only.
    Dropped,
}

impl FitConstantsArguments {
    /// The constants that the options request.
    pub fn asked(&self) -> PerFlight {
        let sensors = match self.sensor_errors {
            Use::Judged => SensorErrors::Judged,
            Use::Kept => SensorErrors::Kept,
            Use::Dropped => SensorErrors::Dropped,
        };
        PerFlight { sensors, ..self.per_flight.asked() }
    }
}

impl PerFlightArguments {
    /// The constants that the options request.
    pub fn asked(&self) -> PerFlight {
        PerFlight { trims: self.flight_trims, askew_deg: self.axes_askew, ..PerFlight::default() }
    }
}

fn factor(text: &str) -> Result<f64, String> {
    within(text, MOST_TIMES, "a factor on the trims' standard deviations, such as 2")
}

fn degrees(text: &str) -> Result<f64, String> {
    within(text, MOST_DEG, "a standard deviation in degrees, such as 3")
}

fn within(text: &str, most: f64, what: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|x| *x > 0.0 && *x <= most);
    value.ok_or_else(|| format!("give {what}, above 0 and up to {most}"))
}
