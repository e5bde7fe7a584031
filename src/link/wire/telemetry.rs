//! Telemetry streams to a client (a ground station or an offboard program): messages that are built from the autopilot's status
//! and sent at a fixed rate.

use mavlink::dialects::ardupilotmega::{
    ATTITUDE_DATA, ATTITUDE_QUATERNION_DATA, ATTITUDE_TARGET_DATA, AttitudeTargetTypemask,
    BATTERY_STATUS_DATA, EXTENDED_SYS_STATE_DATA, GLOBAL_POSITION_INT_DATA, GPS_RAW_INT_DATA,
    GpsFixType, MavLandedState, MavMessage, MavSysStatusSensor, NAMED_VALUE_FLOAT_DATA,
    SERVO_OUTPUT_RAW_DATA, SYS_STATUS_DATA, SYSTEM_TIME_DATA, VFR_HUD_DATA,
};

use super::{Message, answer, mode, setpoint};
use crate::autopilot::{ESTIMATES, RESIDUALS, Status};
use greylag_physics::Time;

/// A message that can be streamed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stream {
    /// Message id.
    pub id: u32,
    /// Default rate, Hz; 0 if the stream is off by default.
    pub default_hz: f64,
    /// Group of REQUEST_DATA_STREAM (MAV_DATA_STREAM) to which the stream belongs.
    pub group: u8,
}

const fn stream(id: u32, default_hz: f64, group: u8) -> Stream {
    Stream { id, default_hz, group }
}

/// All streams with their default rates.
pub const STREAMS: [Stream; 14] = [
    stream(30, 10.0, 10), // ATTITUDE
    stream(31, 10.0, 10), // ATTITUDE_QUATERNION
    stream(83, 5.0, 4),   // ATTITUDE_TARGET
    stream(74, 5.0, 11),  // VFR_HUD
    stream(33, 5.0, 6),   // GLOBAL_POSITION_INT
    stream(36, 10.0, 3),  // SERVO_OUTPUT_RAW
    stream(1, 1.0, 2),    // SYS_STATUS
    stream(245, 1.0, 2),  // EXTENDED_SYS_STATE
    stream(24, 1.0, 2),   // GPS_RAW_INT
    stream(147, 1.0, 2),  // BATTERY_STATUS
    stream(242, 0.5, 2),  // HOME_POSITION (MAVSDK waits for it without requesting it)
    stream(2, 0.0, 12),   // SYSTEM_TIME
    stream(436, 0.0, 12), // CURRENT_MODE
    stream(NAMED_VALUE_FLOAT, 1.0, 12),
];

/// Message id of NAMED_VALUE_FLOAT. It is sent once for each known residual of the model monitor ([`Status::residuals`]) and
/// once for each known derivative that was estimated in flight ([`Status::derivatives`]).
pub const NAMED_VALUE_FLOAT: u32 = 251;

/// Index of the message `id` in [`STREAMS`]; `None` if it cannot be streamed.
pub fn position(id: u32) -> Option<usize> {
    STREAMS.iter().position(|stream| stream.id == id)
}

/// The home position, as in HOME_POSITION.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Home {
    /// Latitude and longitude, degrees.
    pub position: [f64; 2],
    /// Altitude above mean sea level, m.
    pub altitude: f64,
}

/// Data that the stream messages contain in addition to the status.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scene {
    /// Time of the vehicle's clock.
    pub now: Time,
    /// The home position; `None` until it is known.
    pub home: Option<Home>,
    /// Number of invalid frames from clients.
    pub bad_frames: u64,
}

/// One NAMED_VALUE_FLOAT message for each known residual and each known derivative.
pub fn named_values(status: &Status, scene: &Scene) -> impl Iterator<Item = Message> {
    let time_boot_ms = boot_ms(scene.now);
    let residuals = RESIDUALS.iter().zip(status.residuals);
    let derivatives = ESTIMATES.iter().zip(status.derivatives);
    let known = residuals.chain(derivatives).filter(|(_, value)| value.is_finite());
    known.map(move |(name, value)| {
        Message::coded(MavMessage::NAMED_VALUE_FLOAT(NAMED_VALUE_FLOAT_DATA {
            time_boot_ms,
            value: value as f32,
            name: (*name).into(),
        }))
    })
}

/// Builds the stream message `id`; `None` if `id` cannot be streamed, is [`NAMED_VALUE_FLOAT`], or has no known content.
pub fn message(id: u32, status: &Status, scene: &Scene) -> Option<Message> {
    let built = match id {
        1 => sys_status(status, scene),
        2 => MavMessage::SYSTEM_TIME(SYSTEM_TIME_DATA {
            time_unix_usec: 0,
            time_boot_ms: boot_ms(scene.now),
        }),
        24 => gps_raw(status, scene),
        30 => attitude(status, scene)?,
        31 => attitude_quaternion(status, scene)?,
        33 => global_position(status, scene)?,
        36 => servo_output(status, scene),
        74 => vfr_hud(status),
        83 => attitude_target(status, scene),
        147 => battery(),
        245 => MavMessage::EXTENDED_SYS_STATE(EXTENDED_SYS_STATE_DATA {
            landed_state: landed(status),
            ..EXTENDED_SYS_STATE_DATA::DEFAULT
        }),
        242 => {
            return scene.home.map(|home| answer::home_position(home, scene.now));
        }
        436 => return Some(mode::current_mode(status)),
        _ => return None,
    };
    Some(Message::coded(built))
}

