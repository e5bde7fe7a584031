//! Messages of the vehicle link in the `sitl` profile, the link to the simulator. Five messages of the simulator form a state
//! frame. One message of the companion answers it.

use mavlink::dialects::ardupilotmega::{
    HEARTBEAT_DATA, HIL_ACTUATOR_CONTROLS_DATA, MavAutopilot, MavMessage, MavModeFlag, MavState,
    MavType,
};

use super::{Frame, Message, decode};
use greylag_physics::mixer::Mixer;
use greylag_physics::servos::{Travel, Travels};
use greylag_physics::{Command, Time};

/// Flag MAV_MODE_FLAG_SAFETY_ARMED of the base mode.
const ARMED: u8 = 128;

/// Smallest number of outputs in use (`active`) with which a vehicle reports all surfaces and their travels.
const ALL: u32 = 15;

/// Travel of the surfaces of a vehicle that does not report it: deflection at a normalised command of 1, rad. The value is that
/// of the X8.
#[expect(clippy::approx_constant, reason = "the simulator's stop is at 0.5235 rad, not at 30°")]
pub const TRAVEL: f64 = 0.5235;

/// A message from the vehicle. Values are in SI units unless stated otherwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum VehicleMessage {
    /// Time and specific force of a state frame, from HIGHRES_IMU.
    Imu {
        /// Time of the state frame.
        time: Time,
        /// Specific force, m/s², FRD.
        specific_force: [f64; 3],
    },
    /// Airspeed and altitude from VFR_HUD.
    Air {
        /// True airspeed V_a, m/s.
        airspeed: f64,
        /// Altitude above mean sea level, m.
        altitude: f64,
    },
    /// Flow angles from AOA_SSA.
    Incidence {
        /// Time of the state frame.
        time: Time,
        /// Angle of attack, rad.
        alpha: f64,
        /// Angle of sideslip, rad.
        beta: f64,
    },
    /// Actuators from ACTUATOR_OUTPUT_STATUS. Surface positions and rates are divided by the larger one of the surface's two
    /// travels.
    Actuators {
        /// Time of the state frame.
        time: Time,
        /// Number of outputs in use.
        active: u32,
        /// Aileron, elevator and throttle positions, aileron and elevator rates (1/s), rudder position and rudder rate
        /// (1/s).
        outputs: [f64; 7],
        /// Travels of the surfaces to each side, rad.
        travels: Travels,
    },
    /// ATTITUDE_QUATERNION, which completes a state frame.
    Attitude {
        /// Time of the state frame in ms, modulo 2³².
        boot_ms: u32,
        /// Attitude quaternion NED→FRD, w first.
        quaternion: [f64; 4],
        /// Body rates p, q and r, rad/s.
        rates: [f64; 3],
    },
    /// Position and velocity from GLOBAL_POSITION_INT.
    Position {
        /// Latitude and longitude, degrees.
        position: [f64; 2],
        /// Velocity over ground, NED, m/s.
        velocity: [f64; 3],
    },
    /// Wind from WIND_COV: velocity of the air, NED, m/s.
    Wind([f64; 3]),
    /// A heartbeat of the vehicle.
    Heartbeat,
}

/// Decodes a frame from the vehicle; `None` for messages that the profile does not use.
pub fn read(frame: &Frame<'_>) -> Option<VehicleMessage> {
    let wide = f64::from;
    Some(match decode(frame)? {
        MavMessage::HIGHRES_IMU(m) => VehicleMessage::Imu {
            time: Time::from_micros(m.time_usec),
            specific_force: [m.xacc, m.yacc, m.zacc].map(wide),
        },
        MavMessage::VFR_HUD(m) => {
            VehicleMessage::Air { airspeed: wide(m.airspeed), altitude: wide(m.alt) }
        }
        MavMessage::AOA_SSA(m) => VehicleMessage::Incidence {
            time: Time::from_micros(m.time_usec),
            alpha: wide(m.AOA).to_radians(),
            beta: wide(m.SSA).to_radians(),
        },
        MavMessage::ACTUATOR_OUTPUT_STATUS(m) => VehicleMessage::Actuators {
            time: Time::from_micros(m.time_usec),
            active: m.active,
            outputs: outputs(m.active, &m.actuator.map(wide)),
            travels: travels(m.active, &m.actuator.map(wide)),
        },
        MavMessage::ATTITUDE_QUATERNION(m) => VehicleMessage::Attitude {
            boot_ms: m.time_boot_ms,
            quaternion: [m.q1, m.q2, m.q3, m.q4].map(wide),
            rates: [m.rollspeed, m.pitchspeed, m.yawspeed].map(wide),
        },
        MavMessage::GLOBAL_POSITION_INT(m) => VehicleMessage::Position {
            position: [m.lat, m.lon].map(|x| f64::from(x) * 1e-7),
            velocity: [m.vx, m.vy, m.vz].map(|x| f64::from(x) * 1e-2),
        },
        MavMessage::WIND_COV(m) => VehicleMessage::Wind([m.wind_x, m.wind_y, m.wind_z].map(wide)),
        MavMessage::HEARTBEAT(_) => VehicleMessage::Heartbeat,
        _ => return None,
    })
}

