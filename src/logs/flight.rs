//! A flight as a table: each row is a sample, each column a quantity of the log format.

use crate::columns::{COLUMNS, Get, Place};
use greylag_num::statistics::quantile;
use greylag_physics::Sensors;

/// One row of a flight log. SI units, radians, body axes FRD, earth axes NED; a missing value is NaN.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Monotonic sample time, s.
    pub time_s: f64,
    /// Roll, pitch, yaw: Euler angles ZYX, rad.
    pub attitude_rad: [f64; 3],
    /// p, q, r: body rates, rad/s.
    pub rates_radps: [f64; 3],
    /// True airspeed, m/s.
    pub airspeed_mps: f64,
    /// Angle of attack, rad; positive with the air from below.
    pub alpha_rad: f64,
    /// Sideslip, rad; positive with the air from the right.
    pub beta_rad: f64,
    /// Specific force at the centre of gravity, m/s² (about −9.81 on z in level flight).
    pub specific_force_mps2: [f64; 3],
    /// Velocity over ground, NED, m/s.
    pub velocity_ned_mps: [f64; 3],
    /// Altitude above mean sea level, m.
    pub altitude_m: f64,
    /// Density of the air, kg/m³.
    pub air_density_kgpm3: f64,
    /// Recorded aileron deflection, rad; positive rolls right.
    pub aileron_rad: f64,
    /// Recorded elevator deflection, rad; positive trailing edge down (nose down).
    pub elevator_rad: f64,
    /// Recorded rudder deflection, rad; positive trailing edge left (nose left).
    pub rudder_rad: f64,
    /// Recorded throttle position, 0..1.
    pub throttle: f64,
    /// Commanded aileron, −1..1; positive rolls right.
    pub aileron_cmd: f64,
    /// Commanded elevator, −1..1; positive pitches down.
    pub elevator_cmd: f64,
    /// Commanded rudder, −1..1; positive yaws left.
    pub rudder_cmd: f64,
    /// Commanded throttle position, 0..1.
    pub throttle_cmd: f64,
    /// Commanded roll φ*, rad (optional column `roll_target_rad`).
    pub roll_target_rad: f64,
    /// Commanded pitch θ*, rad (optional column `pitch_target_rad`).
    pub pitch_target_rad: f64,
    /// Time for which a simulator holds the body rates from this sample on, s (optional column `rate_hold_s`); 0 if the rates
    /// are those at the instant of the sample.
    pub rate_hold_s: f64,
}

impl Default for Sample {
    /// A row in which everything is missing.
    fn default() -> Self {
        let nan = f64::NAN;
        Sample {
            time_s: nan,
            attitude_rad: [nan; 3],
            rates_radps: [nan; 3],
            airspeed_mps: nan,
            alpha_rad: nan,
            beta_rad: nan,
            specific_force_mps2: [nan; 3],
            velocity_ned_mps: [nan; 3],
            altitude_m: nan,
            air_density_kgpm3: nan,
            aileron_rad: nan,
            elevator_rad: nan,
            rudder_rad: nan,
            throttle: nan,
            aileron_cmd: nan,
            elevator_cmd: nan,
            rudder_cmd: nan,
            throttle_cmd: nan,
            roll_target_rad: nan,
            pitch_target_rad: nan,
            rate_hold_s: nan,
        }
    }
}

/// Sampling of a recorded body rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Sampling {
    /// The rate at the instant of the sample, as gyros and most simulators log it.
    Instants,
    /// The rate that a simulator holds from this sample to the next one. JSBSim integrates in this way: rates and
    /// attitude by explicit Euler, velocity by Adams–Bashforth 2.
    Held,
}

/// Source of the angle of attack α and the sideslip β of a log.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FlowAngles {
    /// Vanes or another sensor of the flow.
    #[default]
    Measured,
    /// A flight controller's estimate from velocity, attitude and wind. It adds no information to those sensors.
    Estimated,
}

/// A flight: samples in time order, with the properties of the whole recording.
///
/// If only the rows matter, `Flight::from(samples)` or `..Flight::default()` sets everything else to its default.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Flight {
    /// Name of the flight in reports: that of its file.
    pub name: String,
    /// The rows, in time order.
    pub samples: Vec<Sample>,
    /// Source of α and β.
    pub flow_angles: FlowAngles,
    /// Known properties of the sensors and of the wind.
    pub sensors: Sensors,
    /// Columns or channels of the file that the log format does not know.
    pub unknown_columns: Vec<String>,
    /// Assumptions and conversions that the reader made, one sentence each.
    pub notes: Vec<String>,
}

impl Flight {
    /// The columns of the log format that hold a number in some row, each with its values.
    pub fn columns(&self) -> Vec<(&'static str, Vec<f64>)> {
        let column = |c: &(&'static str, Get, Place)| (c.0, self.samples.iter().map(c.1).collect());
        let mut all: Vec<(_, Vec<f64>)> = COLUMNS.iter().map(column).collect();
        all.retain(|(_, values)| values.iter().any(|x| x.is_finite()));
        all
    }

    /// How the body rates were sampled, from the column `rate_hold_s` of the log; `None` without this column.
    ///
    /// Rates that are held for less than half a sample period count as sampled at instants.
    pub fn declared_sampling(&self) -> Option<Sampling> {
        let held: Vec<f64> =
            self.samples.iter().map(|s| s.rate_hold_s).filter(|x| x.is_finite()).collect();
        let periods: Vec<f64> =
            self.samples.windows(2).map(|w| w[1].time_s - w[0].time_s).collect();
        let (hold, period) = (quantile(&held, 0.5), quantile(&periods, 0.5));
        (hold.is_finite() && period.is_finite()).then_some(match hold >= 0.5 * period {
            true => Sampling::Held,
            false => Sampling::Instants,
        })
    }
}

impl From<Vec<Sample>> for Flight {
    /// A flight without a name.
    fn from(samples: Vec<Sample>) -> Self {
        Flight { samples, ..Flight::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_those_that_hold_a_number() {
        let row = |time_s| Sample { time_s, airspeed_mps: 2.0 * time_s, ..Sample::default() };
        let flight = Flight::from(vec![row(0.0), row(1.0)]);
        let expected = vec![("time_s", vec![0.0, 1.0]), ("airspeed_mps", vec![0.0, 2.0])];
        assert_eq!(flight.columns(), expected);
    }
}
