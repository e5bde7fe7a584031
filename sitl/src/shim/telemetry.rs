//! Converts measured quantities to the messages that `sitl/PROTOCOL.md` specifies.
//!
//! This module converts SI units and radians to the units of the messages.

use super::codec::{
    ActuatorOutputStatus, AoaSsa, AttitudeQuaternion, Encoder, GlobalPositionInt, GpsRawInt,
    Heartbeat, HighresImu, SysStatus, VfrHud, WindCov,
};
use crate::plant::{Stops, Travel, Truth};

/// Simulated time from one frame to the next, µs.
pub const FRAME_US: u64 = 10_000;

/// Gas constant of dry air in the standard atmosphere, J/(kg K).
const AIR: f64 = 287.053;

/// Heartbeat of the simulator: MAV_TYPE_FIXED_WING, MAV_AUTOPILOT_INVALID, MAV_STATE_ACTIVE.
const HEARTBEAT: Heartbeat = Heartbeat {
    custom_mode: 0,
    kind: 1,
    autopilot: 8,
    base_mode: 0,
    system_status: 4,
    mavlink_version: 3,
};

/// HIGHRES_IMU_UPDATED bits: accelerometers, gyros, static pressure, pressure altitude, temperature.
const IMU_FIELDS: u16 = 0x0007 | 0x0038 | 0x0200 | 0x0800 | 0x1000;

/// MAV_SYS_STATUS_SENSOR bits: 3D gyro, 3D accelerometer, absolute and differential pressure, GPS.
const SENSORS: u32 = 0x01 | 0x02 | 0x08 | 0x10 | 0x20;

/// The five messages of a state frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StateFrame {
    /// Simulated time that identifies the frame, µs.
    pub time_us: u64,
    imu: HighresImu,
    hud: VfrHud,
    vanes: AoaSsa,
    actuators: ActuatorOutputStatus,
    attitude: AttitudeQuaternion,
}

impl StateFrame {
    /// The frame with time stamp `time_us`, µs, for the measurement `measured` of an aircraft with this travel.
    pub fn new(time_us: u64, measured: &Truth, travel: Travel) -> Self {
        StateFrame {
            time_us,
            imu: imu(time_us, measured),
            hud: hud(measured),
            vanes: AoaSsa {
                time_usec: time_us,
                aoa: measured.alpha_rad.to_degrees() as f32,
                ssa: measured.beta_rad.to_degrees() as f32,
            },
            actuators: actuators(time_us, measured, travel),
            attitude: attitude(time_us, measured),
        }
    }

    /// Appends the five messages in the order of the protocol.
    pub fn encode(&self, encoder: &mut Encoder, out: &mut Vec<u8>) {
        encoder.encode(&self.imu, out);
        encoder.encode(&self.hud, out);
        encoder.encode(&self.vanes, out);
        encoder.encode(&self.actuators, out);
        encoder.encode(&self.attitude, out);
    }
}

/// Appends the simulator's HEARTBEAT.
pub fn encode_heartbeat(encoder: &mut Encoder, out: &mut Vec<u8>) {
    encoder.encode(&HEARTBEAT, out);
}

/// Appends the slower messages that are due at `time_us`, µs; `home_m` is the altitude of home above mean sea level, m.
pub fn encode_slow(
    time_us: u64,
    measured: &Truth,
    home_m: f64,
    encoder: &mut Encoder,
    out: &mut Vec<u8>,
) {
    let due = |hertz: u64| (time_us / FRAME_US).is_multiple_of(100 / hertz);
    if due(1) {
        encode_heartbeat(encoder, out);
        encoder.encode(&health(), out);
        encoder.encode(&wind(time_us, measured), out);
    }
    if due(5) {
        encoder.encode(&gps(time_us, measured), out);
    }
    if due(10) {
        encoder.encode(&position(time_us, measured, home_m), out);
    }
}

pub(super) fn imu(time_us: u64, measured: &Truth) -> HighresImu {
    let [x, y, z] = measured.specific_force_mps2;
    let kelvin = measured.static_pressure_pa / (measured.air_density_kgpm3 * AIR);
    HighresImu {
        time_usec: time_us,
        xacc: x as f32,
        yacc: y as f32,
        zacc: z as f32,
        xgyro: measured.p_radps as f32,
        ygyro: measured.q_radps as f32,
        zgyro: measured.r_radps as f32,
        abs_pressure: (measured.static_pressure_pa * 1e-2) as f32,
        pressure_alt: measured.altitude_m as f32,
        temperature: (kelvin - 273.15) as f32,
        fields_updated: IMU_FIELDS,
        ..HighresImu::default()
    }
}

pub(super) fn hud(measured: &Truth) -> VfrHud {
    let [north, east, down] = measured.velocity_ned_mps;
    VfrHud {
        airspeed: measured.airspeed_mps as f32,
        groundspeed: north.hypot(east) as f32,
        alt: measured.altitude_m as f32,
        climb: -down as f32,
        heading: (whole_turn_deg(measured.yaw_rad).round() as i16) % 360,
        throttle: (measured.throttle * 100.0).round() as u16,
    }
}

