//! Checks of the accelerometers in a log: the unit, and the sign of each axis.

use nalgebra::{Rotation3, Vector3};

use super::cured;
use super::relation::{change, mean, quantile, values, windows, with_intercept};
use crate::Sample;
use crate::finding::Finding;
use greylag_physics::atmosphere::STANDARD_GRAVITY;

const G: f64 = STANDARD_GRAVITY;
/// Time over which measured and expected values are averaged before they are compared, s.
const WINDOW_S: f64 = 1.0;
/// Largest bank and pitch angle (rad) and largest body rate (rad/s) at which flight counts as level.
const LEVEL: [f64; 2] = [0.8, 0.5];
const LEVEL_RATE: f64 = 1.0;
/// Magnitude of the specific force at which flight counts as level, g.
const CARRIED: std::ops::Range<f64> = 0.5..1.5;
/// A sign counts as wrong if the correlation of the measured with the expected values is below this value.
const TURNED: f64 = -0.7;

/// Findings on the unit and the signs of the measured specific force. At most one kind is returned: a wrong unit, or a wrong
/// sign of z, or wrong signs of x and y.
pub fn check(rows: &[Sample]) -> Vec<Finding> {
    let size = |s: &Sample| s.specific_force_mps2.iter().map(|a| a * a).sum::<f64>().sqrt();
    let Some(middle) = quantile(&values(rows, size), 0.5) else { return Vec::new() };
    if let Some((unit, scale)) = unit(middle) {
        return vec![
            cured(
                format!(
                    "specific force looks like {unit}, not m/s² (its median size is {middle:.2})"
                ),
                "ax_mps2",
                scale,
            )
            .with("; ay_mps2 and az_mps2 likewise"),
        ];
    }
    if let Some(vertical) = vertical(rows) {
        return vec![vertical];
    }
    along_and_across(rows)
}

fn unit(middle: f64) -> Option<(&'static str, f64)> {
    match middle {
        0.5..2.0 => Some(("g", 9.80665)),
        300.0..3000.0 => Some(("milli-g", 0.00980665)),
        _ => None,
    }
}

/// Whether the aircraft is roughly level with a load factor of roughly one. Only then does the sign of the specific force show
/// the direction of the z axis. Unknown angles count as level.
fn is_level(s: &Sample) -> bool {
    let size = s.specific_force_mps2.iter().map(|a| a * a).sum::<f64>().sqrt();
    let beyond = (0..2).any(|i| s.attitude_rad[i].abs() > LEVEL[i]);
    !beyond
        && s.rates_radps.iter().all(|rate| rate.abs() < LEVEL_RATE)
        && CARRIED.contains(&(size / G))
}

fn vertical(rows: &[Sample]) -> Option<Finding> {
    let z = |s: &Sample| if is_level(s) { s.specific_force_mps2[2] } else { f64::NAN };
    let z = quantile(&values(rows, z), 0.5).filter(|z| *z > 5.0)?;
    let left = turns_left(rows);
    Some(if left {
        Finding::problem(
            "the axes look forward-left-up (FLU): az is positive, and r is negative in right turns; read ay_mps2, az_mps2, q_radps, r_radps, pitch_rad and yaw_rad with scale = -1 in a mapping (--mapping FILE)",
        )
    } else {
        let text = format!(
            "the median of az is {z:.2}: the z accelerometer looks positive up, while the log format's reads about -9.81 in level flight"
        );
        cured(text, "az_mps2", -1.0)
    })
}

/// Whether the yaw rate r is negative at bank to the right.
fn turns_left(rows: &[Sample]) -> bool {
    turn_with_bank(rows).is_some_and(|r| r < TURNED)
}

/// Correlation of the yaw rate r with the bank angle. In coordinated flight it is positive, because ψ̇ = g tan φ / V. `None` for too
/// few windows.
pub(super) fn turn_with_bank(rows: &[Sample]) -> Option<f64> {
    let pairs = windows(rows, WINDOW_S)
        .into_iter()
        .map(|w| (mean(w, |s| s.attitude_rad[0].tan()), mean(w, |s| s.rates_radps[2])));
    with_intercept(pairs).map(|r| r.correlation)
}

