//! Messages between an autopilot and an offboard client, a program that commands attitudes in the mode OFFBOARD.

use mavlink::dialects::ardupilotmega::{
    AttitudeTargetTypemask, COMMAND_LONG_DATA, HEARTBEAT_DATA, MavAutopilot, MavCmd, MavMessage,
    MavModeFlag, MavState, MavType, SET_ATTITUDE_TARGET_DATA,
};

use super::mode::{self, ModeRequest};
use super::{Message, decode, setpoint};
use crate::autopilot::Mode;
use crate::framing::{Frame, Source};

/// A message received from an autopilot.
#[derive(Clone, Debug, PartialEq)]
pub enum Heard {
    /// HEARTBEAT of the autopilot.
    Heartbeat {
        /// Whether the actuator outputs are enabled.
        armed: bool,
        /// The active mode; `None` if it is unknown.
        mode: Option<Mode>,
    },
    /// Attitude with the autopilot's time, from ATTITUDE.
    Attitude {
        /// Time since the autopilot's boot, s.
        time_s: f64,
        /// Roll angle φ, rad.
        roll: f64,
        /// Pitch angle θ, rad.
        pitch: f64,
    },
    /// Airspeed and altitude, from VFR_HUD.
    Speed {
        /// True airspeed V_a, m/s.
        airspeed: f64,
        /// Altitude above mean sea level, m.
        altitude: f64,
    },
    /// Result of a command.
    Ack {
        /// Number of the MAV_CMD.
        command: u32,
        /// Whether the result is MAV_RESULT_ACCEPTED.
        accepted: bool,
    },
    /// A chunk of text of at most 50 characters, from STATUSTEXT.
    Text(String),
}

/// The heartbeat of an offboard client.
pub fn heartbeat() -> Message {
    Message::coded(MavMessage::HEARTBEAT(HEARTBEAT_DATA {
        mavtype: MavType::MAV_TYPE_ONBOARD_CONTROLLER,
        autopilot: MavAutopilot::MAV_AUTOPILOT_INVALID,
        base_mode: MavModeFlag::empty(),
        custom_mode: 0,
        system_status: MavState::MAV_STATE_ACTIVE,
        mavlink_version: 3,
    }))
}

/// SET_ATTITUDE_TARGET with roll and pitch (rad) and zero yaw. The mask makes the receiver ignore body rates and thrust.
pub fn attitude_target(to: Source, time_ms: u32, roll: f64, pitch: f64) -> Message {
    Message::coded(MavMessage::SET_ATTITUDE_TARGET(SET_ATTITUDE_TARGET_DATA {
        time_boot_ms: time_ms,
        target_system: to.system,
        target_component: to.component,
        type_mask: AttitudeTargetTypemask::from_bits_truncate(1 | 2 | 4 | 64),
        q: setpoint::quaternion([roll, pitch, 0.0]).map(|x| x as f32),
        ..Default::default()
    }))
}

/// The command to arm, MAV_CMD_COMPONENT_ARM_DISARM.
pub fn arm(to: Source) -> Message {
    command(to, MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, [1.0, 0.0, 0.0])
}

/// The command MAV_CMD_DO_SET_MODE for the mode `wanted`, with PX4's mode numbers.
pub fn set_mode(to: Source, wanted: Mode) -> Message {
    let custom = mode::custom_mode(wanted);
    let [_, _, main, sub] = custom.to_le_bytes();
    command(to, MavCmd::MAV_CMD_DO_SET_MODE, [1.0, main.into(), sub.into()])
}

fn command(to: Source, command: MavCmd, [param1, param2, param3]: [f32; 3]) -> Message {
    Message::coded(MavMessage::COMMAND_LONG(COMMAND_LONG_DATA {
        target_system: to.system,
        target_component: to.component,
        command,
        param1,
        param2,
        param3,
        ..Default::default()
    }))
}

/// Decodes a message of an autopilot; `None` for messages that this client does not use.
pub fn read(frame: &Frame<'_>) -> Option<Heard> {
    Some(match decode(frame)? {
        MavMessage::HEARTBEAT(h) => Heard::Heartbeat {
            armed: h.base_mode.contains(MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED),
            mode: match mode::from_set_mode(h.base_mode.bits(), h.custom_mode) {
                ModeRequest::Known(mode) => Some(mode),
                ModeRequest::Unknown => None,
            },
        },
        MavMessage::ATTITUDE(a) => Heard::Attitude {
            time_s: f64::from(a.time_boot_ms) * 1e-3,
            roll: a.roll.into(),
            pitch: a.pitch.into(),
        },
        MavMessage::VFR_HUD(v) => {
            Heard::Speed { airspeed: v.airspeed.into(), altitude: v.alt.into() }
        }
        MavMessage::COMMAND_ACK(a) => {
            Heard::Ack { command: a.command as u32, accepted: a.result as u32 == 0 }
        }
        MavMessage::STATUSTEXT(t) => Heard::Text(t.text.to_str().unwrap_or_default().to_owned()),
        _ => return None,
    })
}
