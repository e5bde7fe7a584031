//! Resamples a flight with a longer sample time to the model's step.
//!
//! States are interpolated by cubics from four samples (Catmull–Rom), controls linearly. This suits the smooth states of a
//! flight-path reconstruction. At 25 Hz, the cubics have an error of a few parts in a thousand. At 10 Hz, the fastest motions
//! of a small aircraft cannot be recovered between the samples.

use greylag_model::STEP;
use greylag_physics::{Controls, State};

/// Longest sample time for learning, s.
pub const SLOWEST_S: f64 = 0.1;

/// A sample: state, controls, altitude in m.
pub type Row = (State, Controls, f64);

/// Resamples `rows` from the sample time `step_s` (s) to [`STEP`], starting at the first row. Roll angles may wrap between
/// rows.
pub fn resampled(rows: &[Row], step_s: f64) -> Vec<Row> {
    if rows.len() < 2 {
        return rows.to_vec();
    }
    let end = (rows.len() - 1) as f64 * step_s;
    let count = (end / STEP + 1e-6).floor() as usize + 1;
    (0..count).map(|k| at(rows, k as f64 * STEP / step_s)).collect()
}

/// The row at the time `place`, in sample times after the first row, by interpolation.
fn at(rows: &[Row], place: f64) -> Row {
    let last = rows.len() - 1;
    let k = (place as usize).min(last - 1);
    let part = place - k as f64;
    // at either end the outermost sample replaces the missing one
    let around = [k.saturating_sub(1), k, k + 1, (k + 2).min(last)].map(|i| &rows[i]);
    let near = around[1].0.roll;
    let states = around.map(|(state, ..)| {
        let turns = ((state.roll - near) / std::f64::consts::TAU).round();
        State { roll: state.roll - turns * std::f64::consts::TAU, ..*state }.to_array()
    });
    let state = std::array::from_fn(|i| cubic(states.map(|s| s[i]), part));
    let controls = around[1].1.towards(&around[2].1, part);
    let altitude = around[1].2 + part * (around[2].2 - around[1].2);
    (State::from_array(state), controls, altitude)
}

/// The cubic through the two middle values, at the fraction `x` of the way between them. Its derivatives at these
/// values are central differences.
fn cubic([a, b, c, d]: [f64; 4], x: f64) -> f64 {
    let (first, last) = (0.5 * (c - a), 0.5 * (d - b));
    let bend = c - b;
    b + x * (first + x * (3.0 * bend - 2.0 * first - last + x * (first + last - 2.0 * bend)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(time: f64) -> Row {
        let state = State {
            roll: (time * 2.0).rem_euclid(std::f64::consts::TAU),
            p: (5.0 * time).sin(),
            ..State::NEUTRAL
        };
        (state, Controls { aileron: 0.1 * time, ..Controls::default() }, 600.0 + time)
    }

    /// A sinusoidal motion with the angular frequency 5 rad/s, sampled at 25 Hz.
    #[test]
    fn a_smooth_motion_is_found_between_the_samples() {
        let rows: Vec<Row> = (0..100).map(|k| row(0.04 * k as f64)).collect();
        let all = resampled(&rows, 0.04);
        assert_eq!(all.len(), 99 * 4 + 1);
        for (k, (state, controls, altitude)) in all.iter().enumerate().skip(4).take(388) {
            let (truth, act, height) = row(0.01 * k as f64);
            assert!((state.p - truth.p).abs() < 2e-3, "{k}: {} {}", state.p, truth.p);
            let turn = (state.roll - truth.roll).rem_euclid(std::f64::consts::TAU);
            assert!(turn.min(std::f64::consts::TAU - turn) < 1e-9, "{k}: {turn}");
            assert!((controls.aileron - act.aileron).abs() < 1e-12);
            assert!((altitude - height).abs() < 1e-9);
        }
    }

    #[test]
    fn samples_at_the_step_stay_as_they_are() {
        let rows: Vec<Row> = (0..5).map(|k| row(0.01 * k as f64)).collect();
        for (new, old) in resampled(&rows, 0.01).iter().zip(&rows) {
            assert!((new.0.p - old.0.p).abs() < 1e-12);
            assert!((new.1.aileron - old.1.aileron).abs() < 1e-12);
        }
        assert_eq!(resampled(&rows[..1], 0.05).len(), 1);
    }
}
