//! The sections of an airframe file that describe surfaces and throttle, and the actuator filters that follow from them.

use serde::Deserialize;

use super::{Sourced, positive};
use crate::servos::{ActuatorFigures, Surface, Travel};

/// Time step of the discrete filters, s. It is the control period.
const STEP: f64 = 0.01;
/// Largest accepted deflection of a surface, rad.
const TRAVEL: f64 = 1.6;
/// Largest accepted natural frequency of a surface actuator, rad/s.
const FREQUENCY: f64 = 1000.0;
/// Largest accepted rate of a surface, rad/s.
const RATE: f64 = 200.0;

/// Whether an airframe file can describe a rudder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Yaw {
    /// The file has schema 1, which cannot describe a rudder.
    Unstated,
    /// The file has schema 2. The aircraft has a rudder if the file describes one.
    Stated,
}

/// Section `[actuators]` of schema 1: the same values for aileron and elevator, and no rudder.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Alike {
    surface_frequency_radps: Sourced,
    surface_damping: Sourced,
    deflection_max_rad: Sourced,
    throttle_lag_s: Sourced,
}

/// Section `[controls]` of schema 2. The aircraft has no rudder if the section has none.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Each {
    aileron: SurfaceFile,
    elevator: SurfaceFile,
    rudder: Option<SurfaceFile>,
    throttle: ThrottleFile,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SurfaceFile {
    travel_rad: Option<Sourced>,
    travel_min_rad: Option<Sourced>,
    travel_max_rad: Option<Sourced>,
    frequency_radps: Sourced,
    damping: Sourced,
    rate_max_radps: Option<Sourced>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ThrottleFile {
    lag_s: Sourced,
}

impl Alike {
    pub(super) fn figures(&self) -> Result<(ActuatorFigures, Yaw), String> {
        let figures = ActuatorFigures::tustin(
            positive(
                "actuators.surface_frequency_radps",
                &self.surface_frequency_radps,
                FREQUENCY,
            )?,
            positive("actuators.surface_damping", &self.surface_damping, 10.0)?,
            positive("actuators.deflection_max_rad", &self.deflection_max_rad, TRAVEL)?,
            positive("actuators.throttle_lag_s", &self.throttle_lag_s, 20.0)?,
            STEP,
        );
        Ok((figures, Yaw::Unstated))
    }
}

impl Each {
    pub(super) fn figures(&self) -> Result<(ActuatorFigures, Yaw), String> {
        let rudder = match &self.rudder {
            Some(rudder) => Some(rudder.figures("controls.rudder")?),
            None => None,
        };
        let lag = positive("controls.throttle.lag_s", &self.throttle.lag_s, 20.0)?;
        let figures = ActuatorFigures {
            aileron: self.aileron.figures("controls.aileron")?,
            elevator: self.elevator.figures("controls.elevator")?,
            rudder,
            throttle: ActuatorFigures::lag(lag, STEP),
            step: STEP,
        };
        Ok((figures, Yaw::Stated))
    }
}

impl SurfaceFile {
    fn figures(&self, name: &str) -> Result<Surface, String> {
        let field = |key: &str| format!("{name}.{key}");
        let frequency = positive(&field("frequency_radps"), &self.frequency_radps, FREQUENCY)?;
        let damping = positive(&field("damping"), &self.damping, 10.0)?;
        let mut surface = Surface::tustin(frequency, damping, self.travel(name)?, STEP);
        if let Some(rate) = &self.rate_max_radps {
            surface.rate_max = Some(positive(&field("rate_max_radps"), rate, RATE)?);
        }
        Ok(surface)
    }

    fn travel(&self, name: &str) -> Result<Travel, String> {
        travel(name, [&self.travel_rad, &self.travel_min_rad, &self.travel_max_rad])
    }
}

/// The travel (rad) of a surface from the entries of a file: one symmetric limit (`both`), or two limits (`min`, `max`). Errors
/// call the surface `name`.
pub(super) fn travel(
    name: &str,
    [both, min, max]: [&Option<Sourced>; 3],
) -> Result<Travel, String> {
    match (both, min, max) {
        (Some(both), None, None) => {
            Ok(Travel::symmetric(positive(&format!("{name}.travel_rad"), both, TRAVEL)?))
        }
        (None, Some(min), Some(max)) => {
            let most = positive(&format!("{name}.travel_max_rad"), max, TRAVEL)?;
            let least = min.value;
            if !(-TRAVEL..=-TRAVEL * 1e-9).contains(&least) {
                return Err(format!(
                    "{name}.travel_min_rad = {least} is not physical: it is the deflection at the \
                     command -1, below zero and at least -{TRAVEL}"
                ));
            }
            Ok(Travel { least, most })
        }
        _ => Err(format!(
            "{name} needs travel_rad (the same to both sides), or travel_min_rad with travel_max_rad"
        )),
    }
}
