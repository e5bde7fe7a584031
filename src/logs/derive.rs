//! Computes columns that a log lacks from other columns, if the user's mapping file requests it.
//!
//! A motion capture measures position and attitude. A velocity is the slope of a cubic polynomial that is fitted to the
//! positions around a row (Savitzky and Golay, Analytical Chemistry 36, 1964). Body rates are found in the same way, as slopes of
//! the rotations relative to the row's attitude. The airspeed is the magnitude of the velocity over ground minus a known wind.
//! The mapping states the time span T of the fits. A motion of the angular frequency ω keeps all but the part (ωT)⁴/8064 of its
//! rate; a parabola would lose (ωT)²/40.

use nalgebra::{Matrix4, UnitQuaternion, Vector3, Vector4};

use super::Sample;
use super::columns::{COLUMNS, index};
use super::mapping::Mapping;
use greylag_num::statistics::quantile;

/// Smallest number of rows to which a polynomial is fitted.
const FEWEST: usize = 5;
/// Time before and after a row that must have samples for a cubic, as a fraction of the time span. The slope of a cubic at the end
/// of a span is noisy.
const LEAST_SIDE: f64 = 0.2;
/// The measurement counts as a jump if the residual of a cubic exceeds the log's median residual by this factor.
const JUMPED: f64 = 8.0;
/// Smallest residual, as a fraction of the largest value of the column (for rotations, in rad). Smaller residuals are
/// rounding errors and are raised to it.
const ROUNDING: f64 = 1e-9;
/// The columns of the body rates.
pub(super) const RATES: [&str; 3] = ["p_radps", "q_radps", "r_radps"];
/// The column of the airspeed.
pub(super) const AIRSPEED: &str = "airspeed_mps";

/// Fills the columns that `mapping` derives from others. Returns notes for the user.
pub(super) fn apply(rows: &mut [Sample], mapping: &Mapping) -> Vec<String> {
    let mut notes = Vec::new();
    let slopes: Vec<(&str, f64)> = mapping.slopes().collect();
    for (column, over_s) in &slopes {
        let Some(i) = index(column) else { continue };
        let samples: Vec<(f64, f64)> = rows.iter().map(|s| (s.time_s, COLUMNS[i].1(s))).collect();
        let (slopes, jumped) = settle(slopes_of(&fresh(&samples), *over_s));
        rows.iter_mut().zip(slopes).for_each(|(row, x)| *COLUMNS[i].2(row) = x);
        if jumped > 0 {
            notes.push(format!(
                "{column}: {jumped} rows are left empty, for what it is made from jumps there"
            ));
        }
    }
    if !slopes.is_empty() {
        let names: Vec<&str> = slopes.iter().map(|(column, _)| *column).collect();
        notes.push(format!("rates of change, by a cubic around each row: {}", names.join(", ")));
    }
    if let Some(over_s) = mapping.body_rates_over_s() {
        let jumped = body_rates(rows, over_s);
        notes.push(format!("body rates are made from roll, pitch and yaw over {over_s} s"));
        if jumped > 0 {
            notes.push(format!(
                "the attitude jumps or is lost in {jumped} rows: their body rates are left empty"
            ));
        }
    }
    if mapping.makes(AIRSPEED)
        && let Some(wind) = mapping.sensors().wind()
        && rows.iter().all(|s| s.airspeed_mps.is_nan())
    {
        for s in rows.iter_mut() {
            s.airspeed_mps = (Vector3::from(s.velocity_ned_mps) - Vector3::from(wind)).norm();
        }
        notes.push("airspeed is made from the velocity over ground and the stated wind".into());
    }
    if let Some(board) = mapping.board() {
        rows.iter_mut().for_each(|row| board.turn(row));
        notes.push(board.to_string());
    }
    notes
}

/// Replaces a value that repeats the previous one by NaN. A motion capture that has lost its object repeats the last
/// value.
fn fresh(samples: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut last = f64::NAN;
    let one = |(t, x): &(f64, f64)| {
        let fresh = if *x == last { f64::NAN } else { *x };
        if x.is_finite() {
            last = *x;
        }
        (*t, fresh)
    };
    samples.iter().map(one).collect()
}

