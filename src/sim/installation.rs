//! Installation and calibration errors of an aircraft's instruments. They are applied to the log of a simulated flight.

use std::f64::consts::TAU;

use rand::RngExt;

use greylag_logs::{Flight, Sample};
use greylag_num::stream::stream;

/// Number that separates the random stream of these errors from others with the same seed.
const DRAW: u64 = 73;
const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// Installation and calibration errors. [`Installation::TRUE`] has none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Installation {
    /// Rotation vector from the body axes to the axes of the sensor board, rad, in body axes. Body rates, specific force and
    /// attitude are measured in the board's axes.
    pub tilt: [f64; 3],
    /// Relative gain errors of the gyros p, q, r.
    pub gyro_gain: [f64; 3],
    /// Relative gain errors of the accelerometers x, y, z.
    pub force_gain: [f64; 3],
    /// Relative gain errors of the vanes of α and β.
    pub vane_gain: [f64; 2],
    /// Airspeed bias, m/s.
    pub airspeed_offset: f64,
    /// Time constant of the airspeed measurement's first-order lag, s.
    pub airspeed_lag: f64,
    /// Offset of the measured heading, rad.
    pub heading_offset: f64,
    /// Delay of the measured velocity over ground, s.
    pub velocity_late: f64,
}

impl Default for Installation {
    fn default() -> Self {
        Installation::TRUE
    }
}

impl Installation {
    /// No errors.
    pub const TRUE: Installation = Installation {
        tilt: [0.0; 3],
        gyro_gain: [0.0; 3],
        force_gain: [0.0; 3],
        vane_gain: [0.0; 2],
        airspeed_offset: 0.0,
        airspeed_lag: 0.0,
        heading_offset: 0.0,
        velocity_late: 0.0,
    };

    /// Draws a single error from `seed` and returns its name and the installation with this error. It is one of these: a
    /// rotation of the board by 1° to 3° about one axis, a gain error of 3 % to 10 % in one channel, an airspeed bias of 0.5 to
    /// 1.5 m/s, an airspeed lag or a velocity delay of 0.05 to 0.2 s, or a heading offset of 3° to 8°.
    pub fn one(seed: u64) -> (&'static str, Installation) {
        let mut random = stream(seed, &[DRAW]);
        let kind = random.random_range(0..7_usize);
        let axis = random.random_range(0..3_usize);
        let sign = if random.random_bool(0.5) { 1.0 } else { -1.0 };
        let mut size = |low: f64, high: f64| random.random_range(low..high);
        let mut all = Installation::TRUE;
        let name = match kind {
            0 => {
                all.tilt[axis] = sign * size(1.0, 3.0) * DEGREE;
                "axes_askew"
            }
            1 => {
                all.gyro_gain[axis] = sign * size(0.03, 0.1);
                "imu_gain"
            }
            2 => {
                all.force_gain[axis] = sign * size(0.03, 0.1);
                "imu_gain"
            }
            3 => {
                all.vane_gain[axis % 2] = sign * size(0.03, 0.1);
                "vane_gain"
            }
            4 => {
                all.airspeed_offset = sign * size(0.5, 1.5);
                "airspeed_offset"
            }
            5 => {
                all.heading_offset = sign * size(3.0, 8.0) * DEGREE;
                "heading_offset"
            }
            _ if axis == 0 => {
                all.velocity_late = size(0.05, 0.2);
                "clock_skew"
            }
            _ => {
                all.airspeed_lag = size(0.05, 0.2);
                "clock_skew"
            }
        };
        (name, all)
    }

    /// Changes `log` to what the instruments with these errors would have recorded.
    pub fn apply(&self, log: &mut Flight) {
        self.delay(&mut log.samples);
        let turn = turned(self.tilt);
        let seen = |x: [f64; 3]| -> [f64; 3] {
            std::array::from_fn(|i| (0..3).map(|j| turn[j][i] * x[j]).sum())
        };
        let scaled = |x: [f64; 3], gain: [f64; 3]| std::array::from_fn(|i| x[i] * (1.0 + gain[i]));
        for sample in &mut log.samples {
            sample.rates_radps = scaled(seen(sample.rates_radps), self.gyro_gain);
            sample.specific_force_mps2 = scaled(seen(sample.specific_force_mps2), self.force_gain);
            let [roll, pitch, yaw] = to_euler(&product(&from_euler(sample.attitude_rad), &turn));
            let yaw = yaw + self.heading_offset;
            sample.attitude_rad = [roll, pitch, yaw - TAU * (yaw / TAU).round()];
            sample.alpha_rad *= 1.0 + self.vane_gain[0];
            sample.beta_rad *= 1.0 + self.vane_gain[1];
            sample.airspeed_mps += self.airspeed_offset;
        }
    }

