//! Messages between the companion (Greylag's autopilot) and a real flight controller.

use mavlink::Message as _;
use mavlink::dialects::ardupilotmega::{
    AttitudeTargetTypemask, HEARTBEAT_DATA, MANUAL_CONTROL_DATA, MavAutopilot, MavMessage,
    MavModeFlag, MavState, MavType, PARAM_REQUEST_READ_DATA, RC_CHANNELS_OVERRIDE_DATA,
    SET_ATTITUDE_TARGET_DATA, TIMESYNC_DATA,
};

use super::fields::Fields;
use super::{Frame, Message, decode, setpoint};
use crate::framing::Source;
use greylag_physics::Time;

/// Command number of MAV_CMD_DO_SET_MODE.
pub const SET_MODE: u16 = 176;
/// Command number of MAV_CMD_SET_MESSAGE_INTERVAL.
pub const SET_MESSAGE_INTERVAL: u16 = 511;

/// Assumed standard deviations of the wind in WIND_COV (PX4) and in WIND (ArduPlane), m/s. In still air, ArduPlane's wind was
/// wrong by up to 0.9 m/s. The companion uses the wind to estimate the sideslip. With 0.5 m/s for ArduPlane, the estimate had an
/// error of 1.3°, with 4 m/s of 0.34° to 0.50° in trial flights (`results/notes/2026-11-27-real-firmware.md`).
/// `tests/firmware/angles.py` prints these errors for a recording.
const WIND_COV_SD: f64 = 0.5;
const WIND_SD: f64 = 4.0;

/// A message from a flight controller, converted to SI units.
#[derive(Clone, Debug, PartialEq)]
pub enum ControllerMessage {
    /// HEARTBEAT of the flight controller.
    Heartbeat {
        /// MAV_AUTOPILOT: 12 is PX4, 3 is ArduPilot, 8 is no flight controller.
        autopilot: u8,
        /// Whether MAV_MODE_FLAG_SAFETY_ARMED is set.
        armed: bool,
        /// Mode number of the flight stack.
        custom_mode: u32,
    },
    /// Attitude and rates from ATTITUDE_QUATERNION.
    Attitude {
        /// Time since boot, ms, modulo 2³².
        boot_ms: u32,
        /// Attitude quaternion NED→FRD, w first.
        quaternion: [f64; 4],
        /// p, q, r, rad/s.
        rates: [f64; 3],
    },
    /// Accelerometers and air density from HIGHRES_IMU.
    Imu {
        /// Time of the measurement, as stamped by the flight controller.
        time: Time,
        /// Specific force, m/s², FRD.
        specific_force: [f64; 3],
        /// Air density from static pressure and temperature, kg/m³; NaN if they are not reported or implausible.
        density: f64,
    },
    /// Airspeed, altitude and climb rate from VFR_HUD.
    Air {
        /// Equivalent airspeed, m/s. PX4 reports calibrated airspeed, which is used as equivalent airspeed without correction.
        airspeed: f64,
        /// Altitude above mean sea level, m.
        altitude: f64,
        /// Climb rate, m/s, positive upward.
        climb: f64,
    },
    /// AOA_SSA: angle of attack and sideslip, rad.
    Incidence([f64; 2]),
    /// Position and velocity from GLOBAL_POSITION_INT.
    Position {
        /// Latitude and longitude, degrees.
        position: [f64; 2],
        /// Velocity over ground, NED, m/s.
        velocity: [f64; 3],
    },
    /// Wind from WIND_COV, or from ArduPilot's WIND.
    Wind {
        /// Velocity of the air, NED, m/s.
        velocity: [f64; 3],
        /// Assumed standard deviation of each horizontal component, m/s. It is larger than the error of one message,
        /// because successive errors are correlated.
        sd: f64,
    },
    /// Result of a command, COMMAND_ACK.
    Ack {
        /// Number of the MAV_CMD.
        command: u16,
        /// MAV_RESULT; 0 is ACCEPTED.
        result: u8,
        /// Target of the reply; zeros from firmware without target fields.
        to: Source,
    },
    /// Radio receiver status from SYS_STATUS.
    Receiver {
        /// Whether the receiver is present and healthy.
        alive: bool,
    },
    /// Present flight mode, from CURRENT_MODE.
    CurrentMode {
        /// Mode number of the flight stack.
        custom_mode: u32,
    },
    /// PARAM_VALUE, with its value decoded by both encodings.
    Parameter {
        /// Name of the parameter.
        name: String,
        /// The number in the float field: ArduPilot's encoding of integers.
        cast: f64,
        /// The bytes of the float field read in the parameter's type: PX4's encoding.
        bytewise: f64,
    },
    /// One chunk of a STATUSTEXT.
    Text {
        /// MAV_SEVERITY; 0 is the most severe.
        severity: u8,
        /// Text of the chunk.
        words: String,
    },
    /// Reply to a TIMESYNC request of this program.
    TimeSync {
        /// The time that this program sent in its request, ns.
        ours: i64,
    },
}

