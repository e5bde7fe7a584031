//! One connected client: handles its messages and tracks the messages that it has requested.

use std::time::Instant;

use super::actuation::Actuation;
use super::clock::{Answers, Clock};
use super::events::Px4Event;
use crate::shim::codec::{
    CommandAck, CommandLong, Encoder, Frame, Heartbeat, HilActuatorControls, HilStateQuaternion,
    Message, Parser, Version,
};
use crate::shim::outputs::OutputMap;
use crate::shim::session::SHIM;
use crate::shim::summary::Summary;

/// Autopilot number MAV_AUTOPILOT_PX4.
const PX4: u8 = 12;
/// Command number MAV_CMD_SET_MESSAGE_INTERVAL.
const SET_MESSAGE_INTERVAL: u16 = 511;
/// MAVLink version that a HEARTBEAT of PX4 contains.
const DIALECT: u8 = 3;

const OLD_PROTOCOL: &str = "the client speaks MAVLink 1, PX4 speaks MAVLink 2 to its simulator: \
                            its messages are not flown; update it";
const OTHER_DIALECT: &str = "the client's HEARTBEAT has a MAVLink version other than 3: its \
                             messages may mean something else; update it";
const OTHER_STACK: &str = "the client's HEARTBEAT is not of PX4 (MAV_AUTOPILOT 12): its outputs \
                           may mean something else; see --px4-outputs";

/// A connected client; the shim warns if it is not PX4.
pub(super) struct Client {
    pub(super) parser: Parser,
    pub(super) encoder: Encoder,
    clock: Clock,
    /// Time of the first step whose sensors the client received, µs.
    pub(super) begun_us: u64,
    /// The newest valid actuator message.
    pub(super) actuation: Option<Actuation>,
    /// Whether the client runs in lockstep.
    pub(super) lockstep: bool,
    /// Whether the client has answered the latest step.
    pub(super) answered: bool,
    /// Arrival time of the last actuator message.
    pub(super) last_actuation: Option<Instant>,
    /// Whether the silence of the client has been reported.
    pub(super) silent: bool,
    reported: Vec<&'static str>,
    state_interval_us: Option<u64>,
    next_state_us: u64,
}

impl Client {
    pub(super) fn new(begun_us: u64) -> Self {
        Client {
            parser: Parser::default(),
            encoder: Encoder::new(SHIM.0, SHIM.1),
            clock: Clock::default(),
            begun_us,
            actuation: None,
            lockstep: false,
            answered: false,
            last_actuation: None,
            silent: false,
            reported: Vec::new(),
            state_interval_us: None,
            next_state_us: 0,
        }
    }

    /// Handles a frame; `shown_us` is the time of the latest step that was sent, µs. Appends replies to `reply` and events to
    /// `events`.
    pub(super) fn take(
        &mut self,
        frame: &Frame,
        shown_us: u64,
        outputs: &OutputMap,
        counts: &mut Summary,
        reply: &mut Vec<u8>,
        events: &mut Vec<Px4Event>,
    ) {
        if frame.version == Version::One {
            counts.foreign_frames += 1;
            self.refuse(OLD_PROTOCOL, events);
        } else if let Some(message) = frame.decode::<HilActuatorControls>() {
            match Actuation::read(outputs, &message) {
                Some(actuation) => self.actuate(actuation, shown_us, counts, events),
                None => counts.unusable_answers += 1,
            }
        } else if let Some(beat) = frame.decode::<Heartbeat>() {
            if beat.mavlink_version != DIALECT {
                self.refuse(OTHER_DIALECT, events);
            }
            if beat.autopilot != PX4 {
                self.refuse(OTHER_STACK, events);
            }
        } else if let Some(command) = frame.decode::<CommandLong>() {
            let ack = self.obey(frame, &command);
            self.encoder.encode(&ack, reply);
        } else {
            counts.foreign_frames += 1;
        }
    }

    fn refuse(&mut self, why: &'static str, events: &mut Vec<Px4Event>) {
        if !self.reported.contains(&why) {
            self.reported.push(why);
            events.push(Px4Event::Refused(why));
        }
    }

    fn actuate(
        &mut self,
        actuation: Actuation,
        shown_us: u64,
        counts: &mut Summary,
        events: &mut Vec<Px4Event>,
    ) {
        let before = self.clock;
        let answers = self.clock.judge(actuation.time_us, self.begun_us, shown_us);
        if before != self.clock && self.clock == Clock::Foreign {
            events.push(Px4Event::ForeignClock);
        }
        match answers {
            Answers::Nothing => {
                counts.wrong_answers += 1;
                return;
            }
            Answers::Present if self.answered => counts.repeated_answers += 1,
            Answers::Present => self.answered = true,
            Answers::Past if self.lockstep => {
                counts.stale_answers += 1;
                return;
            }
            Answers::Past => {}
        }
        if actuation.lockstep && !self.lockstep {
            self.lockstep = true;
            events.push(Px4Event::Lockstep);
        }
        counts.answers += 1;
        counts.limited_answers += u64::from(actuation.limited);
        self.last_actuation = Some(Instant::now());
        self.actuation = Some(actuation);
        if std::mem::take(&mut self.silent) {
            events.push(if self.lockstep { Px4Event::Resumed } else { Px4Event::SilenceEnded });
        }
    }

    /// Handles a command: PX4 sends here only the request for HIL_STATE_QUATERNION.
    fn obey(&mut self, frame: &Frame, command: &CommandLong) -> CommandAck {
        let interval_us = f64::from(command.param[1]);
        let known = command.command == SET_MESSAGE_INTERVAL
            && command.param[0] == HilStateQuaternion::ID as f32;
        if known {
            let longest = f64::from(i32::MAX);
            self.state_interval_us = (interval_us > 0.0).then_some(interval_us.min(longest) as u64);
        }
        CommandAck {
            command: command.command,
            // MAV_RESULT_ACCEPTED and MAV_RESULT_UNSUPPORTED.
            result: if known { 0 } else { 3 },
            target_system: frame.system,
            target_component: frame.component,
            ..CommandAck::default()
        }
    }

    /// Whether HIL_STATE_QUATERNION is due; a period shorter than a step makes it due at every step.
    pub(super) fn wants_state(&mut self, now_us: u64) -> bool {
        let Some(interval) = self.state_interval_us.filter(|_| now_us >= self.next_state_us) else {
            return false;
        };
        self.next_state_us = (self.next_state_us + interval).max(now_us + 1);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_that_is_asked_for_once_in_forever_is_sent_once() {
        let ask = |interval_us: f32| {
            let mut param = [0.0; 7];
            (param[0], param[1]) = (HilStateQuaternion::ID as f32, interval_us);
            CommandLong { param, command: SET_MESSAGE_INTERVAL, ..CommandLong::default() }
        };
        let (mut bytes, mut frames) = (Vec::new(), Vec::new());
        Encoder::new(1, 1).encode(&ask(f32::INFINITY), &mut bytes);
        Parser::default().datagram(&bytes, &mut |frame| frames.push(frame));
        let mut client = Client::new(0);
        client.obey(&frames[0], &ask(4_000.0));
        assert!(client.wants_state(1_000_000_000) && client.wants_state(1_000_004_000));
        assert_eq!(client.obey(&frames[0], &ask(f32::INFINITY)).result, 0);
        assert!(client.wants_state(1_000_008_000) && !client.wants_state(1_000_012_000));
    }
}
