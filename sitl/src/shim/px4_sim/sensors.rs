//! Sensor messages for PX4: HIL_SENSOR, HIL_GPS, HIL_STATE_QUATERNION.
//!
//! This module converts SI units to the units of these messages.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::plant::{Truth, to_body};
use crate::shim::codec::{HilGps, HilSensor, HilStateQuaternion};
use crate::shim::options::Bias;
use crate::shim::telemetry::quaternion;

/// Number of the random stream for these sensors.
const STREAM: u64 = 4;
/// Gas constant of dry air in the standard atmosphere, J/(kg K).
const AIR: f64 = 287.053;
/// Sea-level density (kg/m³) and pressure (Pa) of the standard atmosphere.
const SEA_LEVEL_DENSITY: f64 = 1.225;
const SEA_LEVEL_PRESSURE: f64 = 101_325.0;
/// Standard gravity, m/s², for the conversion to mG.
const STANDARD_GRAVITY: f64 = 9.806_65;
/// Earth radius by which PX4 converts position noise from metres to degrees, m.
const EARTH_M: f64 = 6_371_000.0;

/// Bits of `fields_updated` (HIL_SENSOR_UPDATED_FLAGS) for accelerometers and gyros, which every message updates.
const INERTIAL: u32 = 0x0007 | 0x0038;
/// Bits for the magnetometer; for the differential pressure; for static pressure, altitude and temperature.
const MAGNETIC: u32 = 0x01C0;
const DIFFERENTIAL: u32 = 0x0400;
const BAROMETRIC: u32 = 0x0200 | 0x0800 | 0x1000;
/// Period of magnetometer and air-pressure sensors in steps: 50 Hz.
pub const SLOW_EVERY: u64 = 5;

/// Standard deviations of white noise; each message draws new values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Px4Noise {
    /// Accelerometers, each axis, m/s².
    pub accelerometer_mps2: f64,
    /// Rate gyros, each axis, rad/s.
    pub gyro_radps: f64,
    /// Magnetometer, by axis, gauss.
    pub magnetometer_gauss: [f64; 3],
    /// Static pressure of the barometer, Pa.
    pub static_pressure_pa: f64,
    /// Differential pressure of the airspeed sensor, Pa.
    pub differential_pressure_pa: f64,
    /// GPS position, north and east, m.
    pub gps_horizontal_m: f64,
    /// Altitude of the GPS receiver, m.
    pub gps_altitude_m: f64,
    /// GPS velocity, north, east, down, m/s.
    pub gps_velocity_mps: [f64; 3],
}

impl Px4Noise {
    /// Perfect sensors. PX4 regards a sensor with constant readings as broken.
    pub const NONE: Px4Noise = Px4Noise {
        accelerometer_mps2: 0.0,
        gyro_radps: 0.0,
        magnetometer_gauss: [0.0; 3],
        static_pressure_pa: 0.0,
        differential_pressure_pa: 0.0,
        gps_horizontal_m: 0.0,
        gps_altitude_m: 0.0,
        gps_velocity_mps: [0.0; 3],
    };

    /// Noise of PX4's simulators.
    ///
    /// The inertial noise follows from the noise densities of Gazebo's IMU plugin, 0.00186 m/s²/√Hz and 0.00018665 rad/s/√Hz,
    /// times √250 Hz; the plugin's bias drift is left out. The other values are those of PX4's modules sensor_mag_sim (0.02,
    /// 0.02, 0.03 gauss), sensor_baro_sim (1 Pa), sensor_airspeed_sim (0.01 hPa) and sensor_gps_sim (0.2 m, 0.5 m; 0.06, 0.077,
    /// 0.158 m/s).
    pub const STANDARD: Px4Noise = Px4Noise {
        accelerometer_mps2: 0.0294,
        gyro_radps: 0.00295,
        magnetometer_gauss: [0.02, 0.02, 0.03],
        static_pressure_pa: 1.0,
        differential_pressure_pa: 1.0,
        gps_horizontal_m: 0.2,
        gps_altitude_m: 0.5,
        gps_velocity_mps: [0.06, 0.077, 0.158],
    };
}

/// Sensors with noise and constant errors.
#[derive(Clone, Debug)]
pub struct Sensors {
    noise: Px4Noise,
    bias: Bias,
    /// Magnetic field, north-east-down, gauss.
    field: [f64; 3],
    random: ChaCha8Rng,
    /// Last message, whose values stay in the fields that a step does not update.
    last: HilSensor,
}

impl Sensors {
    /// Sensors in the magnetic field `field` (north-east-down, gauss), with noise that depends only on `seed`.
    pub fn new(noise: Px4Noise, bias: Bias, field: [f64; 3], seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(STREAM);
        Sensors { noise, bias, field, random, last: HilSensor::default() }
    }

