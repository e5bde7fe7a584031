//! Decodes the MAVLink messages of a telemetry log into named numbers, in the units of MAVLink.

use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::{self as messages, MavMessage};

use super::controller::bytewise;
use super::fields::Fields;
use super::{Frame, decode};

/// Timestamp that a message contains.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Own {
    /// Milliseconds since the sender started, modulo 2³².
    BootMs(u32),
    /// Microseconds since the sender started, or since 1970, depending on the sender. In SERVO_OUTPUT_RAW they are modulo 2³².
    Micros(u64),
    /// The message has no timestamp.
    None,
}

/// A message as a list of named numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Values {
    /// Name of the message.
    pub topic: &'static str,
    /// Timestamp that the message contains.
    pub own: Own,
    /// Names of the fields, in the order of `values`.
    pub fields: &'static [&'static str],
    /// Values of the fields in the units of MAVLink. Only as many are used as there are names in `fields`.
    pub values: [f64; 16],
}

/// A decoded message.
#[derive(Clone, Debug, PartialEq)]
pub enum Logged {
    /// A message with states, commands or the status of the vehicle.
    Values(Values),
    /// A parameter from PARAM_VALUE.
    Parameter {
        /// Name of the parameter.
        name: String,
        /// Value of the parameter, unless the sender is PX4.
        value: f64,
        /// Value of a parameter of PX4, which sends the bytes of an integer in place of a float.
        bytewise: f64,
    },
}

/// Field names of HIL_ACTUATOR_CONTROLS, of ACTUATOR_OUTPUT_STATUS and of SERVO_OUTPUT_RAW.
const CONTROLS: [&str; 4] = ["controls0", "controls1", "controls2", "controls3"];
const ACTUATORS: [&str; 16] = [
    "actuator0",
    "actuator1",
    "actuator2",
    "actuator3",
    "actuator4",
    "actuator5",
    "actuator6",
    "actuator7",
    "actuator8",
    "actuator9",
    "actuator10",
    "actuator11",
    "actuator12",
    "actuator13",
    "actuator14",
    "active",
];
const SERVOS: [&str; 16] = [
    "servo1_raw",
    "servo2_raw",
    "servo3_raw",
    "servo4_raw",
    "servo5_raw",
    "servo6_raw",
    "servo7_raw",
    "servo8_raw",
    "servo9_raw",
    "servo10_raw",
    "servo11_raw",
    "servo12_raw",
    "servo13_raw",
    "servo14_raw",
    "servo15_raw",
    "servo16_raw",
];

/// Ids of the messages that rust-mavlink decodes.
const READ: [u32; 14] = [
    messages::ATTITUDE_QUATERNION_DATA::ID,
    messages::ATTITUDE_DATA::ID,
    messages::HIGHRES_IMU_DATA::ID,
    messages::RAW_IMU_DATA::ID,
    messages::SCALED_IMU_DATA::ID,
    messages::SCALED_PRESSURE_DATA::ID,
    messages::VFR_HUD_DATA::ID,
    messages::AOA_SSA_DATA::ID,
    messages::ACTUATOR_OUTPUT_STATUS_DATA::ID,
    messages::HIL_ACTUATOR_CONTROLS_DATA::ID,
    messages::SERVO_OUTPUT_RAW_DATA::ID,
    messages::GLOBAL_POSITION_INT_DATA::ID,
    messages::LOCAL_POSITION_NED_DATA::ID,
    messages::WIND_COV_DATA::ID,
];

/// Decodes a frame; `None` for a message that no reader of logs uses.
pub fn read(frame: &Frame<'_>) -> Option<Logged> {
    let fields = Fields(frame.payload);
    match frame.id {
        // Decoded by byte offset, because rust-mavlink rejects enumeration values that later releases of MAVLink added.
        messages::PARAM_VALUE_DATA::ID => Some(parameter(fields)),
        messages::HEARTBEAT_DATA::ID => Some(Logged::Values(heartbeat(fields))),
        messages::EXTENDED_SYS_STATE_DATA::ID => Some(Logged::Values(extended_state(fields))),
        // the id is checked before decoding, because most messages of a log are not used and decoding is slow
        id => READ.contains(&id).then(|| decode(frame)).flatten().and_then(logged),
    }
}

fn parameter(fields: Fields<'_>) -> Logged {
    let name: Vec<u8> = fields.bytes::<16>(8).into_iter().take_while(|b| *b != 0).collect();
    let value = fields.f32(0);
    Logged::Parameter {
        name: String::from_utf8(name).unwrap_or_default(),
        value: f64::from(value),
        bytewise: bytewise(value, fields.u8(24)),
    }
}

