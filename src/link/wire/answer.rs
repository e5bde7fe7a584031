//! MAVLink messages that reply to requests of clients (ground stations and offboard programs).

use mavlink::dialects::ardupilotmega::{
    AUTOPILOT_VERSION_DATA, FILE_TRANSFER_PROTOCOL_DATA, HOME_POSITION_DATA, MESSAGE_INTERVAL_DATA,
    MavMessage, MavParamError, MavProtocolCapability, MavSeverity, PARAM_ERROR_DATA,
    STATUSTEXT_DATA, TIMESYNC_DATA,
};
use mavlink::types::CharArray;

use super::Message;
use super::request::ParameterName;
use super::telemetry::Home;
use crate::autopilot::{Parameter, ParameterValue, Severity};
use crate::framing::Source;
use greylag_physics::Time;

/// Largest number of characters of one STATUSTEXT message.
pub const TEXT_CHUNK: usize = 50;

/// The result of a command, MAV_RESULT.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CommandResult {
    /// The command was carried out.
    Accepted = 0,
    /// The command is refused in the present state.
    TemporarilyRejected = 1,
    /// The command is refused in any state.
    Denied = 2,
    /// The command is not supported.
    Unsupported = 3,
}

/// COMMAND_ACK to the sender of a command. It is encoded by hand, because rust-mavlink cannot represent an unknown
/// `number`.
pub fn command_ack(number: u16, result: CommandResult, to: Source) -> Message {
    let [low, high] = number.to_le_bytes();
    // command and result, then the extension fields: progress, result_param2, target system and component
    Message::raw(77, vec![low, high, result as u8, 0, 0, 0, 0, 0, to.system, to.component], 3)
}

/// PARAM_VALUE for one entry of the parameter table.
pub fn parameter_value(parameter: &Parameter, index: usize, count: usize) -> Message {
    // MAV_PARAM_TYPE: 6 is INT32, 9 is REAL32. Encoded by hand, so that no integer passes through a float.
    let (value, kind) = match parameter.value {
        ParameterValue::Real(x) => (x.to_le_bytes(), 9),
        ParameterValue::Int(n) => (n.to_le_bytes(), 6),
    };
    let mut payload = value.to_vec();
    payload.extend((count as u16).to_le_bytes());
    payload.extend((index as u16).to_le_bytes());
    payload.extend((0..16).map(|i| parameter.name.as_bytes().get(i).copied().unwrap_or(0)));
    payload.push(kind);
    Message::raw(22, payload, 25)
}

/// Reason why a parameter request failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterFault {
    /// The name or index does not exist.
    DoesNotExist,
    /// The value is out of range.
    OutOfRange,
    /// The type differs from the type in the table.
    TypeMismatch,
}

/// PARAM_ERROR about a parameter. `index` is −1 if the parameter was requested by name.
pub fn parameter_error(
    name: ParameterName,
    index: i16,
    fault: ParameterFault,
    to: Source,
) -> Message {
    let error = match fault {
        ParameterFault::DoesNotExist => MavParamError::MAV_PARAM_ERROR_DOES_NOT_EXIST,
        ParameterFault::OutOfRange => MavParamError::MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE,
        ParameterFault::TypeMismatch => MavParamError::MAV_PARAM_ERROR_TYPE_MISMATCH,
    };
    Message::coded(MavMessage::PARAM_ERROR(PARAM_ERROR_DATA {
        param_index: index,
        target_system: to.system,
        target_component: to.component,
        param_id: CharArray::new(name.0),
        error,
    }))
}

/// STATUSTEXT messages that together carry `words`, in chunks that share `id`.
///
/// MAVLink 1 has no fields for the id and the number of a chunk. Each chunk is then a separate text. Characters outside
/// ASCII become `?`, because receivers differ in their encoding.
pub fn texts(severity: Severity, words: &str, id: u16) -> Vec<Message> {
    let bytes: Vec<u8> =
        words.chars().map(|c| if c.is_ascii() && c != '\0' { c as u8 } else { b'?' }).collect();
    if bytes.len() <= TEXT_CHUNK {
        return vec![text(severity, &bytes, 0, 0)];
    }
    // A chunk shorter than the field ends the text. A text that fills its last chunk is followed by an empty chunk.
    let ender = bytes.len().is_multiple_of(TEXT_CHUNK).then_some(&[][..]);
    bytes
        .chunks(TEXT_CHUNK)
        .chain(ender)
        .take(256)
        .enumerate()
        .map(|(seq, chunk)| text(severity, chunk, id, seq as u8))
        .collect()
}

fn text(severity: Severity, chunk: &[u8], id: u16, chunk_seq: u8) -> Message {
    let mut field = [0; TEXT_CHUNK];
    field[..chunk.len()].copy_from_slice(chunk);
    let severity = match severity {
        Severity::Critical => MavSeverity::MAV_SEVERITY_CRITICAL,
        Severity::Error => MavSeverity::MAV_SEVERITY_ERROR,
        Severity::Warning => MavSeverity::MAV_SEVERITY_WARNING,
        Severity::Notice => MavSeverity::MAV_SEVERITY_NOTICE,
        Severity::Info => MavSeverity::MAV_SEVERITY_INFO,
    };
    Message::coded(MavMessage::STATUSTEXT(STATUSTEXT_DATA {
        severity,
        text: CharArray::new(field),
        id,
        chunk_seq,
    }))
}

