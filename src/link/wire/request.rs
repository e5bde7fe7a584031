//! Requests of clients (ground stations and offboard programs), decoded from MAVLink frames.

use mavlink::dialects::ardupilotmega::MavMessage;

use super::fields::Fields;
use super::setpoint::{self, SetpointFault};
use super::{Frame, decode};
use crate::autopilot::{AttitudeSetpoint, ParameterValue, Sticks};

/// System and component to which a message is addressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Recipient {
    /// System id; 0 for all systems.
    pub system: u8,
    /// Component id; 0 for all components.
    pub component: u8,
}

/// A parameter's name as sent: up to 16 bytes. A shorter name ends with a zero byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ParameterName(pub [u8; 16]);

impl ParameterName {
    /// The bytes before the first zero.
    pub fn bytes(&self) -> &[u8] {
        self.0.split(|b| *b == 0).next().unwrap_or(&[])
    }
}

/// Key of a requested parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterKey {
    /// Index in the parameter table, which may not exist.
    Index(usize),
    /// Name of the parameter.
    Name(ParameterName),
}

/// A command from COMMAND_LONG or COMMAND_INT. Its number may be unknown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CommandRequest {
    /// Number of the MAV_CMD.
    pub number: u16,
    /// Parameters 1 to 7. Parameters that a command does not use are often NaN.
    pub params: [f64; 7],
    /// Number of retransmissions: 0 on the first transmission.
    pub confirmation: u8,
}

/// Steps of the mission protocol to which this program replies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MissionStep {
    /// Request for the number of items.
    List,
    /// Request for an item.
    Item,
    /// Offer of items to upload, or an uploaded item.
    Upload,
    /// Request to delete all items.
    Clear,
}

/// A decoded request of a client.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Request {
    /// COMMAND_LONG or COMMAND_INT.
    Command(CommandRequest),
    /// SET_MODE: base mode and custom mode.
    SetMode { base: u8, custom: u32 },
    /// SET_ATTITUDE_TARGET, or the reason for which it is invalid.
    Attitude(Result<AttitudeSetpoint, SetpointFault>),
    /// A setpoint of an unsupported kind (position, velocity, raw actuators).
    OtherSetpoint,
    /// MANUAL_CONTROL; `None` if an axis is marked as invalid.
    Sticks(Option<Sticks>),
    /// Request for the whole table, PARAM_REQUEST_LIST.
    ParameterList,
    /// PARAM_REQUEST_READ by index or name.
    ParameterRead(ParameterKey),
    /// PARAM_SET. The value is `None` if its type is neither INT32 nor REAL32.
    ParameterSet { name: ParameterName, value: Option<ParameterValue> },
    /// A mission message with its MAV_MISSION_TYPE.
    Mission { step: MissionStep, kind: u8 },
    /// FILE_TRANSFER_PROTOCOL: sequence number, session and opcode.
    File { sequence: u16, session: u8, opcode: u8 },
    /// TIMESYNC request with the client's time, ns.
    TimeSync { theirs: i64 },
    /// PING with the sender's time (µs) and sequence number.
    Ping { time_usec: u64, sequence: u32 },
    /// REQUEST_DATA_STREAM: the group and its rate in Hz (0: default rates); `None` stops the group.
    DataStream { group: u8, rate: Option<u16> },
}

