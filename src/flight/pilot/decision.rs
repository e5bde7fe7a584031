//! What the pilot asks of a planner, and what it answers to the vehicle.

use greylag_control::{Controller, Observation, Overruled, Target};
use greylag_link::autopilot::Mode;
use greylag_link::vehicle::{Demand, Fault, Outputs};
use greylag_physics::{Command, Time};

/// What a planner is asked for at a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Request {
    /// What is seen.
    pub observation: Observation,
    /// What is wanted, already inside the envelope.
    pub target: Target,
    /// Set when its last command was not flown as it was given.
    pub overruled: Option<Overruled>,
    /// Set when the planner takes over from something else: it must forget its past.
    pub engage: bool,
}

/// Seed of a controller's random numbers, the same at every engagement.
const SEED: u64 = 0;

impl Request {
    /// The command of `controller` for it.
    pub fn ask(&self, controller: &mut dyn Controller) -> Command {
        if self.engage {
            controller.reset(SEED);
        }
        if let Some(by) = &self.overruled {
            controller.overruled(by);
        }
        controller.command(&self.observation, &self.target)
    }
}

/// What became of the request.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Plan {
    /// The planner's command, in time; it need not be finite or in range.
    Ready(Command),
    /// A planner exists, but its command did not come in time.
    Late,
    /// A planner exists, but was at an earlier request and has not heard of this one.
    Busy,
    /// No planner was asked.
    None,
}

/// Who flew this tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Source {
    /// The planner's command.
    Planned,
    /// The fallback controller's, because the plan was late.
    Late,
    /// The fallback controller's, because there was no plan, or none of finite numbers.
    Fallback,
    /// The command in force, continued over a short gap in the state.
    Held,
    /// Surfaces and throttle at the constants of level trim, because the state cannot be used.
    Level,
    /// The sticks'.
    Sticks,
    /// The check of signs: level trim, with small pulses.
    Check,
    /// Nobody: disarmed, all outputs zero.
    Disarmed,
}

impl Source {
    /// The word for it in the recording.
    pub fn name(self) -> &'static str {
        match self {
            Source::Planned => "planned",
            Source::Late => "late",
            Source::Fallback => "fallback",
            Source::Held => "held",
            Source::Level => "level",
            Source::Sticks => "sticks",
            Source::Check => "check",
            Source::Disarmed => "disarmed",
        }
    }
}

/// The outcome of a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decision {
    /// Time of the state frame that is answered, vehicle clock.
    pub time: Time,
    /// What the actuators shall do: finite and in range. Armed, it is within the slew limit of the last one; disarmed,
    /// it is [`Command::IDLE`] at once.
    pub command: Command,
    /// Who decided it.
    pub source: Source,
    /// Whether the outputs are live.
    pub armed: bool,
    /// The mode in force.
    pub mode: Mode,
    /// The target in force, after the envelope; roll and pitch are NaN when sticks or nobody fly.
    pub target: Target,
    /// Whether a failsafe is in force.
    pub failsafe: bool,
    /// What the sign check or the oscillation guard has found wrong since the aircraft was armed.
    pub refused: Option<Fault>,
}

impl Decision {
    /// What it asks of the vehicle. A real controller gets the aircraft back when the state cannot
    /// be flown on, and when a failsafe is in force: it flies better blind than we do.
    pub fn demand(&self) -> Demand {
        let fault = match (self.source, self.failsafe) {
            (Source::Level, _) => Some(Fault::State),
            (_, true) => Some(Fault::Lost),
            _ => self.refused,
        };
        let or_level = |x: f64| if x.is_finite() { x } else { 0.0 };
        Demand {
            outputs: if self.armed { Outputs::Armed(self.command) } else { Outputs::Disarmed },
            attitude: [or_level(self.target.roll), or_level(self.target.pitch)],
            fault: fault.filter(|_| self.armed),
        }
    }
}
