//! A test case (trial) of the diagnosis: flights of an aircraft with an effect that its model lacks.
//!
//! A schedule is a sequence of targets and excitations that a controller flies. It has bounds that the aircraft must not leave.

use std::f64::consts::TAU;

use greylag_sitl::air::{Air, Turbulence};
use greylag_sitl::plant::{PlantOptions, Start};
use rand::RngExt;

use crate::described::describe;
use crate::flight_test::{FlightTestError, fly_within_bounds};
use crate::installation::Installation;
use crate::instruments::Instruments;
use crate::missing::Missing;
use greylag_control::Controller;
use greylag_logs::Flight;
use greylag_manoeuvres::{CRUISE_MPS, Schedule, flights};
use greylag_num::stream::stream;
use greylag_physics::Airframe;
use greylag_physics::airframe::Reference;

/// Id of the random stream of the wind.
const WIND: u64 = 82;
/// Largest steady wind for an aircraft that cruises at `CRUISE_MPS`, m/s. For other aircraft it is proportional to the cruise
/// airspeed.
const WIND_MAX_MPS: f64 = 6.0;
/// Wind speed at 20 ft above ground in light turbulence, m/s (MIL-F-8785C).
const LIGHT_20FT_MPS: f64 = 7.6;

/// The aircraft of a test case.
#[derive(Clone, Debug)]
pub struct Subject {
    /// The simulated aircraft: its initial state, and the JSBSim properties that are held constant. The test case adds wind,
    /// turbulence and the effects that the model lacks.
    pub plant: PlantOptions,
    /// Cruise airspeed, m/s.
    pub cruise: f64,
    /// Whether the rudder is excited too.
    pub rudder: bool,
}

impl Subject {
    /// The aircraft of `plant` as described by `airframe`. It starts at the reference airspeed and altitude of `airframe`.
    ///
    /// # Errors
    ///
    /// If some surfaces of `airframe` have a JSBSim position property and others have none.
    pub fn new(mut plant: PlantOptions, airframe: &Airframe) -> Result<Subject, String> {
        describe(&mut plant, airframe)?;
        let Reference { airspeed, altitude } = airframe.reference;
        plant.start = Start { airspeed_mps: airspeed, altitude_m: altitude, ..Start::NEUTRAL };
        Ok(Subject {
            plant,
            cruise: airframe.envelope.airspeed_cruise_mps,
            rudder: airframe.actuators.rudder.is_some(),
        })
    }

    /// The schedule scaled to the cruise airspeed of this aircraft, with rudder excitation if it has a rudder.
    fn scaled(&self, schedule: &Schedule, seed: u64) -> Schedule {
        let schedule = schedule.clone().at_cruise(self.cruise);
        if self.rudder { schedule.with_rudder(seed) } else { schedule }
    }
}

impl Default for Subject {
    /// The simulator's default aircraft.
    fn default() -> Subject {
        Subject { plant: PlantOptions::default(), cruise: CRUISE_MPS, rudder: false }
    }
}

/// Conditions of a test case.
#[derive(Clone, Debug, Default)]
pub struct Trial {
    /// The aircraft to be flown.
    pub subject: Subject,
    /// Seed of schedules, wind, instruments and noise.
    pub seed: u64,
    /// The effects that the aircraft has and its model lacks; empty for a case without a missing effect.
    pub missing: Vec<Missing>,
    /// Severity of the turbulence: a probability-of-exceedance curve of MIL-F-8785C, 1 to 7. `None` for no turbulence.
    pub turbulence: Option<u8>,
    /// Installation errors of the instruments, the same in all flights.
    pub installed: Installation,
}

/// Logs of the flights of a test case.
#[derive(Clone, Debug)]
pub struct Logs {
    /// Flights for parameter estimation.
    pub training: Vec<Flight>,
    /// Flights for model validation.
    pub testing: Vec<Flight>,
}

impl Trial {
    /// Flies the training and the test flights of the seed with `controller`. A flight that leaves the bounds of its schedule
    /// is repeated with less excitation. Sensor errors are drawn anew for each flight.
    ///
    /// # Errors
    ///
    /// If the aircraft cannot be simulated, or leaves the bounds of a schedule even with the smallest excitation.
    pub fn fly(&self, controller: &dyn Controller) -> Result<Logs, FlightTestError> {
        let training = self.training(controller)?;
        let testing = flights::testing(self.seed);
        let logged =
            |(k, schedule): (usize, &Schedule)| self.log(training.len() + k, schedule, controller);
        let testing = testing.iter().enumerate().map(logged).collect::<Result<_, _>>()?;
        Ok(Logs { training, testing })
    }

    /// Flies and logs the training flights only.
    ///
    /// # Errors
    ///
    /// The same as [`Self::fly`].
    pub fn training(&self, controller: &dyn Controller) -> Result<Vec<Flight>, FlightTestError> {
        let schedules = flights::training(self.seed);
        schedules.iter().enumerate().map(|(k, s)| self.log(k, s, controller)).collect()
    }

    /// Flies one schedule as the `k`-th flight of the test case, and returns its log.
    fn log(
        &self,
        k: usize,
        schedule: &Schedule,
        controller: &dyn Controller,
    ) -> Result<Flight, FlightTestError> {
        let schedule = &self.subject.scaled(schedule, self.seed);
        let flown = fly_within_bounds(&self.plant(k), controller, schedule)?;
        let seed = stream(self.seed, &[WIND, k as u64, 1]).random();
        let mut log = Instruments::drawn(seed).log(&flown, &format!("{}.csv", schedule.name), seed);
        self.installed.apply(&mut log);
        Ok(log)
    }

    /// The simulated aircraft with the missing effects, and with the wind and the turbulence of the `k`-th flight.
    fn plant(&self, k: usize) -> PlantOptions {
        let mut random = stream(self.seed, &[WIND, k as u64]);
        let calm = self.subject.cruise / CRUISE_MPS;
        let (speed, course) =
            (random.random_range(0.0..WIND_MAX_MPS) * calm, random.random_range(0.0..TAU));
        let turbulence = |severity| Turbulence { wind_20ft_mps: LIGHT_20FT_MPS, severity };
        PlantOptions {
            hidden: self.missing.iter().filter_map(|missing| missing.hidden).collect(),
            air: Air {
                wind_ned_mps: [speed * course.cos(), speed * course.sin(), 0.0],
                turbulence: self.turbulence.map(turbulence),
                gusts: Vec::new(),
            },
            seed: random.random(),
            ..self.subject.plant.clone()
        }
    }
}