/// Sensor bit MAV_SYS_STATUS_SENSOR_RC_RECEIVER.
const RECEIVER: u32 = 1 << 16;

/// Gas constant of dry air, J/(kg K).
const AIR: f64 = 287.053;

/// Decodes a frame from a flight controller; `None` for messages that the companion does not use.
pub fn read(frame: &Frame<'_>) -> Option<ControllerMessage> {
    let fields = Fields(frame.payload);
    match frame.id {
        // Decoded by byte offset, because rust-mavlink rejects enumeration values that later releases of MAVLink added.
        0 => {
            return Some(ControllerMessage::Heartbeat {
                autopilot: fields.u8(5),
                armed: fields.u8(6) & 128 != 0,
                custom_mode: fields.u32(0),
            });
        }
        1 => {
            let alive = fields.u32(0) & fields.u32(8) & RECEIVER != 0;
            return Some(ControllerMessage::Receiver { alive });
        }
        22 => return Some(parameter(fields)),
        77 => {
            let to = Source { system: fields.u8(8), component: fields.u8(9) };
            let (command, result) = (fields.u16(0), fields.u8(2));
            return Some(ControllerMessage::Ack { command, result, to });
        }
        436 => return Some(ControllerMessage::CurrentMode { custom_mode: fields.u32(0) }),
        253 => {
            let words: Vec<u8> =
                fields.bytes::<50>(1).into_iter().take_while(|b| *b != 0).collect();
            let words = String::from_utf8_lossy(&words).into_owned();
            return Some(ControllerMessage::Text { severity: fields.u8(0), words });
        }
        _ => {}
    }
    measured(decode(frame)?)
}

/// Value of a parameter whose four bytes PX4 sends as a float, `value`. `kind` is its MAV_PARAM_TYPE: 1 UINT8 to 6 INT32, else
/// a float.
pub(super) fn bytewise(value: f32, kind: u8) -> f64 {
    let bits = value.to_bits();
    match kind {
        1 => f64::from(bits as u8),
        2 => f64::from(bits as i8),
        3 => f64::from(bits as u16),
        4 => f64::from(bits as i16),
        5 => f64::from(bits),
        6 => f64::from(bits as i32),
        _ => f64::from(value),
    }
}

fn parameter(fields: Fields<'_>) -> ControllerMessage {
    let name: Vec<u8> = fields.bytes::<16>(8).into_iter().take_while(|b| *b != 0).collect();
    let cast = f64::from(fields.f32(0));
    let bytewise = bytewise(fields.f32(0), fields.u8(24));
    ControllerMessage::Parameter {
        name: String::from_utf8_lossy(&name).into_owned(),
        cast,
        bytewise,
    }
}