/// Decodes a frame into its target and request; `None` for other messages.
pub fn read(frame: &Frame<'_>) -> Option<(Recipient, Request)> {
    let fields = Fields(frame.payload);
    let at =
        |offset: usize| Recipient { system: fields.u8(offset), component: fields.u8(offset + 1) };
    let found = match frame.id {
        76 => (at(30), Request::Command(command_long(fields))),
        75 => (at(30), Request::Command(command_int(fields))),
        11 => {
            let to = Recipient { system: fields.u8(4), component: 0 };
            (to, Request::SetMode { base: fields.u8(5), custom: fields.u32(0) })
        }
        // a PING request is broadcast (0/0), a reply has one target
        4 if fields.bytes(12) == [0, 0] => {
            (at(12), Request::Ping { time_usec: fields.u64(0), sequence: fields.u32(8) })
        }
        23 => (at(4), parameter_set(fields)),
        66 => (at(2), data_stream(fields)),
        43 => (at(0), mission(MissionStep::List, fields.u8(2))),
        44 => (at(2), mission(MissionStep::Upload, fields.u8(4))),
        45 => (at(0), mission(MissionStep::Clear, fields.u8(2))),
        40 | 51 => (at(2), mission(MissionStep::Item, fields.u8(4))),
        38 => (at(4), mission(MissionStep::Upload, fields.u8(6))),
        39 | 73 => (at(32), mission(MissionStep::Upload, fields.u8(37))),
        // SET_POSITION_TARGET_LOCAL_NED, SET_POSITION_TARGET_GLOBAL_INT, SET_ACTUATOR_CONTROL_TARGET.
        84 => (at(50), Request::OtherSetpoint),
        86 => (at(50), Request::OtherSetpoint),
        139 => (at(41), Request::OtherSetpoint),
        _ => return coded(decode(frame)?),
    };
    Some(found)
}

/// Converts messages that rust-mavlink has decoded. Messages with enumeration fields are decoded by hand in `read`, because
/// rust-mavlink rejects unknown enumeration values.
fn coded(message: MavMessage) -> Option<(Recipient, Request)> {
    let to = |system: u8, component: u8| Recipient { system, component };
    Some(match message {
        MavMessage::SET_ATTITUDE_TARGET(m) => {
            (to(m.target_system, m.target_component), Request::Attitude(setpoint::attitude(&m)))
        }
        MavMessage::MANUAL_CONTROL(m) => (to(m.target, 0), Request::Sticks(setpoint::sticks(&m))),
        MavMessage::PARAM_REQUEST_LIST(m) => {
            (to(m.target_system, m.target_component), Request::ParameterList)
        }
        MavMessage::PARAM_REQUEST_READ(m) => {
            let key = match usize::try_from(m.param_index) {
                Ok(index) => ParameterKey::Index(index),
                Err(_) => ParameterKey::Name(ParameterName(*m.param_id)),
            };
            (to(m.target_system, m.target_component), Request::ParameterRead(key))
        }
        MavMessage::FILE_TRANSFER_PROTOCOL(m) => {
            let body = Fields(&m.payload);
            let file =
                Request::File { sequence: body.u16(0), session: body.u8(2), opcode: body.u8(3) };
            (to(m.target_system, m.target_component), file)
        }
        // a reply contains a time in tc1, a request contains zero
        MavMessage::TIMESYNC(m) if m.tc1 == 0 => {
            (to(m.target_system, m.target_component), Request::TimeSync { theirs: m.ts1 })
        }
        _ => return None,
    })
}

fn command_long(fields: Fields<'_>) -> CommandRequest {
    CommandRequest {
        number: fields.u16(28),
        params: std::array::from_fn(|i| f64::from(fields.f32(4 * i))),
        confirmation: fields.u8(32),
    }
}

fn command_int(fields: Fields<'_>) -> CommandRequest {
    let real = |offset: usize| f64::from(fields.f32(offset));
    let whole = |offset: usize| f64::from(fields.i32(offset));
    CommandRequest {
        number: fields.u16(28),
        params: [real(0), real(4), real(8), real(12), whole(16), whole(20), real(24)],
        confirmation: 0,
    }
}

fn parameter_set(fields: Fields<'_>) -> Request {
    // MAV_PARAM_TYPE: 6 is INT32, sent bytewise in the float field; 9 is REAL32.
    let value = match fields.u8(22) {
        6 => Some(ParameterValue::Int(fields.i32(0))),
        9 => Some(ParameterValue::Real(fields.f32(0))),
        _ => None,
    };
    Request::ParameterSet { name: ParameterName(fields.bytes(6)), value }
}

fn data_stream(fields: Fields<'_>) -> Request {
    let rate = (fields.u8(5) != 0).then_some(fields.u16(0));
    Request::DataStream { group: fields.u8(4), rate }
}

fn mission(step: MissionStep, kind: u8) -> Request {
    Request::Mission { step, kind }
}