/// Returns positions of aileron, elevator and throttle, rates of aileron and elevator, and position and rate of the rudder. The
/// rudder's values are 0 if they are not reported.
fn outputs(active: u32, actuator: &[f64; 32]) -> [f64; 7] {
    let rudder = if active >= ALL { [actuator[7], actuator[8]] } else { [0.0; 2] };
    let [a, e, t, ar, er] = std::array::from_fn(|i| actuator[i]);
    [a, e, t, ar, er, rudder[0], rudder[1]]
}

/// The travels of the surfaces that the vehicle reports, rad; the default travel if it reports none.
fn travels(active: u32, actuator: &[f64; 32]) -> Travels {
    let side = |at: usize| Travel { least: actuator[at + 3], most: actuator[at] };
    match active {
        ALL.. => Travels {
            aileron: side(9),
            elevator: side(10),
            rudder: (actuator[11] != 0.0).then(|| side(11)),
        },
        7.. => Travels {
            aileron: Travel::symmetric(actuator[5]),
            elevator: Travel::symmetric(actuator[6]),
            rudder: None,
        },
        _ => Travels::alike(TRAVEL),
    }
}

/// Actuator outputs for the reply to a state frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outputs {
    /// Disarmed: all outputs are zero.
    Disarmed,
    /// Armed, with this command.
    Armed(Command),
}

/// Index of the first control that commands an individual surface or motor.
const OWN: usize = 4;

/// HIL_ACTUATOR_CONTROLS in reply to the state frame of `time`. The first four controls are aileron, elevator, throttle and
/// rudder. The commands of the individual surfaces and motors of `mixer` follow.
pub fn actuator_controls(time: Time, outputs: Outputs, mixer: Option<&Mixer>) -> Message {
    let mut controls = [0.0; 16];
    let mut mode = 0;
    if let Outputs::Armed(command) = outputs {
        let command = command.clamped();
        controls[0] = command.aileron as f32;
        controls[1] = command.elevator as f32;
        controls[2] = command.throttle as f32;
        controls[3] = command.rudder as f32;
        let own = mixer.map(|mixer| mixer.mix(&command)).unwrap_or_default();
        controls[OWN..].iter_mut().zip(own).for_each(|(control, x)| *control = x as f32);
        mode = ARMED;
    }
    Message::coded(MavMessage::HIL_ACTUATOR_CONTROLS(HIL_ACTUATOR_CONTROLS_DATA {
        time_usec: time.as_micros(),
        controls,
        mode: MavModeFlag::from_bits_retain(mode),
        ..HIL_ACTUATOR_CONTROLS_DATA::DEFAULT
    }))
}

/// HEARTBEAT of the companion on the vehicle link.
pub fn heartbeat(outputs: Outputs) -> Message {
    let (mode, state) = match outputs {
        Outputs::Disarmed => (0, MavState::MAV_STATE_STANDBY),
        Outputs::Armed(_) => (ARMED, MavState::MAV_STATE_ACTIVE),
    };
    Message::coded(MavMessage::HEARTBEAT(HEARTBEAT_DATA {
        custom_mode: 0,
        mavtype: MavType::MAV_TYPE_FIXED_WING,
        autopilot: MavAutopilot::MAV_AUTOPILOT_GENERIC,
        base_mode: MavModeFlag::from_bits_retain(mode),
        system_status: state,
        mavlink_version: 3,
    }))
}
