//! Flight-test schedules: attitudes and airspeeds to be held, with excitations for system identification. An excitation is a test
//! signal that is added to a command or to a target.
//!
//! A schedule is a pure function of time: [`Schedule::at`] returns the target and the excitation at a time. [`Scheduled`] is a
//! controller that flies a schedule. [`Overlay`] adds a schedule's excitation to a command. [`menu`] has standard manoeuvres
//! by name. [`flights`] draws complete flights. [`Schedule::load`] and [`Schedule::to_toml`] read and write files.

mod excitation;
mod file;
pub mod flights;
pub mod menu;
mod scheduled;

pub use excitation::{Axis, Excitation, Shape};
pub use file::ScheduleError;
pub use scheduled::{Overlay, Scheduled};

use greylag_control::Target;
use greylag_physics::Command;

/// Largest |bank| of a schedule, degrees.
pub const ROLL_MAX_DEG: f64 = 70.0;
/// Largest |pitch angle| of a schedule, degrees.
pub const PITCH_MAX_DEG: f64 = 35.0;
/// Smallest and largest airspeed of a schedule, m/s. The stall in [`menu`] commands 0.6 of the cruise airspeed, and the smallest
/// value allows it for a slow aircraft too.
pub const AIRSPEED_MPS: [f64; 2] = [2.0, 400.0];
/// Cruise airspeed of the aircraft for which the menu and the drawn flights are written, m/s.
pub const CRUISE_MPS: f64 = 20.0;
/// Longest duration of a schedule, s.
pub const DURATION_MAX_S: f64 = 3600.0;

/// One step of a schedule: an attitude and an airspeed held for a time, with excitations.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// Duration of the step, s.
    pub duration: f64,
    /// Target attitude and airspeed.
    pub target: Target,
    /// Excitations of the step. Several may be active at the same time.
    pub excitations: Vec<Excitation>,
}

impl Step {
    /// A step that holds `roll_deg`, `pitch_deg` and `airspeed_mps` for `duration_s`, without excitation.
    pub fn hold(duration_s: f64, roll_deg: f64, pitch_deg: f64, airspeed_mps: f64) -> Step {
        let target = Target {
            roll: roll_deg.to_radians(),
            pitch: pitch_deg.to_radians(),
            airspeed: airspeed_mps,
        };
        Step { duration: duration_s, target, excitations: Vec::new() }
    }

    /// The same step with `excitation` added.
    pub fn with(mut self, excitation: Excitation) -> Step {
        self.excitations.push(excitation);
        self
    }
}

/// Target and excitation of a schedule at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Demand {
    /// The attitude and the airspeed to be held.
    pub target: Target,
    /// Excitation added to the controller's command.
    pub added: Command,
    /// For aileron, elevator, throttle and rudder: the fraction (0..=1) of the controller's reaction that is applied. The
    /// reaction is the change of the controller's command since the start of the excitation.
    pub authority: [f64; 4],
}

impl Demand {
    /// `target` without any excitation.
    pub fn hold(target: Target) -> Demand {
        Demand { target, added: Command::IDLE, authority: [1.0; 4] }
    }
}

/// A flight-test schedule. After its end the target is level flight at the last airspeed.
#[derive(Clone, Debug, PartialEq)]
pub struct Schedule {
    /// Name of the schedule.
    pub name: String,
    /// Purpose in one sentence.
    pub description: String,
    steps: Vec<Step>,
}

impl Schedule {
    /// A schedule with these `steps`.
    ///
    /// # Errors
    ///
    /// If there is no step, or a value is outside the bounds in this module. The error states the number of the step.
    pub fn new(
        name: impl Into<String>,
        description: impl Into<String>,
        steps: Vec<Step>,
    ) -> Result<Schedule, String> {
        file::check(&steps)?;
        Ok(Schedule { name: name.into(), description: description.into(), steps })
    }

    /// The steps of the schedule, in order.
    pub fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// Duration of the schedule, s.
    pub fn duration(&self) -> f64 {
        self.steps.iter().map(|step| step.duration).sum()
    }

    /// Target and excitation at `t` (s after the start).
    ///
    /// Before the start, the target is that of the first step. After the end, the target is that of `Schedule::after`. There
    /// is no excitation at these times.
    pub fn at(&self, t: f64) -> Demand {
        let mut begins = 0.0;
        for step in &self.steps {
            if t < begins + step.duration {
                return within(step, t - begins);
            }
            begins += step.duration;
        }
        Demand::hold(self.after())
    }

    /// The target after the end: level wings, zero pitch and the airspeed of the last step.
    pub fn after(&self) -> Target {
        let airspeed = self.steps.last().map_or(f64::NAN, |step| step.target.airspeed);
        Target { roll: 0.0, pitch: 0.0, airspeed }
    }

    /// The same schedule with weaker excitations of the surfaces and the throttle. Their amplitudes are multiplied by `factor`,
    /// which is limited to 0..=1.
    pub fn gentler(&self, factor: f64) -> Schedule {
        let mut gentler = self.clone();
        let commands = [Axis::Aileron, Axis::Elevator, Axis::Throttle, Axis::Rudder];
        let all = gentler.steps.iter_mut().flat_map(|step| &mut step.excitations);
        all.filter(|e| commands.contains(&e.axis))
            .for_each(|e| e.amplitude *= factor.clamp(0.0, 1.0));
        gentler
    }

    /// The same schedule for an aircraft with the cruise airspeed `cruise` (m/s). All airspeeds are multiplied by `cruise` /
    /// [`CRUISE_MPS`].
    pub fn at_cruise(mut self, cruise: f64) -> Schedule {
        let factor = cruise / CRUISE_MPS;
        for step in &mut self.steps {
            step.target.airspeed *= factor;
            let of_airspeed = step.excitations.iter_mut().filter(|e| e.axis == Axis::Airspeed);
            of_airspeed.for_each(|e| e.amplitude *= factor);
        }
        self
    }

    /// The same schedule with a rudder multisine added to every step. The multisines are drawn from `seed`.
    pub fn with_rudder(mut self, seed: u64) -> Schedule {
        const AMPLITUDE: f64 = 0.12;
        for (k, step) in self.steps.iter_mut().enumerate() {
            let shape = Shape::multisine(0.2, 2.0, seed ^ ((k as u64 + 1) << 32));
            step.excitations.push(Excitation::new(Axis::Rudder, AMPLITUDE, 0.0, shape));
        }
        self
    }

    /// This schedule followed by `next`.
    pub fn then(mut self, next: Schedule) -> Schedule {
        self.steps.extend(next.steps);
        self
    }
}

/// Target and excitation at `t` (s) after the start of `step`.
fn within(step: &Step, t: f64) -> Demand {
    let mut demand = Demand::hold(step.target);
    let Demand { target, added, authority } = &mut demand;
    for excitation in &step.excitations {
        let Some(value) = excitation.at(t, step.duration) else { continue };
        let (sum, share) = match excitation.axis {
            Axis::Aileron => (&mut added.aileron, Some(&mut authority[0])),
            Axis::Elevator => (&mut added.elevator, Some(&mut authority[1])),
            Axis::Throttle => (&mut added.throttle, Some(&mut authority[2])),
            Axis::Rudder => (&mut added.rudder, Some(&mut authority[3])),
            Axis::Roll => (&mut target.roll, None),
            Axis::Pitch => (&mut target.pitch, None),
            Axis::Airspeed => (&mut target.airspeed, None),
        };
        *sum += value;
        if let Some(share) = share {
            *share = share.min(excitation.authority);
        }
    }
    demand
}
