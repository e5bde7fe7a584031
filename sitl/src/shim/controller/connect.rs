//! Answers the requests that a ground station sends when it connects to a flight controller.

use super::modes::Mode;
use super::{FlightController, Personality, SYSTEM};
use crate::shim::codec::{
    AutopilotVersion, AvailableModes, FileTransferProtocol, Frame, HomePosition, Message,
    MessageInterval, MissionAck, MissionClearAll, MissionCount, MissionRequest, MissionRequestInt,
    MissionRequestList, ProtocolVersion,
};

/// Values of MAV_RESULT: accepted, denied, unsupported.
const ACCEPTED: u8 = 0;
const DENIED: u8 = 2;
const UNSUPPORTED: u8 = 3;
/// Values of MAV_MISSION_RESULT: accepted, unsupported, invalid sequence.
const MISSION_ACCEPTED: u8 = 0;
const MISSION_UNSUPPORTED: u8 = 3;
const MISSION_INVALID_SEQUENCE: u8 = 13;

/// MAV_PROTOCOL_CAPABILITY bits of both simulated stacks: MISSION_INT, SET_ATTITUDE_TARGET, MAVLINK2, MISSION_FENCE,
/// MISSION_RALLY. Their lists of missions, fences and rally points are always empty.
const CAPABILITIES: u64 = 1 << 2 | 1 << 6 | 1 << 13 | 1 << 14 | 1 << 15;
/// MAV_PROTOCOL_CAPABILITY bits of the encoding of integer parameters: PARAM_ENCODE_BYTEWISE, PARAM_ENCODE_C_CAST.
const BYTEWISE: u64 = 1 << 4;
const CAST: u64 = 1 << 17;
/// Versions of the simulated stacks, encoded as FLIGHT_SW_VERSION: releases 1.15.0 and 4.6.0.
const PX4_VERSION: u32 = 0x010F_00FF;
const ARDUPILOT_VERSION: u32 = 0x0406_00FF;

/// A message that is sent on request, with the index of the mode or message that the request names.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Requested {
    id: u32,
    index: f32,
}

/// The message that a command requests; `None` if the command requests no message.
pub(super) fn requested(command: u16, param: &[f32; 7]) -> Option<Requested> {
    let index = param[0];
    match command {
        // REQUEST_MESSAGE and the commands that it replaced: GET_HOME_POSITION, GET_MESSAGE_INTERVAL, REQUEST_PROTOCOL_VERSION,
        // REQUEST_AUTOPILOT_CAPABILITIES.
        512 => Some(Requested { id: param[0] as u32, index: param[1] }),
        410 => Some(Requested { id: HomePosition::ID, index }),
        510 => Some(Requested { id: MessageInterval::ID, index }),
        519 => Some(Requested { id: ProtocolVersion::ID, index }),
        520 => Some(Requested { id: AutopilotVersion::ID, index }),
        _ => None,
    }
}

impl FlightController {
    /// MAV_RESULT of a request for a message.
    pub(super) fn grants(&self, requested: Requested) -> u8 {
        match requested.id {
            AvailableModes::ID if requested.index > Mode::ALL.len() as f32 => DENIED,
            AvailableModes::ID | AutopilotVersion::ID | ProtocolVersion::ID => ACCEPTED,
            MessageInterval::ID => ACCEPTED,
            HomePosition::ID => match self.home {
                Some(_) => ACCEPTED,
                None => DENIED,
            },
            id if self.streams.knows(id) => ACCEPTED,
            _ => UNSUPPORTED,
        }
    }

    /// Sends a message that `grants` has accepted.
    pub(super) fn send_requested(&mut self, Requested { id, index }: Requested) {
        let out = &mut self.waiting;
        match id {
            AutopilotVersion::ID => {
                let (encoding, flight_sw_version) = match self.personality {
                    Personality::Px4 => (BYTEWISE, PX4_VERSION),
                    Personality::Ardupilot => (CAST, ARDUPILOT_VERSION),
                };
                let capabilities = CAPABILITIES | encoding;
                let message = AutopilotVersion {
                    capabilities,
                    uid: 1,
                    flight_sw_version,
                    ..Default::default()
                };
                self.encoder.encode(&message, out);
            }
            ProtocolVersion::ID => {
                let message = ProtocolVersion {
                    version: 200,
                    min_version: 100,
                    max_version: 200,
                    ..Default::default()
                };
                self.encoder.encode(&message, out);
            }
            AvailableModes::ID => {
                // Index 0 requests all modes; modes are counted from 1.
                let wanted = |at: usize| index < 1.0 || index as usize == at + 1;
                for (at, mode) in Mode::ALL.into_iter().enumerate().filter(|(at, _)| wanted(*at)) {
                    let message = mode.available(self.personality, at);
                    self.encoder.encode(&message, out);
                }
            }
            MessageInterval::ID => {
                let interval_us = self.streams.interval_us(index as u32);
                let message = MessageInterval { interval_us, message_id: index as u16 };
                self.encoder.encode(&message, out);
            }
            HomePosition::ID => {
                let Some((latitude_deg, longitude_deg)) = self.home else { return };
                let message = HomePosition {
                    latitude: (latitude_deg * 1e7).round() as i32,
                    longitude: (longitude_deg * 1e7).round() as i32,
                    altitude: (self.flight.home_m() * 1e3).round() as i32,
                    q: [1.0, 0.0, 0.0, 0.0],
                    time_usec: self.now_us,
                    ..Default::default()
                };
                self.encoder.encode(&message, out);
            }
            _ => {
                let (now, home) = (self.now_us, self.flight.home_m());
                self.streams.send_once(id, now, &self.measured, home, &mut self.encoder, out);
            }
        }
    }

