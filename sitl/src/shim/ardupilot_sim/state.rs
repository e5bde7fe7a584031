//! Writes the state for ArduPilot as one line of JSON.

use serde::Serialize;

use crate::plant::Truth;
use crate::shim::launch::metres_per_degree;
use crate::shim::telemetry::quaternion;

/// Sea-level density of the standard atmosphere, kg/m³.
const SEA_LEVEL_DENSITY: f64 = 1.225;

/// Origin of the positions: ArduPilot's home.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Home {
    /// Geodetic latitude, deg, north positive.
    pub latitude_deg: f64,
    /// Geodetic longitude, deg, east positive.
    pub longitude_deg: f64,
    /// Altitude above mean sea level, m.
    pub altitude_m: f64,
    /// True heading at the start, deg.
    pub heading_deg: f64,
}

/// Content of one JSON line, with the names and units of ArduPilot's interface.
#[derive(Debug, Serialize)]
struct State {
    timestamp: f64,
    imu: Imu,
    position: [f64; 3],
    quaternion: [f64; 4],
    // Before velocity_wind: ArduPilot takes the first key that begins with "velocity".
    velocity: [f64; 3],
    velocity_wind: [f64; 3],
    airspeed: f64,
}

#[derive(Debug, Serialize)]
struct Imu {
    gyro: [f64; 3],
    accel_body: [f64; 3],
}

/// The JSON line of `truth` at `timestamp_s`, s, between the line feeds that ArduPilot requires. Positions are relative to
/// `home`.
///
/// # Errors
/// If serialisation fails, which does not occur with a finite state.
pub fn line(timestamp_s: f64, truth: &Truth, home: &Home) -> serde_json::Result<String> {
    let state = State {
        timestamp: timestamp_s,
        imu: Imu {
            gyro: [truth.p_radps, truth.q_radps, truth.r_radps],
            accel_body: truth.specific_force_mps2,
        },
        position: home.north_east_down_m(truth),
        quaternion: quaternion(truth.roll_rad, truth.pitch_rad, truth.yaw_rad),
        velocity: truth.velocity_ned_mps,
        velocity_wind: truth.wind_ned_mps,
        // ArduPilot expects the equivalent airspeed.
        airspeed: truth.airspeed_mps * (truth.air_density_kgpm3 / SEA_LEVEL_DENSITY).sqrt(),
    };
    Ok(format!("\n{}\n", serde_json::to_string(&state)?))
}

impl Home {
    fn north_east_down_m(&self, truth: &Truth) -> [f64; 3] {
        let (north_m, east_m) = metres_per_degree(self.latitude_deg);
        [
            (truth.latitude_deg - self.latitude_deg) * north_m,
            (truth.longitude_deg - self.longitude_deg) * east_m,
            self.altitude_m - truth.altitude_m,
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_has_the_fields_of_the_interface_in_their_frames() {
        let home =
            Home { latitude_deg: 46.8, longitude_deg: 0.0, altitude_m: 600.0, heading_deg: 0.0 };
        let truth = Truth {
            yaw_rad: std::f64::consts::FRAC_PI_2,
            airspeed_mps: 20.0,
            // A quarter of the density halves the equivalent airspeed.
            air_density_kgpm3: 1.225 / 4.0,
            specific_force_mps2: [0.0, 0.0, -9.81],
            velocity_ned_mps: [1.0, 2.0, 3.0],
            latitude_deg: 46.801,
            longitude_deg: 0.001,
            altitude_m: 590.0,
            ..Truth::default()
        };
        let line = line(1.5, &truth, &home).unwrap();
        assert!(line.starts_with('\n') && line.ends_with("}\n"), "{line}");
        assert!(line.find("velocity\"") < line.find("velocity_wind"), "{line}");
        let read: serde_json::Value = serde_json::from_str(&line).unwrap();
        assert_eq!(read["timestamp"], 1.5);
        assert_eq!(read["imu"]["accel_body"][2], -9.81);
        assert_eq!(read["airspeed"], 10.0);
        assert_eq!(read["velocity"][2], 3.0, "down is positive");
        // A change of 0.001° at 46.8° latitude is 111.2 m north or 76.3 m east (WGS 84).
        let position = |axis: usize| read["position"][axis].as_f64().unwrap();
        assert!((position(0) - 111.2).abs() < 0.05, "{}", position(0));
        assert!((position(1) - 76.3).abs() < 0.05, "{}", position(1));
        assert_eq!(position(2), 10.0, "ten metres lower");
        // Heading east: a rotation by 90° about the axis that points down.
        let half = std::f64::consts::FRAC_1_SQRT_2;
        for (axis, wanted) in [half, 0.0, 0.0, half].into_iter().enumerate() {
            let shown = read["quaternion"][axis].as_f64().unwrap();
            assert!((shown - wanted).abs() < 1e-12, "{line}");
        }
    }
}
