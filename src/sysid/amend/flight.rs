//! A flight with what is left in doubt of its sensors.

use crate::diagnose::search::clocks::{BLURRED, Doubt};
use crate::flight_path::reconstruction::Reconstruction;
use crate::per_flight::trims::TRIMS;
use crate::per_flight::{PerFlight, askew};
use crate::weak_form::prepared::{ClockError, Prepared};

/// Constants of a flight's sensors that are estimated along.
pub(super) const SENSORS: usize = 8;
/// Place of the actuators' delay among them, s.
pub(super) const SKEW: usize = 0;
/// The state that each of those behind it offsets; the airspeed's is a share of it.
pub(super) const OFFSETS: [usize; SENSORS - 2] = [2, 3, 4, 5, 6, 7];
/// Place of the actuators' blur behind those: half the variance, in squared samples, of the time over which a
/// recorded deflection is a mean.
pub(super) const BLUR: usize = SENSORS - 1;
/// The airspeed among the eight states.
pub(super) const AIRSPEED: usize = 2;

/// Least standard deviation of the actuators' clock as forces tell it, s (0.3 ms root mean square against the
/// truth of simulated flights).
pub(super) const SKEW_LEAST: f64 = 5e-4;
/// Standard deviation of the actuators' clock against the gyros', s: that of ±1.5 samples, both of
/// them late by 0 to 10 ms or the like.
const SKEW_SD: f64 = 7.7e-3;
/// What is left in doubt if the reconstruction does not say: share of the airspeed, body rates
/// (rad/s), α and β (rad).
const DOUBT: [f64; 6] = [0.003, 2e-4, 2e-4, 2e-4, 0.002, 0.002];
/// Names of the reconstruction's constants, in that order.
const NAMES: [&str; 6] =
    ["airspeed_scale", "gyro_bias_p", "gyro_bias_q", "gyro_bias_r", "alpha_bias", "beta_bias"];

/// What is estimated of a flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Own {
    /// Its sensors' constants.
    pub sensors: [f64; SENSORS],
    /// By how much its measured axes are turned, rad; zero where that is not asked for.
    pub askew: [f64; askew::NAMES.len()],
    /// Its trims; zero where they are not asked for.
    pub trims: [f64; TRIMS.len()],
}

impl Own {
    /// Nothing but `sensors`.
    pub fn of(sensors: [f64; SENSORS]) -> Own {
        Own { sensors, askew: Default::default(), trims: Default::default() }
    }

    /// What `asked` makes unknown, in the order of the unknowns: sensors, angles, trims.
    pub fn unknowns(&self, asked: &PerFlight) -> impl Iterator<Item = f64> {
        let askew = self.askew.into_iter().take(asked.angles());
        let trims = self.trims.into_iter().take(if asked.has_trims() { TRIMS.len() } else { 0 });
        self.sensors.into_iter().chain(askew).chain(trims)
    }

    /// Adds `step`, in that order.
    pub fn step(&mut self, asked: &PerFlight, step: &[f64]) {
        let askew = self.askew.iter_mut().take(asked.angles());
        let all = self.sensors.iter_mut().chain(askew).chain(&mut self.trims);
        all.zip(step).for_each(|(x, by)| *x += by);
    }
}

/// A flight as the fit takes it.
#[derive(Clone, Debug)]
pub struct Flight {
    /// The flight on the models' clock, its deflections as recorded.
    pub prepared: Prepared,
    /// Means and standard deviations of the actuators' delay (s), the airspeed's scale (a share), the biases
    /// of p, q, r (rad/s), α and β (rad) that the reconstruction has left, and of the actuators' blur.
    pub doubt: [[f64; 2]; SENSORS],
    /// What forces and moments are judged by.
    pub(super) forces: Doubt,
}

impl Flight {
    /// Puts `flight` on the models' clock and keeps what was flown faster than `slowest` (m/s).
    ///
    /// # Errors
    /// It has no clock.
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

    /// Seconds flown.
    pub fn seconds(&self) -> f64 {
        self.prepared.sample_count() as f64 * self.prepared.dt
    }
}
