//! Requests to a planner and decisions for the vehicle.

use super::Pilot;
use greylag_control::{Controller, Observation, Overruled, Target};
use greylag_link::autopilot::Mode;
use greylag_link::vehicle::{Demand, Fault, Outputs};
use greylag_physics::{Command, Time};

/// Planning request of a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Request {
    /// Observation at this tick.
    pub observation: Observation,
    /// Target, already limited to the envelope.
    pub target: Target,
    /// The controller's last command, if the envelope limiter changed it; otherwise `None`.
    pub overruled: Option<Overruled>,
    /// Whether the planner is being engaged and must reset its internal state.
    pub engage: bool,
}

/// Seed of a controller's random numbers, the same at every engagement.
const SEED: u64 = 0;

impl Request {
    /// The command of `controller` for this request. On engagement the controller is reset first.
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

/// Outcome of a planning request.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Plan {
    /// The planner's command arrived in time. It need not be finite or in range.
    Ready(Command),
    /// The planner's command did not arrive in time.
    Late,
    /// The planner was still busy with an earlier request and did not receive this one.
    Busy,
    /// No planner is active.
    None,
}

/// Origin of the command of a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Source {
    /// The planner's own command.
    Planned,
    /// The fallback controller's command, because the plan was late or the planner was busy.
    Late,
    /// The fallback controller's command, because no planner is active or its command was not finite.
    Fallback,
    /// The last command, held over a short gap in usable states.
    Held,
    /// Level trim, because the state is unusable or the fallback's command is not finite.
    Level,
    /// The pilot's stick positions as surface and throttle commands.
    Sticks,
    /// Level trim with the small pulses of the polarity check.
    Check,
    /// Disarmed: all outputs are zero.
    Disarmed,
}

impl Source {
    /// Name of the origin in recordings.
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

/// The pilot's decision of a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decision {
    /// Vehicle time of the state frame to which the decision responds.
    pub time: Time,
    /// Actuator command, finite and in range. While armed, it differs from the last command by at most the slew limit.
    /// While disarmed, it is [`Command::IDLE`].
    pub command: Command,
    /// Origin of the command.
    pub source: Source,
    /// Whether the actuator outputs are enabled.
    pub armed: bool,
    /// The active mode.
    pub mode: Mode,
    /// The target after envelope limits. Roll and pitch are NaN in stick control and while disarmed.
    pub target: Target,
    /// Whether a failsafe is active.
    pub failsafe: bool,
    /// Fault found by the polarity check or the oscillation guard since arming; `None` without a fault.
    pub refused: Option<Fault>,
}

impl Decision {
    /// The demand on the vehicle. A fault returns control to a real flight controller, which has its own sensors. Such
    /// faults are an unusable state, an active failsafe, and a finding of the polarity check or the oscillation guard.
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

impl Pilot {
    /// The decision of this tick.
    pub(super) fn decision(&self) -> Decision {
        Decision {
            time: self.answering,
            command: self.in_force,
            source: self.source,
            armed: self.armed,
            mode: self.mode,
            target: self.target,
            failsafe: self.failsafe(),
            refused: self.refused,
        }
    }
}
