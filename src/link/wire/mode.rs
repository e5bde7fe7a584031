//! Flight modes in MAVLink messages, with PX4's encoding of `custom_mode`: requests, the heartbeat and the list of modes. The
//! base mode is MAVLink's set of flags that describe a mode without this encoding.

use mavlink::dialects::ardupilotmega::{
    AVAILABLE_MODES_DATA, CURRENT_MODE_DATA, HEARTBEAT_DATA, MavAutopilot, MavMessage, MavModeFlag,
    MavModeProperty, MavStandardMode, MavState, MavType,
};

use super::Message;
use crate::autopilot::{Mode, Status};

/// Flag MAV_MODE_FLAG_CUSTOM_MODE_ENABLED of the base mode.
const CUSTOM: u8 = 1;
/// Flag MAV_MODE_FLAG_SAFETY_ARMED of the base mode.
const ARMED: u8 = 128;

/// A request for a mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ModeRequest {
    /// A mode of this autopilot.
    Known(Mode),
    /// A mode that this autopilot does not have.
    Unknown,
}

/// The main mode and the sub mode by which PX4 encodes `mode`.
fn numbers(mode: Mode) -> (u8, u8) {
    match mode {
        Mode::Manual => (1, 0),
        Mode::Hold => (4, 3),
        Mode::Return => (4, 5),
        Mode::Offboard => (6, 0),
        Mode::Stabilized => (7, 0),
    }
}

/// The `custom_mode` of `mode`: its main mode in bits 16 to 23, its sub mode in bits 24 to 31.
pub fn custom_mode(mode: Mode) -> u32 {
    let (main, sub) = numbers(mode);
    u32::from(main) << 16 | u32::from(sub) << 24
}

/// The mode that a SET_MODE with the base mode `base` and the `custom_mode` `custom` requests.
pub fn from_set_mode(base: u8, custom: u32) -> ModeRequest {
    match base & CUSTOM {
        0 => from_base(base),
        _ => from_numbers((custom >> 16) as u8, (custom >> 24) as u8),
    }
}

/// The mode that a DO_SET_MODE requests. Clients of PX4 (ground stations and scripts) send the main mode and the sub mode in two
/// parameters. Other clients send the whole `custom_mode` in the first of these. NaN counts as zero.
pub fn from_do_set_mode(base: f64, main: f64, sub: f64) -> ModeRequest {
    let base = base as u32 as u8;
    match base & CUSTOM {
        0 => from_base(base),
        _ if main >= 65536.0 => from_set_mode(base, main as u32),
        _ => from_numbers(main.clamp(0.0, 255.0) as u8, sub.clamp(0.0, 255.0) as u8),
    }
}

fn from_numbers(main: u8, sub: u8) -> ModeRequest {
    let known = [Mode::Manual, Mode::Hold, Mode::Return, Mode::Offboard, Mode::Stabilized];
    match known.into_iter().find(|mode| numbers(*mode) == (main, sub)) {
        Some(mode) => ModeRequest::Known(mode),
        None => ModeRequest::Unknown,
    }
}

/// The mode that a base mode requests without a `custom_mode`. Of several flags, the most automatic one decides.
fn from_base(base: u8) -> ModeRequest {
    match base {
        b if b & 0b1100 != 0 => ModeRequest::Known(Mode::Hold),
        b if b & 16 != 0 => ModeRequest::Known(Mode::Stabilized),
        b if b & 64 != 0 => ModeRequest::Known(Mode::Manual),
        _ => ModeRequest::Unknown,
    }
}

fn base_mode(status: &Status) -> u8 {
    let flags = match status.mode {
        Mode::Manual => 64,
        Mode::Stabilized => 64 | 16,
        Mode::Offboard => 16 | 8,
        Mode::Hold | Mode::Return => 16 | 8 | 4,
    };
    flags | CUSTOM | if status.armed { ARMED } else { 0 }
}

/// The variable content of a heartbeat. If it changes, a heartbeat is sent at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pulse {
    base: u8,
    custom: u32,
    state: u8,
}

impl Pulse {
    /// The content of the heartbeat for `status`.
    pub fn of(status: &Status) -> Self {
        let state = match (status.failsafe || !status.vehicle_alive, status.armed) {
            (true, _) => MavState::MAV_STATE_CRITICAL,
            (false, true) => MavState::MAV_STATE_ACTIVE,
            (false, false) => MavState::MAV_STATE_STANDBY,
        };
        Pulse { base: base_mode(status), custom: custom_mode(status.mode), state: state as u8 }
    }
}

/// Role of this program on the MAVLink network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Autopilot of the aircraft.
    Autopilot,
    /// Onboard computer of a vehicle with a flight controller.
    Onboard,
}

