//! The command protocol: every command for this component is acknowledged, including unknown commands.

use super::{Clients, Now};
use crate::autopilot::{Autopilot, Mode, Status, Verdict};
use crate::framing::{Source, Version};
use crate::wire::Message;
use crate::wire::answer::{self, CommandResult};
use crate::wire::mode::{self, ModeRequest};
use crate::wire::request::CommandRequest;
use crate::wire::telemetry;

/// Value of parameter 2 that forces arming or disarming.
const FORCE: f64 = 21196.0;
const HEARTBEAT: u32 = 0;
const AUTOPILOT_VERSION: u32 = 148;
const HOME_POSITION: u32 = 242;
const MESSAGE_INTERVAL: u32 = 244;
const PROTOCOL_VERSION: u32 = 300;
const AVAILABLE_MODES: u32 = 435;
/// Commands with a side effect: NAV_LOITER_UNLIM, NAV_RETURN_TO_LAUNCH, DO_SET_MODE, COMPONENT_ARM_DISARM. All other
/// supported commands may be repeated without harm.
const CHANGING: [u16; 4] = [17, 20, 176, 400];

/// Reason for which a retransmission is rejected.
const ENDED: &str = "Repeated command: its effect ended; send it anew";

/// The mode that `command` requests; `None` if it requests none.
fn requested_mode(command: &CommandRequest) -> Option<ModeRequest> {
    let [first, second, third, ..] = command.params;
    match command.number {
        // NAV_LOITER_UNLIM, NAV_RETURN_TO_LAUNCH, DO_SET_MODE
        17 => Some(ModeRequest::Known(Mode::Hold)),
        20 => Some(ModeRequest::Known(Mode::Return)),
        176 => Some(mode::from_do_set_mode(first, second, third)),
        _ => None,
    }
}

/// Whether the effect of the accepted `command` (mode or arming) lasts.
fn in_force(command: &CommandRequest, status: &Status) -> bool {
    match requested_mode(command) {
        Some(mode) => mode == ModeRequest::Known(status.mode),
        None => status.armed == (command.params[0] == 1.0),
    }
}

/// Result of a command: the acknowledgement, requested messages, and the reason for a refusal.
struct Outcome {
    result: CommandResult,
    messages: Vec<Message>,
    reason: Option<String>,
}

impl From<CommandResult> for Outcome {
    fn from(result: CommandResult) -> Self {
        Outcome { result, messages: vec![], reason: None }
    }
}

impl From<Verdict> for Outcome {
    fn from(verdict: Verdict) -> Self {
        match verdict {
            Verdict::Accepted => CommandResult::Accepted.into(),
            Verdict::Rejected(why) => Outcome {
                result: CommandResult::TemporarilyRejected,
                messages: vec![],
                reason: Some(why),
            },
            Verdict::Denied(why) => {
                Outcome { result: CommandResult::Denied, messages: vec![], reason: Some(why) }
            }
        }
    }
}

impl Outcome {
    fn with(message: Message) -> Self {
        Outcome { result: CommandResult::Accepted, messages: vec![message], reason: None }
    }

    fn denied(reason: &str) -> Self {
        Verdict::Denied(reason.into()).into()
    }
}

/// A message id from a float parameter; `None` unless it is an integer below 2²⁴.
fn message_number(parameter: f64) -> Option<u32> {
    (parameter.fract() == 0.0 && (0.0..16_777_216.0).contains(&parameter))
        .then_some(parameter as u32)
}

impl Clients {
    /// Carries out a command and acknowledges it. A retransmission has a larger confirmation than the command that was
    /// carried out. It gets the same result and has no further effect. If the effect has ended since, it is temporarily
    /// rejected: a late retransmission must not undo what happened in between.
    pub(super) fn command(
        &mut self,
        now: Now,
        at: usize,
        from: Source,
        command: CommandRequest,
        autopilot: &mut dyn Autopilot,
    ) {
        if let Some(result) = self.sessions[at].answered(now.host, &command) {
            let in_force = in_force(&command, &autopilot.status());
            let result = if in_force { result } else { CommandResult::TemporarilyRejected };
            self.reply(at, &answer::command_ack(command.number, result, from));
            if !in_force {
                self.complain(now, at, ENDED);
            }
            return;
        }
        let outcome = self.carry_out(now, at, &command, autopilot);
        // a refused command had no effect and may be sent again
        if outcome.result == CommandResult::Accepted && CHANGING.contains(&command.number) {
            self.sessions[at].remember(now.host, command, outcome.result);
        }
        self.reply(at, &answer::command_ack(command.number, outcome.result, from));
        outcome.messages.iter().for_each(|message| self.send_requested(at, message));
        if let Some(reason) = outcome.reason {
            self.complain(now, at, &reason);
        }
    }

