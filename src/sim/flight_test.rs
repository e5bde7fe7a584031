//! A flight test in JSBSim: a controller flies a schedule of attitudes and excitations. The true state of every step is stored.

use greylag_sitl::plant::{PlantOptions, Truth};

use crate::{Environment, Simulator, Trouble};
use greylag_control::{Controller, Target};
use greylag_manoeuvres::{PITCH_MAX_DEG, ROLL_MAX_DEG, Schedule, Scheduled};
use greylag_physics::Command;

/// Factor by which the excitation is multiplied before a flight is repeated.
const GENTLER: f64 = 0.75;
/// Largest number of flights of one schedule, with less and less excitation.
const TRIES: usize = 7;

/// A flight without sensor errors: truth and command of every step of 0.01 s.
#[derive(Clone, Debug)]
pub struct Flown {
    /// The true state before each step.
    pub truth: Vec<Truth>,
    /// The command of each step.
    pub commands: Vec<Command>,
}

/// A flight test failed.
#[derive(Debug, thiserror::Error)]
pub enum FlightTestError {
    /// The simulator reports an error.
    #[error("flying schedule {schedule}: {why}")]
    Trouble {
        /// Name of the schedule.
        schedule: String,
        /// Error that the simulator reported.
        why: Box<Trouble>,
    },
    /// The aircraft exceeded the largest roll or pitch of a schedule, [`ROLL_MAX_DEG`] and [`PITCH_MAX_DEG`].
    #[error(
        "flying schedule {schedule}: the aircraft is at roll {roll_deg:.0}°, pitch {pitch_deg:.0}° \
         after {time_s:.1} s, outside {ROLL_MAX_DEG}° and {PITCH_MAX_DEG}°; use a smaller hidden \
         effect, a gentler schedule or another controller"
    )]
    Departed {
        /// Name of the schedule.
        schedule: String,
        /// Time at which the aircraft left the bounds, s.
        time_s: f64,
        /// Roll at that time, degrees.
        roll_deg: f64,
        /// Pitch at that time, degrees.
        pitch_deg: f64,
    },
}

/// Flies `schedule` with `controller` in the aircraft and air of `plant`.
///
/// # Errors
///
/// If the simulator reports an error, such as a state that is not finite, or the aircraft exceeds the largest roll or pitch of a
/// schedule.
pub fn fly(
    plant: &PlantOptions,
    controller: &dyn Controller,
    schedule: &Schedule,
) -> Result<Flown, FlightTestError> {
    let trouble =
        |why| FlightTestError::Trouble { schedule: schedule.name.clone(), why: Box::new(why) };
    let mut simulator = Simulator::new(plant).map_err(trouble)?;
    let mut pilot = Scheduled::new(controller.boxed_clone(), schedule.clone());
    pilot.reset(plant.seed.into());
    let mut seen = simulator.reset().map_err(trouble)?;
    let steps = (schedule.duration() / greylag_sitl::plant::DT_S).round() as usize;
    let mut flown = Flown { truth: Vec::with_capacity(steps), commands: Vec::with_capacity(steps) };
    let nobody = Target { roll: 0.0, pitch: 0.0, airspeed: f64::NAN };
    for _ in 0..steps {
        let truth = simulator.truth();
        let (roll_deg, pitch_deg) = (truth.roll_rad.to_degrees(), truth.pitch_rad.to_degrees());
        if !(roll_deg.abs() <= ROLL_MAX_DEG && pitch_deg.abs() <= PITCH_MAX_DEG) {
            let schedule = schedule.name.clone();
            let time_s = truth.time_s;
            return Err(FlightTestError::Departed { schedule, time_s, roll_deg, pitch_deg });
        }
        let command = pilot.command(&seen, &nobody);
        flown.truth.push(truth);
        flown.commands.push(command);
        seen = simulator.step(command).map_err(trouble)?;
    }
    Ok(flown)
}

/// Flies `schedule` like [`fly`]. If the aircraft exceeds the largest roll or pitch, the flight is repeated with less excitation,
/// up to six times.
///
/// # Errors
///
/// The same as [`fly`], for the last repetition.
pub fn fly_within_bounds(
    plant: &PlantOptions,
    controller: &dyn Controller,
    schedule: &Schedule,
) -> Result<Flown, FlightTestError> {
    let mut schedule = schedule.clone();
    for _ in 1..TRIES {
        match fly(plant, controller, &schedule) {
            Err(FlightTestError::Departed { .. }) => schedule = schedule.gentler(GENTLER),
            done => return done,
        }
    }
    fly(plant, controller, &schedule)
}