/// Slope of the cubic around each sample, and root mean square of its residuals. Both are NaN where a sample has no
/// value.
fn slopes_of(samples: &[(f64, f64)], over_s: f64) -> Vec<[f64; 2]> {
    let scale = samples.iter().map(|s| s.1.abs()).filter(|x| x.is_finite()).fold(0.0, f64::max);
    around(
        samples,
        |s| s.0,
        over_s,
        |k, window| {
            let (t, x) = samples[k];
            if !x.is_finite() {
                return [f64::NAN; 2];
            }
            let points = window.iter().filter(|s| s.1.is_finite()).map(|s| (s.0 - t, s.1 - x));
            cubic(&points.collect::<Vec<_>>(), over_s)
                .map_or([f64::NAN; 2], |[slope, misfit]| [slope, misfit.max(ROUNDING * scale)])
        },
    )
}

/// Fills p, q, r (rad/s). Returns the number of rows in which the attitude was lost or jumped.
fn body_rates(rows: &mut [Sample], over_s: f64) -> usize {
    let mut last = [f64::NAN; 3];
    let turned: Vec<(f64, Option<UnitQuaternion<f64>>)> = rows
        .iter()
        .map(|s| {
            let [roll, pitch, yaw] = s.attitude_rad;
            let lost = s.attitude_rad == last || !s.attitude_rad.iter().all(|x| x.is_finite());
            last = s.attitude_rad;
            (s.time_s, (!lost).then(|| UnitQuaternion::from_euler_angles(roll, pitch, yaw)))
        })
        .collect();
    let fits = around(
        &turned,
        |s| s.0,
        over_s,
        |k, window| {
            let (t, Some(own)) = &turned[k] else { return [[f64::NAN; 2]; 3] };
            let turns: Vec<(f64, Vector3<f64>)> = window
                .iter()
                .filter_map(|(time, other)| {
                    Some((time - t, (own.inverse() * other.as_ref()?).scaled_axis()))
                })
                .collect();
            std::array::from_fn(|axis| {
                let points: Vec<(f64, f64)> =
                    turns.iter().map(|(t, turn)| (*t, turn[axis])).collect();
                cubic(&points, over_s)
                    .map_or([f64::NAN; 2], |[slope, misfit]| [slope, misfit.max(ROUNDING)])
            })
        },
    );
    let mut empty = vec![false; rows.len()];
    for axis in 0..3 {
        let (slopes, _) = settle(fits.iter().map(|f| f[axis]).collect());
        for (k, slope) in slopes.into_iter().enumerate() {
            rows[k].rates_radps[axis] = slope;
            empty[k] |= slope.is_nan();
        }
    }
    let mut count = 0;
    for (row, _) in rows.iter_mut().zip(&empty).filter(|(_, empty)| **empty) {
        row.rates_radps = [f64::NAN; 3];
        count += 1;
    }
    count
}

/// Calls `fit` for each sample, with its index and with the samples within half of `over_s` (s) around it.
fn around<T, R>(
    samples: &[T],
    time: impl Fn(&T) -> f64,
    over_s: f64,
    fit: impl Fn(usize, &[T]) -> R,
) -> Vec<R> {
    let half = 0.5 * over_s * (1.0 + 1e-6);
    let (mut from, mut to) = (0, 0);
    let one = |k: usize| {
        let t = time(&samples[k]);
        while from < k && time(&samples[from]) < t - half {
            from += 1;
        }
        to = to.max(k);
        while to < samples.len() && time(&samples[to]) <= t + half {
            to += 1;
        }
        fit(k, &samples[from..to])
    };
    (0..samples.len()).map(one).collect()
}

/// The slope at time 0 of the cubic fitted to `points` (time, value), and the root mean square of the residuals. Near the end of
/// a record a parabola takes its place. `None` if there are too few points, or none on one side.
fn cubic(points: &[(f64, f64)], over_s: f64) -> Option<[f64; 2]> {
    let within =
        |least: f64| points.iter().any(|p| p.0 < -least) && points.iter().any(|p| p.0 > least);
    if points.len() < FEWEST || !within(0.0) {
        return None;
    }
    let third = if within(LEAST_SIDE * over_s) { 1.0 } else { 0.0 };
    let row = |t: f64| {
        let t = t / over_s;
        Vector4::new(1.0, t, t.powi(2), third * t.powi(3))
    };
    let mut gram = Matrix4::from_diagonal(&Vector4::new(0.0, 0.0, 0.0, 1.0 - third));
    let mut right = Vector4::zeros();
    for (t, x) in points {
        let row = row(*t);
        gram += row * row.transpose();
        right += row * *x;
    }
    let fit = gram.cholesky()?.solve(&right);
    let left: f64 = points.iter().map(|(t, x)| (x - row(*t).dot(&fit)).powi(2)).sum();
    Some([fit[1] / over_s, (left / points.len() as f64).sqrt()])
}

