//! A flight test in JSBSim: a schedule flown by a controller, every step's truth kept.

use greylag_sitl::plant::{PlantOptions, Truth};

use crate::{Environment, Simulator, Trouble};
use greylag_control::{Controller, Target};
use greylag_manoeuvres::{PITCH_MAX_DEG, ROLL_MAX_DEG, Schedule, Scheduled};
use greylag_physics::Command;

/// Factor by which a schedule is made gentler when an aircraft does not stay inside its bounds.
const GENTLER: f64 = 0.75;
/// Schedules tried before an aircraft is taken for one that cannot be flown.
const TRIES: usize = 7;

/// A flight as it was: the truth and the command of every step of 0.01 s.
#[derive(Clone, Debug)]
pub struct Flown {
    /// The truth before each step.
    pub truth: Vec<Truth>,
    /// The command given at that moment.
    pub commands: Vec<Command>,
}

/// Why a flight test did not come off.
#[derive(Debug, thiserror::Error)]
pub enum FlightTestError {
    /// The simulator says so.
    #[error("flying schedule {schedule}: {why}")]
    Trouble {
        /// The schedule's name.
        schedule: String,
        /// What it says.
        why: Box<Trouble>,
    },
    /// The aircraft does not stay where it is asked to.
    #[error(
        "flying schedule {schedule}: the aircraft is at roll {roll_deg:.0}°, pitch {pitch_deg:.0}° \
         after {time_s:.1} s, outside {ROLL_MAX_DEG}° and {PITCH_MAX_DEG}°; use a smaller hidden \
         effect, a gentler schedule or another controller"
    )]
    Departed {
        /// The schedule's name.
        schedule: String,
        /// When, s.
        time_s: f64,
        /// Its roll then, degrees.
        roll_deg: f64,
        /// Its pitch then, degrees.
        pitch_deg: f64,
    },
}

/// Flies `schedule` with `controller` in the aircraft and the air of `plant`.
///
/// # Errors
/// If the plant cannot be built or leaves the numbers, or the aircraft leaves the bounds.
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

/// [`fly`], with gentler excitation as long as the aircraft leaves its bounds.
///
/// # Errors
/// As [`fly`], of the gentlest schedule tried.
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