fn actuators(time_us: u64, measured: &Truth, travel: Travel) -> ActuatorOutputStatus {
    let (aileron_rad, elevator_rad) = (travel.aileron.largest_rad(), travel.elevator.largest_rad());
    let mut actuator = [0.0; 32];
    actuator[0] = (measured.aileron_rad / aileron_rad) as f32;
    actuator[1] = (measured.elevator_rad / elevator_rad) as f32;
    actuator[2] = measured.throttle as f32;
    actuator[3] = (measured.aileron_rate_radps / aileron_rad) as f32;
    actuator[4] = (measured.elevator_rate_radps / elevator_rad) as f32;
    if travel == Travel::X8 {
        return ActuatorOutputStatus { time_usec: time_us, active: 5, actuator };
    }
    (actuator[5], actuator[6]) = (aileron_rad as f32, elevator_rad as f32);
    if let Some(rudder) = travel.rudder {
        let full = rudder.largest_rad();
        actuator[7] = (measured.rudder_rad / full) as f32;
        actuator[8] = (measured.rudder_rate_radps / full) as f32;
    }
    let rudder = travel.rudder.unwrap_or(Stops { least_rad: 0.0, most_rad: 0.0 });
    for (i, stops) in [travel.aileron, travel.elevator, rudder].into_iter().enumerate() {
        actuator[9 + i] = stops.most_rad as f32;
        actuator[12 + i] = stops.least_rad as f32;
    }
    ActuatorOutputStatus { time_usec: time_us, active: 15, actuator }
}

pub(super) fn attitude(time_us: u64, measured: &Truth) -> AttitudeQuaternion {
    let [w, x, y, z] = quaternion(measured.roll_rad, measured.pitch_rad, measured.yaw_rad);
    AttitudeQuaternion {
        time_boot_ms: (time_us / 1000) as u32,
        q1: w as f32,
        q2: x as f32,
        q3: y as f32,
        q4: z as f32,
        rollspeed: measured.p_radps as f32,
        pitchspeed: measured.q_radps as f32,
        yawspeed: measured.r_radps as f32,
        repr_offset_q: [0.0; 4],
    }
}

/// Quaternion of the rotation NED→FRD for Euler angles ZYX, rad; w first, w ≥ 0.
pub(super) fn quaternion(roll: f64, pitch: f64, yaw: f64) -> [f64; 4] {
    let (sr, cr) = (0.5 * roll).sin_cos();
    let (sp, cp) = (0.5 * pitch).sin_cos();
    let (sy, cy) = (0.5 * yaw).sin_cos();
    let q = [
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ];
    if q[0] < 0.0 { q.map(|x| -x) } else { q }
}

pub(super) fn health() -> SysStatus {
    SysStatus {
        onboard_control_sensors_present: SENSORS,
        onboard_control_sensors_enabled: SENSORS,
        onboard_control_sensors_health: SENSORS,
        // The battery is not simulated: 12.6 V, with unknown current and remaining charge.
        voltage_battery: 12_600,
        current_battery: -1,
        battery_remaining: -1,
        ..SysStatus::default()
    }
}

pub(super) fn wind(time_us: u64, measured: &Truth) -> WindCov {
    let [north, east, down] = measured.wind_ned_mps;
    WindCov {
        time_usec: time_us,
        wind_x: north as f32,
        wind_y: east as f32,
        wind_z: down as f32,
        wind_alt: measured.altitude_m as f32,
        ..WindCov::default()
    }
}

pub(super) fn gps(time_us: u64, measured: &Truth) -> GpsRawInt {
    let [north, east, _] = measured.velocity_ned_mps;
    let altitude = (measured.altitude_m * 1e3).round() as i32;
    GpsRawInt {
        time_usec: time_us,
        lat: (measured.latitude_deg * 1e7).round() as i32,
        lon: (measured.longitude_deg * 1e7).round() as i32,
        alt: altitude,
        eph: 80,
        epv: 120,
        vel: (north.hypot(east) * 1e2).round() as u16,
        cog: centidegrees(east.atan2(north)),
        fix_type: 3,
        satellites_visible: 12,
        alt_ellipsoid: altitude,
        ..GpsRawInt::default()
    }
}

pub(super) fn position(time_us: u64, measured: &Truth, home_m: f64) -> GlobalPositionInt {
    let [north, east, down] = measured.velocity_ned_mps.map(|speed| (speed * 1e2).round() as i16);
    GlobalPositionInt {
        time_boot_ms: (time_us / 1000) as u32,
        lat: (measured.latitude_deg * 1e7).round() as i32,
        lon: (measured.longitude_deg * 1e7).round() as i32,
        alt: (measured.altitude_m * 1e3).round() as i32,
        relative_alt: ((measured.altitude_m - home_m) * 1e3).round() as i32,
        vx: north,
        vy: east,
        vz: down,
        hdg: centidegrees(measured.yaw_rad),
    }
}

fn whole_turn_deg(angle_rad: f64) -> f64 {
    angle_rad.to_degrees().rem_euclid(360.0)
}

fn centidegrees(angle_rad: f64) -> u16 {
    ((whole_turn_deg(angle_rad) * 1e2).round() as u32 % 36_000) as u16
}