fn boot_ms(now: Time) -> u32 {
    (now.as_micros() / 1000) as u32
}

fn finite<const N: usize>(values: [f64; N]) -> Option<[f64; N]> {
    values.iter().all(|x| x.is_finite()).then_some(values)
}

fn attitude(status: &Status, scene: &Scene) -> Option<MavMessage> {
    let [roll, pitch, yaw] = finite(status.attitude)?.map(|x| x as f32);
    let [p, q, r] = status.rates.map(|x| x as f32);
    Some(MavMessage::ATTITUDE(ATTITUDE_DATA {
        time_boot_ms: boot_ms(scene.now),
        roll,
        pitch,
        yaw,
        rollspeed: p,
        pitchspeed: q,
        yawspeed: r,
    }))
}

fn attitude_quaternion(status: &Status, scene: &Scene) -> Option<MavMessage> {
    let [q1, q2, q3, q4] = setpoint::quaternion(finite(status.attitude)?).map(|x| x as f32);
    let [p, q, r] = status.rates.map(|x| x as f32);
    Some(MavMessage::ATTITUDE_QUATERNION(ATTITUDE_QUATERNION_DATA {
        time_boot_ms: boot_ms(scene.now),
        q1,
        q2,
        q3,
        q4,
        rollspeed: p,
        pitchspeed: q,
        yawspeed: r,
        ..ATTITUDE_QUATERNION_DATA::DEFAULT
    }))
}

/// Builds ATTITUDE_TARGET. The type mask makes the receiver ignore the body rates, and without a commanded attitude also the
/// attitude.
fn attitude_target(status: &Status, scene: &Scene) -> MavMessage {
    let yaw = if status.attitude[2].is_finite() { status.attitude[2] } else { 0.0 };
    let (attitude, mask) = match finite(status.target) {
        Some([roll, pitch]) => ([roll, pitch, yaw], RATES_IGNORED),
        None => ([0.0, 0.0, yaw], RATES_IGNORED | ATTITUDE_IGNORED),
    };
    MavMessage::ATTITUDE_TARGET(ATTITUDE_TARGET_DATA {
        time_boot_ms: boot_ms(scene.now),
        q: setpoint::quaternion(attitude).map(|x| x as f32),
        thrust: status.command.throttle as f32,
        type_mask: AttitudeTargetTypemask::from_bits_retain(mask),
        ..ATTITUDE_TARGET_DATA::DEFAULT
    })
}

/// Bits of ATTITUDE_TARGET_TYPEMASK. With the first the receiver ignores the body rates, with the second the attitude.
const RATES_IGNORED: u8 = 0b111;
const ATTITUDE_IGNORED: u8 = 1 << 7;

fn vfr_hud(status: &Status) -> MavMessage {
    let [north, east, down] = status.velocity;
    MavMessage::VFR_HUD(VFR_HUD_DATA {
        airspeed: status.airspeed as f32,
        groundspeed: north.hypot(east) as f32,
        alt: status.altitude as f32,
        climb: -down as f32,
        heading: status.attitude[2].to_degrees().rem_euclid(360.0).round() as i16 % 360,
        throttle: (status.command.throttle * 100.0).round() as u16,
    })
}

fn global_position(status: &Status, scene: &Scene) -> Option<MavMessage> {
    let [latitude, longitude] = finite(status.position)?;
    let height = scene.home.map_or(0.0, |home| status.altitude - home.altitude);
    let [vx, vy, vz] = status.velocity.map(|v| (v * 100.0).round() as i16);
    Some(MavMessage::GLOBAL_POSITION_INT(GLOBAL_POSITION_INT_DATA {
        time_boot_ms: boot_ms(scene.now),
        lat: (latitude * 1e7).round() as i32,
        lon: (longitude * 1e7).round() as i32,
        alt: (status.altitude * 1e3).round() as i32,
        relative_alt: (height * 1e3).round() as i32,
        vx,
        vy,
        vz,
        hdg: centidegrees(status.attitude[2].to_degrees()),
    }))
}

/// Converts an angle in degrees to 0.01° within 0 to 359.99°; 65535 if it is unknown.
fn centidegrees(degrees: f64) -> u16 {
    match degrees.is_finite() {
        true => (degrees.rem_euclid(360.0) * 100.0) as u16 % 36000,
        false => u16::MAX,
    }
}

/// Converts a speed from m/s to cm/s; 65535 if it is unknown.
fn centimetres_per_second(speed: f64) -> u16 {
    if speed.is_finite() { (speed * 100.0) as u16 } else { u16::MAX }
}