/// Findings on the signs of ax and ay. The measured values are compared with those that follow from the velocity.
///
/// The velocity relative to the air contains gusts, with which β changes against the side force: in gusts of 0.65 m/s the
/// correlation was −0.78 with the right sign of ay. A positive correlation by the velocity over ground therefore overrules it.
fn along_and_across(rows: &[Sample]) -> Vec<Finding> {
    let windows = windows(rows, WINDOW_S);
    [(0, "ax_mps2", "positive backward", "forward"), (1, "ay_mps2", "positive to the left", "to the right")]
        .into_iter()
        .filter(|(axis, ..)| {
            correlation(&windows, *axis, air_velocity).is_some_and(|r| r < TURNED)
                && correlation(&windows, *axis, ground_velocity).is_none_or(|r| r < 0.0)
        })
        .map(|(_, column, looks, right)| {
            cured(format!("{column} contradicts how the aircraft accelerates: it looks {looks}, while the log format's is positive {right}"), column, -1.0)
        })
        .collect()
}

/// Velocity relative to the air, body axes, m/s.
pub(super) fn air_velocity(s: &Sample) -> [f64; 3] {
    let alpha = if s.alpha_rad.is_finite() { s.alpha_rad } else { 0.0 };
    let beta = if s.beta_rad.is_finite() { s.beta_rad } else { 0.0 };
    let v = s.airspeed_mps;
    [v * alpha.cos() * beta.cos(), v * beta.sin(), v * alpha.sin() * beta.cos()]
}

/// Velocity over ground, body axes, m/s. NaN if it is not measured.
fn ground_velocity(s: &Sample) -> [f64; 3] {
    let [roll, pitch, yaw] = s.attitude_rad;
    let to_body = Rotation3::from_euler_angles(roll, pitch, yaw).inverse();
    (to_body * Vector3::from(s.velocity_ned_mps)).into()
}

/// Correlation of the measured specific force along the body axis `axis` (0 x, 1 y) with the one that follows from the velocity
/// `body` (u, v, w) by the equations of motion: f_x = u̇ + q w − r v + g sin θ and f_y = v̇ + r u − p w − g sin φ cos θ. `None` for
/// too few windows.
fn correlation(windows: &[&[Sample]], axis: usize, body: fn(&Sample) -> [f64; 3]) -> Option<f64> {
    let expected = |w: &[Sample]| {
        let time = w[w.len() - 1].time_s - w[0].time_s;
        let turning = |s: &Sample| {
            let ([u, v, w], [p, q, r]) = (body(s), s.rates_radps);
            let [roll, pitch, _] = s.attitude_rad;
            match axis {
                0 => q * w - r * v + G * pitch.sin(),
                _ => r * u - p * w - G * roll.sin() * pitch.cos(),
            }
        };
        change(w, |s| body(s)[axis]) / time + mean(w, turning)
    };
    let pairs = windows.iter().map(|w| (expected(w), mean(w, |s| s.specific_force_mps2[axis])));
    with_intercept(pairs).map(|r| r.correlation)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 40 s of level flight at 17 m/s through a crosswind of ±1 m/s with a period of 5 s. The aircraft turns into the wind like a
    /// weathercock (10 /s² per rad of sideslip, damping 2 /s), with a side force of −2 m/s² per rad.
    fn through_gusts() -> Vec<Sample> {
        const STEP: f64 = 0.01;
        let [mut v, mut r, mut yaw] = [0.0_f64; 3];
        let one = |k: usize| {
            let time_s = STEP * k as f64;
            let gust = (std::f64::consts::TAU * time_s / 5.0).sin();
            let beta = ((v - gust) / 17.0).asin();
            let (ay, (sin, cos)) = (-2.0 * beta, yaw.sin_cos());
            let sample = Sample {
                time_s,
                attitude_rad: [0.0, 0.0, yaw],
                rates_radps: [0.0, 0.0, r],
                airspeed_mps: 17.0,
                alpha_rad: 0.0,
                beta_rad: beta,
                specific_force_mps2: [0.0, ay, -G],
                velocity_ned_mps: [17.0 * cos - v * sin, 17.0 * sin + v * cos, 0.0],
                ..Sample::default()
            };
            v += STEP * (ay - 17.0 * r);
            yaw += STEP * r;
            r += STEP * (10.0 * beta - 2.0 * r);
            sample
        };
        (0..4000).map(one).collect()
    }

    #[test]
    fn a_side_force_against_the_sideslip_of_gusts_has_no_wrong_sign() {
        let rows = through_gusts();
        let by_air = correlation(&windows(&rows, WINDOW_S), 1, air_velocity).unwrap();
        assert!(by_air < TURNED, "{by_air}");
        assert!(along_and_across(&rows).is_empty());
        // without a velocity over ground the air decides alone, as it does for a log that has none
        let blind = |s: &Sample| Sample { velocity_ned_mps: [f64::NAN; 3], ..*s };
        let blind: Vec<Sample> = rows.iter().map(blind).collect();
        assert_eq!(along_and_across(&blind).len(), 1);
    }
}