/// AUTOPILOT_VERSION with this program's capabilities.
pub fn autopilot_version() -> Message {
    Message::coded(MavMessage::AUTOPILOT_VERSION(AUTOPILOT_VERSION_DATA {
        capabilities: MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_MAVLINK2
            | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_COMMAND_INT
            | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_SET_ATTITUDE_TARGET
            | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE,
        uid: 1,
        flight_sw_version: software_version(env!("CARGO_PKG_VERSION")),
        ..AUTOPILOT_VERSION_DATA::DEFAULT
    }))
}

/// Packs major, minor and patch into the upper three bytes. The lowest byte is 0 for a development version.
fn software_version(text: &str) -> u32 {
    let part = |part: &str| part.parse::<u8>().map_or(0, u32::from);
    text.split(['.', '-']).take(3).map(part).fold(0, |sum, p| sum << 8 | p) << 8
}

/// PROTOCOL_VERSION: MAVLink 1 and 2 are supported, 2 is preferred.
pub fn protocol_version() -> Message {
    let mut payload = vec![0; 22];
    for (field, version) in payload.chunks_mut(2).zip([200u16, 100, 200]) {
        field.copy_from_slice(&version.to_le_bytes());
    }
    Message::raw(300, payload, 22)
}

/// MESSAGE_INTERVAL: µs between messages; −1 if the message is off, 0 if it is not available.
pub fn message_interval(id: u32, interval_us: i32) -> Message {
    Message::coded(MavMessage::MESSAGE_INTERVAL(MESSAGE_INTERVAL_DATA {
        interval_us,
        message_id: id as u16,
    }))
}

/// HOME_POSITION: latitude and longitude in 1e-7°, altitude above mean sea level in mm.
pub fn home_position(home: Home, now: Time) -> Message {
    Message::coded(MavMessage::HOME_POSITION(HOME_POSITION_DATA {
        latitude: (home.position[0] * 1e7).round() as i32,
        longitude: (home.position[1] * 1e7).round() as i32,
        altitude: (home.altitude * 1e3).round() as i32,
        q: [1.0, 0.0, 0.0, 0.0],
        time_usec: now.as_micros(),
        ..HOME_POSITION_DATA::DEFAULT
    }))
}

/// MISSION_COUNT of 0 items for the mission type `kind`.
pub fn empty_mission(kind: u8, to: Source) -> Message {
    Message::raw(44, vec![0, 0, to.system, to.component, kind, 0, 0, 0, 0], 4)
}

/// The result of a step of the mission protocol, MAV_MISSION_RESULT.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MissionResult {
    /// The step was carried out.
    Accepted = 0,
    /// Missions are not supported.
    Unsupported = 3,
    /// The item does not exist.
    InvalidSequence = 13,
}

/// MISSION_ACK for the mission type `kind`.
pub fn mission_ack(result: MissionResult, kind: u8, to: Source) -> Message {
    Message::raw(47, vec![to.system, to.component, result as u8, kind, 0, 0, 0, 0], 3)
}

/// Refusal of a request of the file-transfer protocol: NAK with "unknown command", because there are no files.
pub fn file_nak(sequence: u16, session: u8, opcode: u8, to: Source) -> Message {
    const NAK: u8 = 129;
    const UNKNOWN_COMMAND: u8 = 7;
    let mut payload = [0; 251];
    payload[..2].copy_from_slice(&sequence.wrapping_add(1).to_le_bytes());
    // session, opcode, size and opcode of the request; the data start at byte 12
    payload[2..6].copy_from_slice(&[session, NAK, 1, opcode]);
    payload[12] = UNKNOWN_COMMAND;
    Message::coded(MavMessage::FILE_TRANSFER_PROTOCOL(FILE_TRANSFER_PROTOCOL_DATA {
        target_network: 0,
        target_system: to.system,
        target_component: to.component,
        payload,
    }))
}

/// TIMESYNC reply with the time of this program and the time of the request, both in ns.
pub fn time_sync(theirs: i64, now: Time, to: Source) -> Message {
    // a reply with a time of zero would count as a request
    let ours = i64::try_from(now.as_micros().saturating_mul(1000)).unwrap_or(i64::MAX).max(1);
    Message::coded(MavMessage::TIMESYNC(TIMESYNC_DATA {
        tc1: ours,
        ts1: theirs,
        target_system: to.system,
        target_component: to.component,
    }))
}

/// PING reply with the request's time and sequence number, addressed to its sender.
pub fn ping(time_usec: u64, sequence: u32, to: Source) -> Message {
    let mut payload = time_usec.to_le_bytes().to_vec();
    payload.extend(sequence.to_le_bytes());
    payload.extend([to.system, to.component]);
    Message::raw(4, payload, 14)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_version_is_packed_as_the_field_says() {
        // FLIGHT_SW_VERSION: (major << 24) | (minor << 16) | (patch << 8) | type.
        assert_eq!(software_version("1.2.3"), 0x0102_0300);
        assert_eq!(software_version("0.1.0"), 0x0001_0000);
    }

    #[test]
    fn a_text_of_exactly_two_chunks_is_closed_by_an_empty_one() {
        assert_eq!(texts(Severity::Info, &"x".repeat(50), 1).len(), 1);
        assert_eq!(texts(Severity::Info, &"x".repeat(51), 1).len(), 2);
        assert_eq!(texts(Severity::Info, &"x".repeat(100), 1).len(), 3);
    }
}