    /// Answers an FTP request with NAK, "unknown command": the simulated controller has no files.
    pub(super) fn refuse_file(&mut self, frame: &Frame, m: &FileTransferProtocol) {
        const ACK: u8 = 128;
        const NAK: u8 = 129;
        const UNKNOWN_COMMAND: u8 = 7;
        let [low, high, session, opcode, ..] = m.payload[0];
        // ACK and NAK are answers, which get no answer.
        if matches!(opcode, ACK | NAK) {
            return;
        }
        let [low, high] = u16::from_le_bytes([low, high]).wrapping_add(1).to_le_bytes();
        let mut payload = [[0; 32]; 7];
        payload[0][..6].copy_from_slice(&[low, high, session, NAK, 1, opcode]);
        payload[0][12] = UNKNOWN_COMMAND;
        let answer = FileTransferProtocol {
            target_system: frame.system,
            target_component: frame.component,
            payload,
            ..FileTransferProtocol::default()
        };
        self.encoder.encode(&answer, &mut self.waiting);
    }

    /// Answers the mission protocol as a controller without mission, fence or rally points that accepts none. Returns whether the
    /// frame belongs to the mission protocol.
    pub(super) fn mission(&mut self, frame: &Frame) -> bool {
        let ours = |system: u8, component: u8| system == SYSTEM && matches!(component, 0 | 1);
        let (target, mission_type, result) = if let Some(m) = frame.decode::<MissionRequestList>() {
            if ours(m.target_system, m.target_component) {
                let count = MissionCount {
                    count: 0,
                    target_system: frame.system,
                    target_component: frame.component,
                    mission_type: m.mission_type,
                };
                self.encoder.encode(&count, &mut self.waiting);
            }
            return true;
        } else if let Some(m) = frame.decode::<MissionClearAll>() {
            ((m.target_system, m.target_component), m.mission_type, MISSION_ACCEPTED)
        } else if let Some(m) = frame.decode::<MissionCount>() {
            ((m.target_system, m.target_component), m.mission_type, MISSION_UNSUPPORTED)
        } else if let Some(m) = frame.decode::<MissionRequestInt>() {
            ((m.target_system, m.target_component), m.mission_type, MISSION_INVALID_SEQUENCE)
        } else if let Some(m) = frame.decode::<MissionRequest>() {
            ((m.target_system, m.target_component), m.mission_type, MISSION_INVALID_SEQUENCE)
        } else {
            return false;
        };
        if ours(target.0, target.1) {
            let ack = MissionAck {
                target_system: frame.system,
                target_component: frame.component,
                result,
                mission_type,
            };
            self.encoder.encode(&ack, &mut self.waiting);
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::{PlantOptions, Start};
    use crate::shim::ShimOptions;
    use crate::shim::codec::{Encoder, Parser, TimeSync};

    /// The microseconds of a late clock fit into 64 bits, its nanoseconds do not.
    #[test]
    fn a_clock_of_three_hundred_years_answers_a_time_request() {
        let options = ShimOptions {
            clock_start_s: 1e10,
            ..ShimOptions::new(PlantOptions::default(), Start::NEUTRAL)
        };
        let mut controller = FlightController::new(Personality::Px4, &options).unwrap();
        let (mut request, mut out) = (Vec::new(), Vec::new());
        Encoder::new(255, 190).encode(&TimeSync { ts1: 7, ..TimeSync::default() }, &mut request);
        controller.show(&mut out);
        controller.receive(&request);
        out.clear();
        controller.show(&mut out);
        let mut answer: Option<TimeSync> = None;
        Parser::default()
            .datagram(&out, &mut |frame| answer = answer.or(frame.decode::<TimeSync>()));
        assert_eq!(answer.map(|m| (m.tc1, m.ts1)), Some((i64::MAX, 7)));
    }
}
