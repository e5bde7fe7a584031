//! Rotation of a log into the aircraft's body axes. It is needed if the log was recorded in other axes: those of an autopilot's
//! board, or those of motion-capture markers.

use std::fmt;

use nalgebra::{Rotation3, Vector3};
use serde::Deserialize;

use crate::Sample;

/// Orientation of the sensor board in the body. The section `[board]` of a mapping file states it:
///
/// ```toml
/// [board]
/// roll_deg = 0.0
/// pitch_deg = -9.0       # the board's nose is 9° below the body's
/// yaw_deg = 0.0
/// airflow = "board"      # axes of alpha and beta: "board" (from motion capture) or "body" (default, from vanes)
/// ```
///
/// The three Euler angles (order ZYX, as PX4's SENS_BOARD_X_OFF to SENS_BOARD_Z_OFF) rotate the body axes into the board's axes.
/// Attitude, body rates and specific force of the log are rotated back into body axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Board {
    degrees: [f64; 3],
    airflow: Airflow,
    /// Rotation of coordinates from board axes to body axes.
    to_body: Rotation3<f64>,
}

/// Axes to which α and β refer.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
enum Airflow {
    #[default]
    Body,
    Board,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct WrittenBoard {
    #[serde(default)]
    roll_deg: f64,
    #[serde(default)]
    pitch_deg: f64,
    #[serde(default)]
    yaw_deg: f64,
    #[serde(default)]
    airflow: Airflow,
}

impl TryFrom<WrittenBoard> for Board {
    type Error = String;

    fn try_from(w: WrittenBoard) -> Result<Board, String> {
        let degrees = [w.roll_deg, w.pitch_deg, w.yaw_deg];
        if degrees.iter().any(|x| x.is_nan() || x.abs() > 180.0) {
            return Err("board: roll_deg, pitch_deg and yaw_deg must lie within ±180".into());
        }
        let [roll, pitch, yaw] = degrees.map(f64::to_radians);
        let to_body = Rotation3::from_euler_angles(roll, pitch, yaw);
        Ok(Board { degrees, airflow: w.airflow, to_body })
    }
}

impl Board {
    /// Rotates the quantities of `row` from the board's axes into body axes.
    pub(crate) fn turn(&self, row: &mut Sample) {
        let body = |x: [f64; 3]| (self.to_body * Vector3::from(x)).into();
        row.rates_radps = body(row.rates_radps);
        row.specific_force_mps2 = body(row.specific_force_mps2);
        let [roll, pitch, yaw] = row.attitude_rad;
        // without a heading, zero is used for the rotation, and the result has no heading
        let heading = if yaw.is_finite() { yaw } else { 0.0 };
        let seen = Rotation3::from_euler_angles(roll, pitch, heading);
        let (roll, pitch, turned) = (seen * self.to_body.inverse()).euler_angles();
        row.attitude_rad = [roll, pitch, if yaw.is_finite() { turned } else { f64::NAN }];
        if self.airflow == Airflow::Board {
            let (sin, cos) = row.alpha_rad.sin_cos();
            let beta = row.beta_rad;
            let [x, y, z] = body([cos * beta.cos(), beta.sin(), sin * beta.cos()]);
            (row.alpha_rad, row.beta_rad) = (z.atan2(x), y.clamp(-1.0, 1.0).asin());
        }
    }
}

impl fmt::Display for Board {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [roll, pitch, yaw] = self.degrees;
        write!(f, "axes turned from a board at roll {roll}°, pitch {pitch}°, yaw {yaw}°")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_board_that_noses_down_is_turned_back() {
        let written: WrittenBoard =
            toml::from_str("pitch_deg = -9.0\nairflow = \"board\"").unwrap();
        let board = Board::try_from(written).unwrap();
        // level flight at α = 4° with a roll rate of 1 rad/s about the body x axis, expressed in the board's axes
        let nine = 9f64.to_radians();
        let mut row = Sample {
            attitude_rad: [0.0, 4f64.to_radians() - nine, 0.3],
            rates_radps: [nine.cos(), 0.0, -nine.sin()],
            specific_force_mps2: [-9.81 * nine.sin(), 0.0, -9.81 * nine.cos()],
            alpha_rad: 4f64.to_radians() - nine,
            beta_rad: 0.0,
            ..Sample::default()
        };
        board.turn(&mut row);
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
        close(row.attitude_rad[1], 4f64.to_radians());
        close(row.attitude_rad[2], 0.3);
        close(row.alpha_rad, 4f64.to_radians());
        let both = row.rates_radps.iter().zip([1.0, 0.0, 0.0]);
        both.for_each(|(a, b)| close(*a, b));
        let both = row.specific_force_mps2.iter().zip([0.0, 0.0, -9.81]);
        both.for_each(|(a, b)| close(*a, b));
    }
}
