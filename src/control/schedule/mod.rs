//! A flight-test schedule: which attitudes and airspeeds to hold, with what excitation on top.
//!
//! A schedule is a pure function of time: [`Schedule::at`] gives the target with what is added to
//! the controller's command. [`Scheduled`] flies one; [`menu`] names ready-made
//! manoeuvres, [`flights`] draws whole flights; the file form is [`Schedule::load`] and [`Schedule::to_toml`].

mod excitation;
mod file;
pub mod flights;
pub mod menu;
mod scheduled;

pub use excitation::{Axis, Excitation, Shape};
pub use file::ScheduleError;
pub use scheduled::Scheduled;

use crate::control::Target;
use crate::physics::Command;

/// Largest bank (degrees) that a schedule may ask for.
pub const ROLL_MAX_DEG: f64 = 70.0;
/// Largest pitch angle (degrees) that a schedule may ask for.
pub const PITCH_MAX_DEG: f64 = 35.0;
/// Slowest and fastest airspeed (m/s) that a schedule may ask for.
pub const AIRSPEED_MPS: [f64; 2] = [5.0, 100.0];
/// Longest schedule, s.
pub const DURATION_MAX_S: f64 = 3600.0;

/// One step: an attitude with an airspeed held for a while, and what is added meanwhile.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// How long, s.
    pub duration: f64,
    /// What is held.
    pub target: Target,
    /// What is added, all at once.
    pub excitations: Vec<Excitation>,
}

impl Step {
    /// Holds `roll_deg`, `pitch_deg` and `airspeed_mps` for `duration_s`.
    pub fn hold(duration_s: f64, roll_deg: f64, pitch_deg: f64, airspeed_mps: f64) -> Step {
        let target = Target {
            roll: roll_deg.to_radians(),
            pitch: pitch_deg.to_radians(),
            airspeed: airspeed_mps,
        };
        Step { duration: duration_s, target, excitations: Vec::new() }
    }

    /// The same step with `excitation` on top.
    pub fn with(mut self, excitation: Excitation) -> Step {
        self.excitations.push(excitation);
        self
    }
}

/// A flight-test schedule; after its end the wings are level.
#[derive(Clone, Debug, PartialEq)]
pub struct Schedule {
    /// Its name.
    pub name: String,
    /// What it is for, in one sentence.
    pub description: String,
    steps: Vec<Step>,
}

impl Schedule {
    /// A schedule of `steps`.
    ///
    /// # Errors
    /// What is wrong with a step, by its number: a figure outside the bounds of this module.
    pub fn new(
        name: impl Into<String>,
        description: impl Into<String>,
        steps: Vec<Step>,
    ) -> Result<Schedule, String> {
        file::check(&steps)?;
        Ok(Schedule { name: name.into(), description: description.into(), steps })
    }

    /// The steps.
    pub fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// Its length, s.
    pub fn duration(&self) -> f64 {
        self.steps.iter().map(|step| step.duration).sum()
    }

    /// What is wanted at `t` (s after the start), and what is added to the controller's command.
    ///
    /// Before the start it is the first step's target, after the end wings level at the last
    /// airspeed, both without excitation.
    pub fn at(&self, t: f64) -> (Target, Command) {
        let mut begins = 0.0;
        for step in &self.steps {
            if t < begins + step.duration {
                return within(step, t - begins);
            }
            begins += step.duration;
        }
        (self.after(), Command::IDLE)
    }

    /// What is wanted after the end: wings level, nose on the horizon, the last airspeed.
    pub fn after(&self) -> Target {
        let airspeed = self.steps.last().map_or(f64::NAN, |step| step.target.airspeed);
        Target { roll: 0.0, pitch: 0.0, airspeed }
    }

    /// The same schedule with every excitation multiplied by `factor` in 0..=1.
    pub fn gentler(&self, factor: f64) -> Schedule {
        let mut gentler = self.clone();
        let all = gentler.steps.iter_mut().flat_map(|step| &mut step.excitations);
        all.for_each(|excitation| excitation.amplitude *= factor.clamp(0.0, 1.0));
        gentler
    }

    /// This schedule, then `next`.
    pub fn then(mut self, next: Schedule) -> Schedule {
        self.steps.extend(next.steps);
        self
    }
}

/// The target and the addition `t` (s) after the start of `step`.
fn within(step: &Step, t: f64) -> (Target, Command) {
    let (mut target, mut added) = (step.target, Command::IDLE);
    for excitation in &step.excitations {
        let value = excitation.at(t, step.duration);
        match excitation.axis {
            Axis::Aileron => added.aileron += value,
            Axis::Elevator => added.elevator += value,
            Axis::Throttle => added.throttle += value,
            Axis::Roll => target.roll += value,
            Axis::Pitch => target.pitch += value,
            Axis::Airspeed => target.airspeed += value,
        }
    }
    (target, added)
}