fn gps_raw(status: &Status, scene: &Scene) -> MavMessage {
    let [north, east, _] = status.velocity;
    let unknown = GPS_RAW_INT_DATA {
        time_usec: scene.now.as_micros(),
        eph: u16::MAX,
        epv: u16::MAX,
        vel: u16::MAX,
        cog: u16::MAX,
        satellites_visible: u8::MAX,
        fix_type: GpsFixType::GPS_FIX_TYPE_NO_FIX,
        ..GPS_RAW_INT_DATA::DEFAULT
    };
    let data = match finite(status.position) {
        None => unknown,
        Some([latitude, longitude]) => GPS_RAW_INT_DATA {
            fix_type: GpsFixType::GPS_FIX_TYPE_3D_FIX,
            lat: (latitude * 1e7).round() as i32,
            lon: (longitude * 1e7).round() as i32,
            alt: (status.altitude * 1e3).round() as i32,
            vel: centimetres_per_second(north.hypot(east)),
            cog: centidegrees(east.atan2(north).to_degrees()),
            ..unknown
        },
    };
    MavMessage::GPS_RAW_INT(data)
}

fn servo_output(status: &Status, scene: &Scene) -> MavMessage {
    let surface = |x: f64| (1500.0 + 500.0 * x).round() as u16;
    MavMessage::SERVO_OUTPUT_RAW(SERVO_OUTPUT_RAW_DATA {
        time_usec: scene.now.as_micros() as u32,
        servo1_raw: surface(status.command.aileron),
        servo2_raw: surface(status.command.elevator),
        servo3_raw: (1000.0 + 1000.0 * status.command.throttle).round() as u16,
        ..SERVO_OUTPUT_RAW_DATA::DEFAULT
    })
}

fn sys_status(status: &Status, scene: &Scene) -> MavMessage {
    type S = MavSysStatusSensor;
    // all sensors are reported healthy if the vehicle is alive, otherwise none; the compass is included because MAVSDK's
    // `health_all_ok` waits for it
    let sensors = S::MAV_SYS_STATUS_SENSOR_3D_GYRO
        | S::MAV_SYS_STATUS_SENSOR_3D_ACCEL
        | S::MAV_SYS_STATUS_SENSOR_3D_MAG
        | S::MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
        | S::MAV_SYS_STATUS_SENSOR_DIFFERENTIAL_PRESSURE
        | S::MAV_SYS_STATUS_SENSOR_GPS
        | S::MAV_SYS_STATUS_SENSOR_ANGULAR_RATE_CONTROL
        | S::MAV_SYS_STATUS_SENSOR_ATTITUDE_STABILIZATION
        | S::MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
        | S::MAV_SYS_STATUS_AHRS
        | S::MAV_SYS_STATUS_PREARM_CHECK;
    // there is no geofence; its bit is set all the same, because MAVProxy reports a breach without it
    let fence = S::MAV_SYS_STATUS_GEOFENCE;
    let health = if status.vehicle_alive { sensors | fence } else { fence };
    MavMessage::SYS_STATUS(SYS_STATUS_DATA {
        onboard_control_sensors_present: sensors,
        onboard_control_sensors_enabled: sensors,
        onboard_control_sensors_health: health,
        load: (status.load * 1000.0).round() as u16,
        errors_comm: scene.bad_frames.min(u64::from(u16::MAX)) as u16,
        voltage_battery: u16::MAX,
        current_battery: -1,
        battery_remaining: -1,
        ..SYS_STATUS_DATA::DEFAULT
    })
}

/// Builds BATTERY_STATUS with unknown values. The flight controller reports the battery on its own link.
fn battery() -> MavMessage {
    MavMessage::BATTERY_STATUS(BATTERY_STATUS_DATA {
        current_consumed: -1,
        energy_consumed: -1,
        temperature: i16::MAX,
        voltages: [u16::MAX; 10],
        current_battery: -1,
        battery_remaining: -1,
        ..BATTERY_STATUS_DATA::DEFAULT
    })
}

/// The MAV_LANDED_STATE. An armed aircraft counts as in the air, because there is no weight-on-wheels sensor.
fn landed(status: &Status) -> MavLandedState {
    match (status.vehicle_alive, status.armed) {
        (_, true) => MavLandedState::MAV_LANDED_STATE_IN_AIR,
        (true, false) => MavLandedState::MAV_LANDED_STATE_ON_GROUND,
        (false, false) => MavLandedState::MAV_LANDED_STATE_UNDEFINED,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_speed_or_an_angle_that_is_not_known_is_not_sent_as_zero() {
        // in the fields `vel` and `cog` of GPS_RAW_INT, 65535 means unknown
        assert_eq!([17.256, 0.0, f64::NAN].map(centimetres_per_second), [1725, 0, 65535]);
        assert_eq!([-90.0, f64::NAN].map(centidegrees), [27000, 65535]);
    }
}
