//! Delay of the recorded actuators, estimated from forces and moments together.
//!
//! A delayed surface and an early record of the surface have the same effect on the moments. The throttle is recorded with
//! the same clock: its effect on the forces shows the clock error. Free runs, in which thrust is only an acceleration, do not
//! distinguish both causes.

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
/// Seed of the random draws of shared noise.
const SEED: u64 = 1;

/// Standard deviations of the sensor errors and of the path of a flight after its reconstruction.
#[derive(Clone, Copy, Debug)]
pub struct Doubt {
    sensors: [f64; SENSORS],
    path: PathError,
}

impl Doubt {
    /// The standard deviations for `flight` at the sampling interval `dt` (s).
    pub fn of(flight: &Reconstruction, dt: f64) -> Doubt {
        Doubt { sensors: sensors::widths(flight, dt), path: shared::path_error(flight, dt) }
    }
}

/// A model fitted to forces and moments together with the actuators' delays.
pub struct Clocks {
    /// The model with its fitted coefficients.
    pub model: GreyBox,
    /// Delay of each flight's recorded actuators, s, and its standard deviation.
    pub late: Vec<[f64; 2]>,
}

/// Fits `model` to `flights` together with their actuator delays and the constants of each flight that `per_flight` selects.
///
/// The first `given` coefficients have their prior standard deviations. The others have no prior. `None` if the model cannot
/// be evaluated over the flights.
pub fn clocks(
    model: &GreyBox,
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
    let mut round = Round::new(&problem, model.clone(), &[])?;
    for _ in 1..PASSES {
        round = Round::new(&problem, round.tuned(), &[])?;
    }
    let p = &round.projected;
    let clocks =
        round.known.iter().enumerate().filter(|(_, known)| known.name.starts_with(sensors::LATE));
    let late = clocks.map(|(k, _)| [p.tuned[k], p.covariance[(k, k)].max(0.0).sqrt()]).collect();
    Some(Clocks { model: round.tuned(), late })
}