/// Returns the slopes of `fits`, with NaN where the residual exceeds `JUMPED` times the median, and the number of these.
fn settle(fits: Vec<[f64; 2]>) -> (Vec<f64>, usize) {
    let misfits: Vec<f64> = fits.iter().map(|f| f[1]).filter(|x| x.is_finite()).collect();
    let limit = if misfits.is_empty() { f64::INFINITY } else { JUMPED * quantile(&misfits, 0.5) };
    let mut jumped = 0;
    let one = |[slope, misfit]: [f64; 2]| {
        if misfit > limit {
            jumped += 1;
            return f64::NAN;
        }
        slope
    };
    (fits.into_iter().map(one).collect(), jumped)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    const MAPPING: &str = "schema = 1\n[columns]\nvn_mps = { from = \"csv.x\", rate_over_s = 0.07 }\n\
        ve_mps = { from = \"csv.y\", rate_over_s = 0.07 }\nvd_mps = { from = \"csv.z\", rate_over_s = 0.07 }\n\
        [derive]\nbody_rates_over_s = 0.07\n[sensors]\nwind_north_mps = { value = 2.0, sd = 0.1 }\n\
        wind_east_mps = { value = 0.0, sd = 0.1 }\n";

    /// A sample of a turn with pitch 0.1 rad, bank 0.5 rad, ψ̇ = 0.6 rad/s, and 8 m/s over ground along its heading. The
    /// velocity columns hold positions, which the mapping differentiates.
    fn turn(k: usize) -> Sample {
        let (t, turn, v) = (0.01 * k as f64, 0.6, 8.0);
        let yaw: f64 = turn * t;
        Sample {
            time_s: t,
            attitude_rad: [
                0.5,
                0.1,
                (yaw + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU)
                    - std::f64::consts::PI,
            ],
            velocity_ned_mps: [v / turn * yaw.sin(), -v / turn * yaw.cos(), -0.3 * t],
            ..Sample::default()
        }
    }

    fn derived(mut rows: Vec<Sample>) -> (Vec<Sample>, Vec<String>) {
        let mapping = Mapping::parse(MAPPING, Path::new("m.toml")).unwrap();
        let notes = apply(&mut rows, &mapping);
        (rows, notes)
    }

    #[test]
    fn a_turn_has_the_rates_and_the_velocity_of_its_equations() {
        let (rows, _) = derived((0..1000).map(turn).collect());
        for s in &rows[10..990] {
            // p = −ψ̇ sin θ, q = ψ̇ cos θ sin φ, r = ψ̇ cos θ cos φ; the error of a cubic over the time T is far below the tolerance
            let exact = [
                -0.6 * 0.1_f64.sin(),
                0.6 * 0.1_f64.cos() * 0.5_f64.sin(),
                0.6 * 0.1_f64.cos() * 0.5_f64.cos(),
            ];
            assert!(s.rates_radps.iter().zip(exact).all(|(a, b)| (a - b).abs() < 1e-4), "{s:?}");
            let yaw = 0.6 * s.time_s;
            let v = [8.0 * yaw.cos(), 8.0 * yaw.sin(), -0.3];
            assert!(s.velocity_ned_mps.iter().zip(v).all(|(a, b)| (a - b).abs() < 1e-3), "{s:?}");
            let airspeed = ((v[0] - 2.0).powi(2) + v[1] * v[1] + v[2] * v[2]).sqrt();
            assert!((s.airspeed_mps - airspeed).abs() < 2e-3);
        }
    }

    #[test]
    fn rows_in_which_the_object_is_lost_or_jumps_are_left_empty() {
        let mut rows: Vec<Sample> = (0..300).map(turn).collect();
        for k in 100..150 {
            (rows[k].attitude_rad, rows[k].velocity_ned_mps) =
                (rows[99].attitude_rad, rows[99].velocity_ned_mps);
        }
        rows[220].attitude_rad[1] += 0.2;
        let (rows, notes) = derived(rows);
        assert!(
            rows[102..148]
                .iter()
                .all(|s| s.rates_radps[0].is_nan() && s.velocity_ned_mps[0].is_nan())
        );
        assert!(rows[218..=222].iter().all(|s| s.rates_radps[1].is_nan()));
        assert!(rows[10..90].iter().chain(&rows[160..210]).all(|s| s.rates_radps[1].is_finite()));
        assert!(notes.iter().any(|n| n.contains("jumps")), "{notes:?}");
    }
}