    /// Applies the lag of the airspeed and the delay of the velocity.
    fn delay(&self, samples: &mut [Sample]) {
        let velocity: Vec<([f64; 3], f64)> =
            samples.iter().map(|s| (s.velocity_ned_mps, s.time_s)).collect();
        let mut airspeed = samples.first().map_or(0.0, |s| s.airspeed_mps);
        let mut before = samples.first().map_or(0.0, |s| s.time_s);
        for (k, sample) in samples.iter_mut().enumerate() {
            let step = sample.time_s - before;
            before = sample.time_s;
            if self.airspeed_lag > 0.0 {
                let kept = (-step / self.airspeed_lag).exp();
                airspeed = kept * airspeed + (1.0 - kept) * sample.airspeed_mps;
                sample.airspeed_mps = airspeed;
            }
            if self.velocity_late > 0.0 {
                sample.velocity_ned_mps = late(&velocity[..=k], sample.time_s - self.velocity_late);
            }
        }
    }
}

type Matrix = [[f64; 3]; 3];

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

/// Matrix of the rotation by the rotation vector `by` (rad), from Rodrigues' formula.
fn turned(by: [f64; 3]) -> Matrix {
    let angle = by.iter().map(|x| x * x).sum::<f64>().sqrt();
    let [x, y, z] = by;
    let cross = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]];
    let twice = product(&cross, &cross);
    let (first, second) = match angle {
        0.0 => (1.0, 0.5),
        _ => (angle.sin() / angle, (1.0 - angle.cos()) / (angle * angle)),
    };
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            f64::from(u8::from(i == j)) + first * cross[i][j] + second * twice[i][j]
        })
    })
}

/// Matrix of the rotation from body to earth axes for roll, pitch and yaw (rad).
fn from_euler([roll, pitch, yaw]: [f64; 3]) -> Matrix {
    let about = |axis: usize, angle: f64| {
        let mut by = [0.0; 3];
        by[axis] = angle;
        turned(by)
    };
    product(&product(&about(2, yaw), &about(1, pitch)), &about(0, roll))
}

/// Roll, pitch and yaw (rad) of the rotation matrix `m` from body to earth axes. Roll and yaw are undefined if the nose points
/// straight up or down.
fn to_euler(m: &Matrix) -> [f64; 3] {
    [m[2][1].atan2(m[2][2]), (-m[2][0]).clamp(-1.0, 1.0).asin(), m[1][0].atan2(m[0][0])]
}

/// The velocity at `time` (s), interpolated linearly in `past`, pairs of velocity and time (s). Outside their times it is the
/// velocity of the nearest pair.
fn late(past: &[([f64; 3], f64)], time: f64) -> [f64; 3] {
    let after = past.iter().rposition(|(_, t)| *t <= time).map_or(0, |k| k + 1);
    let (Some(before), Some(next)) =
        (after.checked_sub(1).and_then(|k| past.get(k)), past.get(after))
    else {
        return past.get(after.saturating_sub(1)).map_or([f64::NAN; 3], |(v, _)| *v);
    };
    let part = (time - before.1) / (next.1 - before.1).max(1e-9);
    std::array::from_fn(|i| before.0[i] + part * (next.0[i] - before.0[i]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lag_and_a_delay_of_a_ramp_are_as_late_as_they_say() {
        let ramp = |k: usize| Sample {
            time_s: 0.01 * k as f64,
            airspeed_mps: 0.02 * k as f64,
            velocity_ned_mps: [0.03 * k as f64; 3],
            attitude_rad: [0.1, 0.05, 3.1],
            ..Sample::default()
        };
        let mut log = Flight::from((0..400).map(ramp).collect::<Vec<_>>());
        let installed =
            Installation { airspeed_lag: 0.15, velocity_late: 0.025, ..Installation::TRUE };
        installed.apply(&mut log);
        let last = &log.samples[399];
        assert!((last.airspeed_mps - 2.0 * (3.99 - 0.15)).abs() < 0.02);
        assert!((last.velocity_ned_mps[1] - 3.0 * (3.99 - 0.025)).abs() < 1e-9);
        assert!((last.attitude_rad[2] - 3.1).abs() < 1e-12);
    }
}