/// The HEARTBEAT message of this program in the role `role`.
pub fn heartbeat(status: &Status, role: Role) -> Message {
    let pulse = Pulse::of(status);
    let state =
        [MavState::MAV_STATE_STANDBY, MavState::MAV_STATE_ACTIVE, MavState::MAV_STATE_CRITICAL]
            .into_iter()
            .find(|s| *s as u8 == pulse.state)
            .unwrap_or(MavState::MAV_STATE_CRITICAL);
    Message::coded(MavMessage::HEARTBEAT(HEARTBEAT_DATA {
        custom_mode: pulse.custom,
        mavtype: match role {
            Role::Autopilot => MavType::MAV_TYPE_FIXED_WING,
            Role::Onboard => MavType::MAV_TYPE_ONBOARD_CONTROLLER,
        },
        autopilot: match role {
            Role::Autopilot => MavAutopilot::MAV_AUTOPILOT_GENERIC,
            Role::Onboard => MavAutopilot::MAV_AUTOPILOT_INVALID,
        },
        base_mode: MavModeFlag::from_bits_retain(pulse.base),
        system_status: state,
        mavlink_version: 3,
    }))
}

/// The AVAILABLE_MODES message of mode number `index`, counted from 1, or of all modes for 0. Empty if there is no such mode.
pub fn available_modes(index: usize) -> Vec<Message> {
    const AUTOMATIC: u32 = 4;
    let modes = [
        (Mode::Manual, "Manual", 0),
        (Mode::Stabilized, "Stabilized", 0),
        (Mode::Hold, "Hold", AUTOMATIC),
        (Mode::Offboard, "Offboard", AUTOMATIC),
    ];
    let wanted = |at: &usize| index == 0 || index == at + 1;
    let message = |at: usize| {
        let (mode, name, properties) = modes[at];
        Message::coded(MavMessage::AVAILABLE_MODES(AVAILABLE_MODES_DATA {
            custom_mode: custom_mode(mode),
            properties: MavModeProperty::from_bits_retain(properties),
            number_modes: modes.len() as u8,
            mode_index: at as u8 + 1,
            standard_mode: MavStandardMode::MAV_STANDARD_MODE_NON_STANDARD,
            mode_name: name.into(),
        }))
    };
    (0..modes.len()).filter(wanted).map(message).collect()
}

/// The CURRENT_MODE message for `status`.
pub fn current_mode(status: &Status) -> Message {
    let custom = custom_mode(status.mode);
    Message::coded(MavMessage::CURRENT_MODE(CURRENT_MODE_DATA {
        custom_mode: custom,
        intended_custom_mode: custom,
        standard_mode: MavStandardMode::MAV_STANDARD_MODE_NON_STANDARD,
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modes_are_written_as_px4_writes_them() {
        // PX4's px4_custom_mode.h: { uint16 reserved; uint8 main_mode; uint8 sub_mode }
        assert_eq!(custom_mode(Mode::Offboard), 6 << 16);
        assert_eq!(custom_mode(Mode::Hold), 0x0304_0000);
        for mode in [Mode::Manual, Mode::Hold, Mode::Return, Mode::Offboard, Mode::Stabilized] {
            let (main, sub) = numbers(mode);
            let known = ModeRequest::Known(mode);
            assert_eq!(from_set_mode(1, custom_mode(mode)), known);
            assert_eq!(from_do_set_mode(1.0, main.into(), sub.into()), known);
            // pymavlink's set_mode_apm sends the whole custom_mode in one float
            assert_eq!(from_do_set_mode(1.0, f64::from(custom_mode(mode) as f32), f64::NAN), known);
        }
    }

    #[test]
    fn base_mode_alone_maps_to_the_nearest_mode() {
        // the values are MAV_MODE_MANUAL_ARMED, STABILIZE_ARMED, GUIDED_ARMED, AUTO_ARMED and PREFLIGHT
        assert_eq!(from_set_mode(192, 0), ModeRequest::Known(Mode::Manual));
        assert_eq!(from_set_mode(208, 0), ModeRequest::Known(Mode::Stabilized));
        assert_eq!(from_set_mode(216, 0), ModeRequest::Known(Mode::Hold));
        assert_eq!(from_set_mode(220, 0), ModeRequest::Known(Mode::Hold));
        assert_eq!(from_set_mode(0, 0), ModeRequest::Unknown);
        assert_eq!(from_do_set_mode(f64::NAN, 6.0, 0.0), ModeRequest::Unknown);
        assert_eq!(from_do_set_mode(1.0, f64::NAN, f64::NAN), ModeRequest::Unknown);
    }
}
