//! How late the actuators are recorded, as forces and moments together tell it.
//!
//! A surface that acts late is like a surface recorded early, but the throttle hangs on the same clock: what
//! it does to the forces tells the two apart, and free runs, in which the thrust is only an acceleration, do
//! not.

use crate::diagnose::regression::columns::SENSORS;
use crate::diagnose::regression::sensors;
pub use crate::diagnose::regression::sensors::BLURRED;
use crate::diagnose::regression::shared::{self, PathError};
use crate::diagnose::search::round::{Problem, Round};
use crate::flight_path::reconstruction::Reconstruction;
use crate::per_flight::PerFlight;
use crate::weak_form::prepared::Prepared;
use greylag_model::GreyBox;

/// Times that everything is fitted again around the last values.
const PASSES: usize = 4;
/// Seed of what is random about the noise that columns share.
const SEED: u64 = 1;

/// What the reconstruction leaves in doubt of a flight.
#[derive(Clone, Copy, Debug)]
pub struct Doubt {
    sensors: [f64; SENSORS],
    path: PathError,
}

impl Doubt {
    /// Of `flight`, put on a clock whose samples are `dt` (s) apart.
    pub fn of(flight: &Reconstruction, dt: f64) -> Doubt {
        Doubt { sensors: sensors::widths(flight, dt), path: shared::path_error(flight, dt) }
    }
}

/// A model as forces and moments have it, with the clocks that go with it.
pub struct Clocks {
    /// The model with its coefficients fitted.
    pub model: GreyBox,
    /// How late each flight's actuators are recorded, s, with standard deviation.
    pub late: Vec<[f64; 2]>,
}

/// Fits `model`, each flight with what it has of its own by `per_flight`, whose first `given` coefficients have their prior widths and whose others have none, together
/// with the clocks of `flights`; `None` if they do not hold the model at all.
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