fn heartbeat(fields: Fields<'_>) -> Values {
    values(
        "HEARTBEAT",
        Own::None,
        &["type", "autopilot", "custom_mode"],
        &[f64::from(fields.u8(4)), f64::from(fields.u8(5)), f64::from(fields.u32(0))],
    )
}

fn extended_state(fields: Fields<'_>) -> Values {
    values(
        "EXTENDED_SYS_STATE",
        Own::None,
        &["vtol_state", "landed_state"],
        &[f64::from(fields.u8(0)), f64::from(fields.u8(1))],
    )
}

fn logged(message: MavMessage) -> Option<Logged> {
    Some(Logged::Values(match message {
        MavMessage::ATTITUDE_QUATERNION(m) => floats(
            "ATTITUDE_QUATERNION",
            Own::BootMs(m.time_boot_ms),
            &["q1", "q2", "q3", "q4", "rollspeed", "pitchspeed", "yawspeed"],
            &[m.q1, m.q2, m.q3, m.q4, m.rollspeed, m.pitchspeed, m.yawspeed],
        ),
        MavMessage::ATTITUDE(m) => floats(
            "ATTITUDE",
            Own::BootMs(m.time_boot_ms),
            &["roll", "pitch", "yaw", "rollspeed", "pitchspeed", "yawspeed"],
            &[m.roll, m.pitch, m.yaw, m.rollspeed, m.pitchspeed, m.yawspeed],
        ),
        MavMessage::HIGHRES_IMU(m) => floats(
            "HIGHRES_IMU",
            Own::Micros(m.time_usec),
            &[
                "xacc",
                "yacc",
                "zacc",
                "xgyro",
                "ygyro",
                "zgyro",
                "abs_pressure",
                "pressure_alt",
                "temperature",
            ],
            &[
                m.xacc,
                m.yacc,
                m.zacc,
                m.xgyro,
                m.ygyro,
                m.zgyro,
                m.abs_pressure,
                m.pressure_alt,
                m.temperature,
            ],
        ),
        MavMessage::RAW_IMU(m) => values(
            "RAW_IMU",
            Own::Micros(m.time_usec),
            &["xacc", "yacc", "zacc", "xgyro", "ygyro", "zgyro"],
            &[m.xacc, m.yacc, m.zacc, m.xgyro, m.ygyro, m.zgyro].map(f64::from),
        ),
        MavMessage::SCALED_IMU(m) => values(
            "SCALED_IMU",
            Own::BootMs(m.time_boot_ms),
            &["xacc", "yacc", "zacc", "xgyro", "ygyro", "zgyro"],
            &[m.xacc, m.yacc, m.zacc, m.xgyro, m.ygyro, m.zgyro].map(f64::from),
        ),
        MavMessage::SCALED_PRESSURE(m) => values(
            "SCALED_PRESSURE",
            Own::BootMs(m.time_boot_ms),
            &["press_abs", "temperature"],
            &[f64::from(m.press_abs), f64::from(m.temperature)],
        ),
        MavMessage::VFR_HUD(m) => values(
            "VFR_HUD",
            Own::None,
            &["airspeed", "groundspeed", "alt", "climb", "throttle"],
            &[
                f64::from(m.airspeed),
                f64::from(m.groundspeed),
                f64::from(m.alt),
                f64::from(m.climb),
                f64::from(m.throttle),
            ],
        ),
        MavMessage::AOA_SSA(m) => {
            floats("AOA_SSA", Own::Micros(m.time_usec), &["AOA", "SSA"], &[m.AOA, m.SSA])
        }
        MavMessage::ACTUATOR_OUTPUT_STATUS(m) => {
            let mut numbers = [0.0; ACTUATORS.len()];
            let last = numbers.len() - 1;
            numbers[..last].copy_from_slice(&m.actuator[..last]);
            numbers[last] = m.active as f32;
            floats("ACTUATOR_OUTPUT_STATUS", Own::Micros(m.time_usec), &ACTUATORS, &numbers)
        }
        MavMessage::HIL_ACTUATOR_CONTROLS(m) => floats(
            "HIL_ACTUATOR_CONTROLS",
            Own::Micros(m.time_usec),
            &CONTROLS,
            &m.controls[..CONTROLS.len()],
        ),
        MavMessage::SERVO_OUTPUT_RAW(m) => values(
            "SERVO_OUTPUT_RAW",
            Own::Micros(u64::from(m.time_usec)),
            &SERVOS,
            &[
                m.servo1_raw,
                m.servo2_raw,
                m.servo3_raw,
                m.servo4_raw,
                m.servo5_raw,
                m.servo6_raw,
                m.servo7_raw,
                m.servo8_raw,
                m.servo9_raw,
                m.servo10_raw,
                m.servo11_raw,
                m.servo12_raw,
                m.servo13_raw,
                m.servo14_raw,
                m.servo15_raw,
                m.servo16_raw,
            ]
            .map(f64::from),
        ),
        MavMessage::GLOBAL_POSITION_INT(m) => values(
            "GLOBAL_POSITION_INT",
            Own::BootMs(m.time_boot_ms),
            &["vx", "vy", "vz", "alt"],
            &[f64::from(m.vx), f64::from(m.vy), f64::from(m.vz), f64::from(m.alt)],
        ),
        MavMessage::LOCAL_POSITION_NED(m) => floats(
            "LOCAL_POSITION_NED",
            Own::BootMs(m.time_boot_ms),
            &["vx", "vy", "vz"],
            &[m.vx, m.vy, m.vz],
        ),
        MavMessage::WIND_COV(m) => floats(
            "WIND_COV",
            Own::Micros(m.time_usec),
            &["wind_x", "wind_y", "wind_z"],
            &[m.wind_x, m.wind_y, m.wind_z],
        ),
        _ => return None,
    }))
}