fn measured(message: MavMessage) -> Option<ControllerMessage> {
    let wide = |x: f32| f64::from(x);
    Some(match message {
        MavMessage::ATTITUDE_QUATERNION(m) => ControllerMessage::Attitude {
            boot_ms: m.time_boot_ms,
            quaternion: [m.q1, m.q2, m.q3, m.q4].map(wide),
            rates: [m.rollspeed, m.pitchspeed, m.yawspeed].map(wide),
        },
        MavMessage::HIGHRES_IMU(m) => ControllerMessage::Imu {
            time: Time::from_micros(m.time_usec),
            specific_force: [m.xacc, m.yacc, m.zacc].map(wide),
            density: density(wide(m.abs_pressure), wide(m.temperature)),
        },
        MavMessage::VFR_HUD(m) => ControllerMessage::Air {
            airspeed: wide(m.airspeed),
            altitude: wide(m.alt),
            climb: wide(m.climb),
        },
        MavMessage::AOA_SSA(m) => {
            ControllerMessage::Incidence([m.AOA, m.SSA].map(|x| wide(x).to_radians()))
        }
        MavMessage::GLOBAL_POSITION_INT(m) => ControllerMessage::Position {
            position: [m.lat, m.lon].map(|x| f64::from(x) * 1e-7),
            velocity: [m.vx, m.vy, m.vz].map(|x| f64::from(x) * 1e-2),
        },
        MavMessage::WIND_COV(m) => {
            let velocity = [m.wind_x, m.wind_y, m.wind_z].map(wide);
            ControllerMessage::Wind { velocity, sd: WIND_COV_SD }
        }
        MavMessage::WIND(m) => {
            // `direction` is the direction from which the wind blows
            let (sin, cos) = wide(m.direction).to_radians().sin_cos();
            let speed = wide(m.speed);
            let velocity = [-speed * cos, -speed * sin, wide(m.speed_z)];
            ControllerMessage::Wind { velocity, sd: WIND_SD }
        }
        // In a reply, `tc1` is the time of the other side. In a request it is zero.
        MavMessage::TIMESYNC(m) if m.tc1 != 0 => ControllerMessage::TimeSync { ours: m.ts1 },
        _ => return None,
    })
}

/// Air density from pressure and temperature (°C), kg/m³; NaN if one of them is implausible. MAVLink specifies the pressure in
/// hPa. PX4 releases of 2025 send Pa, so a value above 10 000 is taken as Pa.
fn density(pressure: f64, temperature: f64) -> f64 {
    let pressure = if pressure > 10_000.0 { pressure / 100.0 } else { pressure };
    let believable = (200.0..=1100.0).contains(&pressure) && (-80.0..=85.0).contains(&temperature);
    if believable { 100.0 * pressure / (AIR * (temperature + 273.15)) } else { f64::NAN }
}

/// Target system and component of a frame; 0 for a broadcast or a message without a target.
pub fn recipient(frame: &Frame<'_>) -> (u8, u8) {
    decode(frame).map_or((0, 0), |message| {
        (message.target_system_id().unwrap_or(0), message.target_component_id().unwrap_or(0))
    })
}

/// Whether a message commands the aircraft: MANUAL_CONTROL, RC_CHANNELS_OVERRIDE, SET_ATTITUDE_TARGET,
/// SET_POSITION_TARGET_* and SET_ACTUATOR_CONTROL_TARGET. Such messages are blocked while the companion has control
/// authority.
pub fn steers(id: u32) -> bool {
    matches!(id, 69 | 70 | 82 | 84 | 86 | 139)
}

/// Message id of SETUP_SIGNING, which contains a secret key and is never forwarded.
pub const SETUP_SIGNING: u32 = 256;

/// HEARTBEAT of an onboard computer. `engaged` states whether the companion has control authority.
pub fn heartbeat(engaged: bool) -> Message {
    Message::coded(MavMessage::HEARTBEAT(HEARTBEAT_DATA {
        custom_mode: 0,
        mavtype: MavType::MAV_TYPE_ONBOARD_CONTROLLER,
        autopilot: MavAutopilot::MAV_AUTOPILOT_INVALID,
        base_mode: MavModeFlag::empty(),
        system_status: match engaged {
            true => MavState::MAV_STATE_ACTIVE,
            false => MavState::MAV_STATE_STANDBY,
        },
        mavlink_version: 3,
    }))
}

