//! A flight prepared for a fit, with priors for the sensor errors that remain after flight-path reconstruction.

use crate::diagnose::search::clocks::{BLURRED, Doubt};
use crate::flight_path::reconstruction::Reconstruction;
use crate::per_flight::trims::TRIMS;
use crate::per_flight::{PerFlight, askew};
use crate::weak_form::prepared::{ClockError, Prepared};

/// Number of sensor constants (remaining sensor errors, delay and blur of the actuator record) estimated for each flight.
pub(super) const SENSORS: usize = 8;
/// Index of the actuators' delay (s) among the sensor constants.
pub(super) const SKEW: usize = 0;
/// Index of the state to which each of the sensor constants between delay and blur is added as an error. The airspeed's
/// constant is a relative error, which is multiplied by the airspeed first.
pub(super) const OFFSETS: [usize; SENSORS - 2] = [2, 3, 4, 5, 6, 7];
/// Index of the actuators' blur, the last sensor constant. A recorded deflection may be a weighted mean over time. The blur
/// is half the variance of these weights in time, in squared sampling intervals.
pub(super) const BLUR: usize = SENSORS - 1;
/// Index of the airspeed among the eight states.
pub(super) const AIRSPEED: usize = 2;

/// Smallest standard deviation assumed for an actuators' delay that is estimated from forces, s. In simulations, the root
/// mean square error of this delay is 0.3 ms.
pub(super) const SKEW_LEAST: f64 = 5e-4;
/// Prior standard deviation of the actuators' delay relative to the gyros, s. The 95 % interval is ±1.5 samples: actuators
/// and gyros are each recorded 0 to 10 ms late.
const SKEW_SD: f64 = 7.7e-3;
/// Prior standard deviations of sensor errors for which the reconstruction states none: airspeed scale (relative), biases
/// of the body rates (rad/s), α and β (rad).
const DOUBT: [f64; 6] = [0.003, 2e-4, 2e-4, 2e-4, 0.002, 0.002];
/// Names of these constants in the reconstruction, in the order of `DOUBT`.
const NAMES: [&str; 6] =
    ["airspeed_scale", "gyro_bias_p", "gyro_bias_q", "gyro_bias_r", "alpha_bias", "beta_bias"];

/// Constants estimated for one flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Own {
    /// Sensor constants, in the order of [`Flight::doubt`].
    pub sensors: [f64; SENSORS],
    /// Misalignment of the measured axes, rad; zero unless it is estimated.
    pub askew: [f64; askew::NAMES.len()],
    /// Trims, dimensionless; zero unless they are estimated.
    pub trims: [f64; TRIMS.len()],
}

impl Own {
    /// Constants with the given `sensors`, zero misalignment and zero trims.
    pub fn of(sensors: [f64; SENSORS]) -> Own {
        Own { sensors, askew: Default::default(), trims: Default::default() }
    }

    /// The unknowns that `asked` selects, in order: sensors, misalignment, trims.
    pub fn unknowns(&self, asked: &PerFlight) -> impl Iterator<Item = f64> {
        let askew = self.askew.into_iter().take(asked.angles());
        let trims = self.trims.into_iter().take(if asked.has_trims() { TRIMS.len() } else { 0 });
        self.sensors.into_iter().chain(askew).chain(trims)
    }

    /// Adds `step` to the unknowns that `asked` selects, in the order of `Self::unknowns`.
    pub fn step(&mut self, asked: &PerFlight, step: &[f64]) {
        let askew = self.askew.iter_mut().take(asked.angles());
        let all = self.sensors.iter_mut().chain(askew).chain(&mut self.trims);
        all.zip(step).for_each(|(x, by)| *x += by);
    }
}

/// A flight prepared for the fit.
#[derive(Clone, Debug)]
pub struct Flight {
    /// The resampled flight, with deflections as recorded.
    pub prepared: Prepared,
    /// Prior mean and standard deviation of each sensor constant after reconstruction: actuators' delay (s), airspeed scale
    /// (relative), biases of p, q, r (rad/s), α and β (rad), actuators' blur (squared sampling intervals).
    pub doubt: [[f64; 2]; SENSORS],
    /// Uncertainty of the measured forces and moments.
    pub(super) forces: Doubt,
}

impl Flight {
    /// Resamples `flight` to a multiple of the model step and keeps the parts with an airspeed of at least `slowest` (m/s).
    ///
    /// # Errors
    /// The sampling interval of `flight` lies outside 1e-6 to 1 s.
    pub fn new(flight: &Reconstruction, slowest: f64) -> Result<Flight, ClockError> {
        let mut doubt = [[0.0, SKEW_SD]; SENSORS];
        doubt[BLUR] = BLURRED;
        for (k, (name, default)) in NAMES.iter().zip(DOUBT).enumerate() {
            let stated = flight.deviation(name).filter(|sd| *sd > 0.0);
            doubt[k + 1][1] = stated.unwrap_or(default).clamp(0.1 * default, 20.0 * default);
        }
        let prepared = Prepared::new(flight, slowest)?;
        let forces = Doubt::of(flight, prepared.dt);
        Ok(Flight { prepared, doubt, forces })
    }

    /// Usable duration of the flight, s.
    pub fn seconds(&self) -> f64 {
        self.prepared.sample_count() as f64 * self.prepared.dt
    }
}