fn floats(
    topic: &'static str,
    own: Own,
    fields: &'static [&'static str],
    numbers: &[f32],
) -> Values {
    let mut wide = [f64::NAN; 16];
    wide.iter_mut().zip(numbers).for_each(|(to, x)| *to = f64::from(*x));
    Values { topic, own, fields, values: wide }
}

fn values(
    topic: &'static str,
    own: Own,
    fields: &'static [&'static str],
    numbers: &[f64],
) -> Values {
    let mut wide = [f64::NAN; 16];
    wide.iter_mut().zip(numbers).for_each(|(to, x)| *to = *x);
    Values { topic, own, fields, values: wide }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_messages_that_are_decoded_are_those_that_are_used() {
        use mavlink::Message as _;
        for id in 0..70_000 {
            let used = MavMessage::default_message_from_id(id).and_then(logged).is_some();
            assert_eq!(used, READ.contains(&id), "{id}");
        }
    }

    /// What is read of a frame of MAVLink 2 with this payload.
    fn of_payload(id: u32, payload: &[u8]) -> Option<Logged> {
        let source = crate::framing::Source { system: 1, component: 1 };
        let version = crate::framing::Version::V2;
        read(&Frame { version, sequence: 0, source, id, payload, signed: false, bytes: &[] })
    }

    fn of_message(message: &MavMessage) -> Values {
        use mavlink::{MavlinkVersion, Message as _};
        let mut payload = [0; 255];
        let len = message.ser(MavlinkVersion::V2, &mut payload);
        numbers(of_payload(message.message_id(), &payload[..len]))
    }

    fn numbers(found: Option<Logged>) -> Values {
        let Some(Logged::Values(values)) = found else { panic!("{found:?}") };
        values
    }

    #[test]
    fn fields_read_by_offset_are_those_of_the_dialect() {
        let state = messages::EXTENDED_SYS_STATE_DATA {
            vtol_state: messages::MavVtolState::MAV_VTOL_STATE_FW,
            landed_state: messages::MavLandedState::MAV_LANDED_STATE_IN_AIR,
        };
        let read = of_message(&MavMessage::EXTENDED_SYS_STATE(state));
        assert_eq!((read.topic, &read.values[..2]), ("EXTENDED_SYS_STATE", &[4.0, 2.0][..]));
    }

    #[test]
    fn values_that_no_release_has_yet_are_read() {
        let heartbeat = of_payload(messages::HEARTBEAT_DATA::ID, &[7, 0, 0, 0, 240, 250, 0, 3, 3]);
        assert_eq!(numbers(heartbeat).values[..3], [240.0, 250.0, 7.0]);

        let mut parameter = 1.5_f32.to_le_bytes().to_vec();
        parameter.extend([1, 0, 0, 0]);
        parameter.extend(b"TRIM\0\0\0\0\0\0\0\0\0\0\0\0");
        parameter.push(99);
        let (name, value) = ("TRIM".to_owned(), 1.5);
        let expected = Logged::Parameter { name, value, bytewise: value };
        assert_eq!(of_payload(messages::PARAM_VALUE_DATA::ID, &parameter), Some(expected));
    }
}
