//! Delay of the actuator record, estimated from forces and moments together.
//!
//! In the moments, a surface that moves late looks like a record whose time stamps are too early. The throttle is
//! recorded with the same clock, so its effect on the forces shows the clock error. Open-loop simulations (free runs)
//! cannot distinguish the two causes, because thrust appears in them only as an acceleration.

use crate::diagnose::regression::columns::SENSORS;
use crate::diagnose::regression::sensors;
pub use crate::diagnose::regression::sensors::BLURRED;
use crate::diagnose::regression::shared::{self, PathError};
use crate::diagnose::search::round::{Problem, Round};
use crate::flight_path::reconstruction::Reconstruction;
use crate::per_flight::PerFlight;
use crate::weak_form::prepared::Prepared;
use greylag_model::GreyBox;

/// Number of fits; each fit is linearised at the estimate of the previous one.
const PASSES: usize = 4;
/// Seed of the random draws for the errors-in-variables correction.
const SEED: u64 = 1;

/// Uncertainty of a flight after its reconstruction: standard deviations of the sensor errors, and errors of airspeed,
/// α and β.
#[derive(Clone, Copy, Debug)]
pub struct Doubt {
    sensors: [f64; SENSORS],
    path: PathError,
}

impl Doubt {
    /// Computes the uncertainty of `flight` at the sampling interval `dt` (s).
    pub fn of(flight: &Reconstruction, dt: f64) -> Doubt {
        Doubt { sensors: sensors::widths(flight, dt), path: shared::path_error(flight, dt) }
    }
}

/// Result of a fit to forces and moments in which the delays of the actuator records are free.
pub struct Clocks {
    /// The model with its fitted coefficients.
    pub model: GreyBox,
    /// Delay of the actuator record of each flight and its standard deviation, s.
    pub late: Vec<[f64; 2]>,
}

/// Fits `model` to `flights`, together with the delay of each actuator record and the constants of each flight that
/// `per_flight` selects.
///
/// The first `given` coefficients have their prior standard deviations. The other linear coefficients have no prior.
/// `near` is an estimate close to the result, from which a single fit suffices. `None` if the model cannot be evaluated over the
/// flights.
pub fn clocks(
    model: &GreyBox,
    near: Option<&GreyBox>,
    given: usize,
    flights: &[(&Prepared, &Doubt)],
    per_flight: PerFlight,
) -> Option<Clocks> {
    let problem = Problem {
        flights: flights.iter().map(|(flight, _)| (*flight).clone()).collect(),
        prior: model.coefficients().iter().take(given).map(|c| (c.value, c.width())).collect(),
        path: flights.iter().map(|(_, doubt)| doubt.path).collect(),
        sensors: flights.iter().map(|(_, doubt)| doubt.sensors).collect(),
        per_flight,
        seed: SEED,
    };
    let passes = if near.is_some() { 1 } else { PASSES };
    let mut round = Round::new(&problem, near.unwrap_or(model).clone(), &[])?;
    for _ in 1..passes {
        round = Round::new(&problem, round.tuned(), &[])?;
    }
    let p = &round.projected;
    let clocks =
        round.known.iter().enumerate().filter(|(_, known)| known.name.starts_with(sensors::LATE));
    let late = clocks.map(|(k, _)| [p.tuned[k], p.covariance[(k, k)].max(0.0).sqrt()]).collect();
    Some(Clocks { model: round.tuned(), late })
}