    /// HIL_SENSOR of the step `step`. Every step makes the same number of random draws, whichever fields it updates.
    pub fn inertial(&mut self, time_us: u64, step: u64, truth: &Truth) -> HilSensor {
        let (noise, bias) = (self.noise, self.bias);
        let mut draw = |deviation: f64| deviation * normal(&mut self.random);
        let rates = [truth.p_radps, truth.q_radps, truth.r_radps];
        let gyro: [f64; 3] =
            std::array::from_fn(|i| rates[i] + bias.gyro_radps[i] + draw(noise.gyro_radps));
        let force: [f64; 3] = std::array::from_fn(|i| {
            truth.specific_force_mps2[i]
                + bias.accelerometer_mps2[i]
                + draw(noise.accelerometer_mps2)
        });
        let field = to_body(attitude(truth), self.field);
        let magnetic: [f64; 3] =
            std::array::from_fn(|i| field[i] + draw(noise.magnetometer_gauss[i]));
        let static_pa = truth.static_pressure_pa + draw(noise.static_pressure_pa);
        let differential_pa =
            differential_pa(truth, bias.airspeed_scale) + draw(noise.differential_pressure_pa);
        let [xacc, yacc, zacc] = force.map(|x| x as f32);
        let [xgyro, ygyro, zgyro] = gyro.map(|x| x as f32);
        let mut message = HilSensor {
            time_usec: time_us,
            xacc,
            yacc,
            zacc,
            xgyro,
            ygyro,
            zgyro,
            fields_updated: INERTIAL,
            ..self.last
        };
        if step.is_multiple_of(SLOW_EVERY) {
            [message.xmag, message.ymag, message.zmag] = magnetic.map(|x| x as f32);
            message.abs_pressure = (static_pa * 1e-2) as f32;
            message.diff_pressure = (differential_pa * 1e-2) as f32;
            message.pressure_alt = pressure_altitude_m(static_pa) as f32;
            message.temperature =
                (truth.static_pressure_pa / (truth.air_density_kgpm3 * AIR) - 273.15) as f32;
            message.fields_updated |= MAGNETIC | DIFFERENTIAL | BAROMETRIC;
        }
        self.last = message;
        message
    }

    /// HIL_GPS: a 3D fix with ten satellites, without latency (PX4's EKF2_GPS_DELAY has to match).
    pub fn gps(&mut self, time_us: u64, truth: &Truth) -> HilGps {
        let noise = self.noise;
        let mut draw = |deviation: f64| deviation * normal(&mut self.random);
        let degrees = |metres: f64| (metres / EARTH_M).to_degrees();
        let latitude = truth.latitude_deg + degrees(draw(noise.gps_horizontal_m));
        let east = degrees(draw(noise.gps_horizontal_m));
        let longitude = truth.longitude_deg + east / truth.latitude_deg.to_radians().cos();
        let altitude = truth.altitude_m + draw(noise.gps_altitude_m);
        let velocity: [f64; 3] =
            std::array::from_fn(|i| truth.velocity_ned_mps[i] + draw(noise.gps_velocity_mps[i]));
        let [vn, ve, vd] = velocity.map(|v| (v * 1e2).round() as i16);
        let course_deg = velocity[1].atan2(velocity[0]).to_degrees().rem_euclid(360.0);
        HilGps {
            time_usec: time_us,
            lat: (latitude * 1e7).round() as i32,
            lon: (longitude * 1e7).round() as i32,
            alt: (altitude * 1e3).round() as i32,
            // Accuracies in cm, the unit in which PX4 reads them; values of sensor_gps_sim.
            eph: 90,
            epv: 178,
            vel: (velocity[0].hypot(velocity[1]) * 1e2).round() as u16,
            vn,
            ve,
            vd,
            cog: ((course_deg * 1e2).round() as u32 % 36_000) as u16,
            fix_type: 3,
            satellites_visible: 10,
            ..HilGps::default()
        }
    }
}

/// HIL_STATE_QUATERNION: the true state, which PX4 logs.
pub fn state(time_us: u64, truth: &Truth) -> HilStateQuaternion {
    let [vx, vy, vz] = truth.velocity_ned_mps.map(|v| (v * 1e2).round() as i16);
    let [xacc, yacc, zacc] =
        truth.specific_force_mps2.map(|a| (a / STANDARD_GRAVITY * 1e3).round() as i16);
    let equivalent = truth.airspeed_mps * (truth.air_density_kgpm3 / SEA_LEVEL_DENSITY).sqrt();
    HilStateQuaternion {
        time_usec: time_us,
        attitude_quaternion: quaternion(truth.roll_rad, truth.pitch_rad, truth.yaw_rad)
            .map(|x| x as f32),
        rollspeed: truth.p_radps as f32,
        pitchspeed: truth.q_radps as f32,
        yawspeed: truth.r_radps as f32,
        lat: (truth.latitude_deg * 1e7).round() as i32,
        lon: (truth.longitude_deg * 1e7).round() as i32,
        alt: (truth.altitude_m * 1e3).round() as i32,
        vx,
        vy,
        vz,
        ind_airspeed: (equivalent * 1e2).round() as u16,
        true_airspeed: (truth.airspeed_mps * 1e2).round() as u16,
        xacc,
        yacc,
        zacc,
    }
}

fn attitude(truth: &Truth) -> [f64; 3] {
    [truth.roll_rad, truth.pitch_rad, truth.yaw_rad]
}

/// Differential pressure, Pa: ½ρu·|u| with the airspeed component u along body x, as in PX4's simulators.
fn differential_pa(truth: &Truth, scale: f64) -> f64 {
    let u = scale * truth.airspeed_mps * truth.alpha_rad.cos() * truth.beta_rad.cos();
    0.5 * truth.air_density_kgpm3 * u * u.abs()
}

/// Altitude at which the standard atmosphere has this pressure, m.
fn pressure_altitude_m(pressure_pa: f64) -> f64 {
    44_330.77 * (1.0 - (pressure_pa / SEA_LEVEL_PRESSURE).powf(0.190_263))
}

fn normal(random: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(random)
}
