//! The pilot's requests to a planner and its decisions for the vehicle. The pilot is the flight logic of the companion; in each
//! control cycle (tick) it turns a state frame into a command. The planner is the active controller.

use super::Pilot;
use greylag_control::{Controller, Observation, Overruled, Target};
use greylag_link::autopilot::Mode;
use greylag_link::vehicle::{Demand, Fault, Outputs};
use greylag_physics::{Command, Time};

/// The request for a command that the planner gets in a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Request {
    /// Observation at this tick.
    pub observation: Observation,
    /// Target, already limited to the envelope.
    pub target: Target,
    /// The planner's last command, if the envelope limiter changed it; otherwise `None`.
    pub overruled: Option<Overruled>,
    /// Whether the planner starts to fly with this request and must reset its internal state.
    pub engage: bool,
}

/// Seed of a controller's random numbers. It is the same whenever a controller starts to fly.
const SEED: u64 = 0;

impl Request {
    /// Returns the command of `controller` for this request. If `engage` is set, the controller is reset first.
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
    /// The planner's command arrived in time. It may be out of range or not finite.
    Ready(Command),
    /// The planner's command did not arrive in time.
    Late,
    /// The planner was still busy with an earlier request and did not receive this one.
    Busy,
    /// There is no planner, or it has ended.
    None,
}

/// Origin of the command of a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Source {
    /// The planner's own command.
    Planned,
    /// The fallback controller's command, because the plan was late or the planner was busy.
    Late,
    /// The fallback controller's command, because there is no planner or its command was not finite.
    Fallback,
    /// The last command, held because the state has been unusable for a short time.
    Held,
    /// Level trim, because the state has been unusable for longer or the fallback's command is not finite.
    Level,
    /// The stick positions of the human pilot as surface and throttle commands.
    Sticks,
    /// Level trim with small surface pulses, by which the polarity check tests the direction in which the surfaces act.
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
    /// Vehicle time of the state frame for which the decision was made.
    pub time: Time,
    /// Actuator command, finite and in range. While armed, it differs from the last command by at most the slew limit.
    /// While disarmed, it is [`Command::IDLE`].
    pub command: Command,
    /// Origin of the command.
    pub source: Source,
    /// Whether the actuator outputs are enabled.
    pub armed: bool,
    /// The active flight mode of the pilot.
    pub mode: Mode,
    /// The target after the envelope limits. Roll and pitch are NaN in stick control and while disarmed.
    pub target: Target,
    /// Whether a failsafe is active.
    pub failsafe: bool,
    /// Fault that has been found since arming by the polarity check or by the oscillation guard, which detects limit cycles;
    /// `None` without a fault.
    pub refused: Option<Fault>,
}

impl Decision {
    /// The outputs for the vehicle, with a fault if a real flight controller should take control back: it has sensors of its
    /// own. While armed, there is a fault if the state is unusable, a failsafe is active, or the polarity check or the
    /// oscillation guard has found one.
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
    /// Returns the decision of this tick.
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