    /// Sends a requested message. PROTOCOL_VERSION is sent in MAVLink 2 even to a peer that has only sent MAVLink 1,
    /// because MAVLink 2 is negotiated by this message.
    fn send_requested(&mut self, at: usize, message: &Message) {
        match message.id() {
            PROTOCOL_VERSION => {
                self.sessions[at].send_as(Version::V2, message, self.identity, &mut self.outbox)
            }
            _ => self.reply(at, message),
        }
    }

    /// Carries out a command. Parameters that the command does not define are not read, because they are often NaN.
    fn carry_out(
        &mut self,
        now: Now,
        at: usize,
        command: &CommandRequest,
        autopilot: &mut dyn Autopilot,
    ) -> Outcome {
        if let Some(request) = requested_mode(command) {
            return match request {
                ModeRequest::Known(mode) => autopilot.set_mode(now.vehicle, mode).into(),
                ModeRequest::Unknown => {
                    Outcome::denied("Mode refused: not a mode of this autopilot")
                }
            };
        }
        let [first, second, ..] = command.params;
        match command.number {
            // COMPONENT_ARM_DISARM
            400 if first == 1.0 => autopilot.arm(now.vehicle, second == FORCE).into(),
            400 if first == 0.0 => autopilot.disarm(now.vehicle, second == FORCE).into(),
            400 => Outcome::denied("Arming refused: the first parameter is neither 0 nor 1"),
            // GET_HOME_POSITION, GET_MESSAGE_INTERVAL, SET_MESSAGE_INTERVAL, REQUEST_MESSAGE
            410 => self.requested(now, at, HOME_POSITION, f64::NAN, autopilot),
            510 => self.requested(now, at, MESSAGE_INTERVAL, first, autopilot),
            511 => self.set_message_interval(now, at, first, second),
            512 => match message_number(first) {
                Some(id) => self.requested(now, at, id, second, autopilot),
                None => CommandResult::Denied.into(),
            },
            // REQUEST_PROTOCOL_VERSION, REQUEST_AUTOPILOT_CAPABILITIES
            519 => Outcome::with(answer::protocol_version()),
            520 if first == 1.0 => Outcome::with(answer::autopilot_version()),
            520 => CommandResult::Denied.into(),
            _ => {
                self.counts.unknown_commands += 1;
                CommandResult::Unsupported.into()
            }
        }
    }

    fn requested(
        &mut self,
        now: Now,
        at: usize,
        id: u32,
        index: f64,
        autopilot: &mut dyn Autopilot,
    ) -> Outcome {
        match id {
            HEARTBEAT => Outcome::with(mode::heartbeat(&autopilot.status(), self.role)),
            AUTOPILOT_VERSION => Outcome::with(answer::autopilot_version()),
            PROTOCOL_VERSION => Outcome::with(answer::protocol_version()),
            AVAILABLE_MODES => {
                let index = if index.is_finite() { index } else { 0.0 };
                match mode::available_modes(index as usize) {
                    modes if modes.is_empty() => CommandResult::Denied.into(),
                    messages => Outcome { messages, ..CommandResult::Accepted.into() },
                }
            }
            MESSAGE_INTERVAL => match message_number(index).filter(|id| *id <= u32::from(u16::MAX))
            {
                Some(id) => Outcome::with(answer::message_interval(id, self.interval_us(at, id))),
                None => CommandResult::Denied.into(),
            },
            _ => match telemetry::message(id, &autopilot.status(), &self.scene(now)) {
                Some(message) => Outcome::with(message),
                None if telemetry::position(id).is_some() => {
                    CommandResult::TemporarilyRejected.into()
                }
                None => CommandResult::Unsupported.into(),
            },
        }
    }

    /// Interval of message `id` in µs; −1 if it is off, 0 if it is not available.
    fn interval_us(&self, at: usize, id: u32) -> i32 {
        match (id, telemetry::position(id)) {
            (HEARTBEAT, _) => 1_000_000,
            (_, Some(row)) => self.sessions[at].streams.interval_us(row),
            (_, None) => 0,
        }
    }

    fn set_message_interval(&mut self, now: Now, at: usize, id: f64, interval_us: f64) -> Outcome {
        let row = message_number(id).and_then(telemetry::position);
        let set = row
            .ok_or(())
            .and_then(|row| self.sessions[at].streams.set_interval(row, interval_us, now.host));
        match set {
            Ok(()) => CommandResult::Accepted.into(),
            Err(()) => CommandResult::Denied.into(),
        }
    }
}