/// COMMAND_LONG, encoded by hand because rust-mavlink cannot represent every command number.
fn command(to: Source, number: u16, params: [f32; 3]) -> Message {
    let mut payload = Vec::with_capacity(33);
    params.iter().for_each(|p| payload.extend(p.to_le_bytes()));
    payload.extend([0; 16]);
    payload.extend(number.to_le_bytes());
    payload.extend([to.system, to.component, 0]);
    Message::raw(76, payload, 33)
}

/// Request for message `id` every `interval_us` microseconds.
pub fn message_interval(to: Source, id: u32, interval_us: f32) -> Message {
    command(to, SET_MESSAGE_INTERVAL, [id as f32, interval_us, 0.0])
}

/// Request for a flight mode by the stack's mode number and sub mode (0 without one).
pub fn set_mode(to: Source, main: u8, sub: u8) -> Message {
    // The first parameter is MAV_MODE_FLAG_CUSTOM_MODE_ENABLED.
    command(to, SET_MODE, [1.0, f32::from(main), f32::from(sub)])
}

/// PARAM_REQUEST_READ of the parameter `name`.
pub fn parameter_request(to: Source, name: &str) -> Message {
    Message::coded(MavMessage::PARAM_REQUEST_READ(PARAM_REQUEST_READ_DATA {
        param_index: -1,
        target_system: to.system,
        target_component: to.component,
        param_id: name.into(),
    }))
}

/// MANUAL_CONTROL in thousandths: pitch (positive nose down), roll (positive right), throttle (0..1000).
pub fn manual_control(to: Source, [x, y, z]: [i16; 3]) -> Message {
    Message::coded(MavMessage::MANUAL_CONTROL(MANUAL_CONTROL_DATA {
        x,
        y,
        z,
        target: to.system,
        ..MANUAL_CONTROL_DATA::DEFAULT
    }))
}

/// RC_CHANNELS_OVERRIDE of channels 1 to 3, pulse widths in µs. 0 returns a channel to the RC transmitter.
pub fn channels_override(to: Source, [one, two, three]: [u16; 3]) -> Message {
    // 65535 leaves a channel unchanged
    let rest = u16::MAX;
    Message::coded(MavMessage::RC_CHANNELS_OVERRIDE(RC_CHANNELS_OVERRIDE_DATA {
        chan1_raw: one,
        chan2_raw: two,
        chan3_raw: three,
        chan4_raw: rest,
        chan5_raw: rest,
        chan6_raw: rest,
        chan7_raw: rest,
        chan8_raw: rest,
        target_system: to.system,
        target_component: to.component,
        ..RC_CHANNELS_OVERRIDE_DATA::DEFAULT
    }))
}

/// SET_ATTITUDE_TARGET with roll and pitch (rad) at yaw zero, and thrust 0..1. The receiver ignores the body rates.
pub fn attitude_target(to: Source, time_ms: u32, [roll, pitch]: [f64; 2], thrust: f64) -> Message {
    Message::coded(MavMessage::SET_ATTITUDE_TARGET(SET_ATTITUDE_TARGET_DATA {
        time_boot_ms: time_ms,
        target_system: to.system,
        target_component: to.component,
        type_mask: AttitudeTargetTypemask::from_bits_truncate(1 | 2 | 4),
        q: setpoint::quaternion([roll, pitch, 0.0]).map(|x| x as f32),
        thrust: thrust as f32,
        ..SET_ATTITUDE_TARGET_DATA::DEFAULT
    }))
}

/// TIMESYNC request with the time of this program, ns.
pub fn time_sync(ours: i64, to: Source) -> Message {
    Message::coded(MavMessage::TIMESYNC(TIMESYNC_DATA {
        tc1: 0,
        ts1: ours,
        target_system: to.system,
        target_component: to.component,
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pressure_is_read_in_hectopascal_and_in_pascal() {
        // A real PX4 sent 934.0756 hPa in Pa, at 10.6 °C: 93407.56 / (287.053 · 283.75).
        for pressure in [934.0756, 93_407.56] {
            assert!(
                (density(pressure, 10.6) - 1.14678).abs() < 1e-4,
                "{}",
                density(pressure, 10.6)
            );
        }
        assert!(density(5_000.0, 10.6).is_nan());
    }
}
