//! Division of a flight into manoeuvres, by body rates, surfaces, bank angle and throttle.
//!
//! Root mean squares (RMS) and standard deviations are computed over the second around a sample and compared with bounds. A
//! sample belongs to a roll manoeuvre if the RMS roll rate or the standard deviation of the aileron exceeds its bound. It belongs
//! to a pitch manoeuvre if the RMS rate of the pitch angle or the standard deviation of the elevator exceeds its bound. Any other
//! sample belongs to a change of thrust if the standard deviation of the throttle exceeds its bound. The remaining samples belong
//! to a turn if the bank angle is large, otherwise to steady flight. A manoeuvre shorter than half a second is added to the one
//! before.

use crate::flight_path::reconstruction::{Instant, Reconstruction, Segment};

/// RMS roll rate above which a sample belongs to a roll manoeuvre, rad/s.
const ROLL_RATE: f64 = 0.15;
/// RMS rate of the pitch angle above which a sample belongs to a pitch manoeuvre, rad/s.
const PITCH_RATE: f64 = 0.08;
/// Standard deviation of the deflection above which a sample belongs to a roll or pitch manoeuvre, rad.
const DEFLECTION: f64 = 0.03;
/// Standard deviation of the throttle (0..1) above which a sample belongs to a change of thrust.
const THROTTLE: f64 = 0.05;
/// Bank angle above which a sample without other manoeuvre belongs to a turn, rad.
const BANK: f64 = 0.26;
/// Time over which root mean squares and standard deviations are computed, s.
const WINDOW: f64 = 1.0;
/// Shortest manoeuvre, s.
const SHORTEST: f64 = 0.5;

/// Kind of a manoeuvre.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ManoeuvreKind {
    /// The bank angle is small, and neither surfaces nor throttle move.
    Steady,
    /// The bank angle is large, and neither surfaces nor throttle move.
    Turn,
    /// The throttle moves, and the surfaces do not.
    Thrust,
    /// The ailerons move, or the roll rate is large.
    Roll,
    /// The elevator moves, or the pitch angle changes.
    Pitch,
    /// The conditions of a roll and of a pitch manoeuvre hold at once.
    RollAndPitch,
}

/// A stretch of flight with one kind of manoeuvre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Manoeuvre {
    /// Start on the log's clock, s.
    pub start_s: f64,
    /// End on the log's clock, s.
    pub end_s: f64,
    /// Kind of the manoeuvre.
    pub kind: ManoeuvreKind,
}

/// The manoeuvres of a flight in order of time. In each segment of the flight they follow each other without gaps.
pub fn manoeuvres(flight: &Reconstruction) -> Vec<Manoeuvre> {
    flight.segments.iter().flat_map(|s| of_segment(s, flight.step_s)).collect()
}

fn of_segment(segment: &Segment, step: f64) -> Vec<Manoeuvre> {
    let kinds = kinds(&segment.instants, step);
    let mut found: Vec<Manoeuvre> = Vec::new();
    for (instant, kind) in segment.instants.iter().zip(kinds) {
        let t = instant.time_s;
        match found.last_mut() {
            Some(last) if last.kind == kind => last.end_s = t,
            Some(last) => {
                last.end_s = t;
                found.push(Manoeuvre { start_s: t, end_s: t, kind });
            }
            None => found.push(Manoeuvre { start_s: t, end_s: t, kind }),
        }
    }
    let mut merged: Vec<Manoeuvre> = Vec::new();
    for m in found {
        match merged.last_mut() {
            Some(last) if last.kind == m.kind || m.end_s - m.start_s < SHORTEST => {
                last.end_s = m.end_s;
            }
            _ => merged.push(m),
        }
    }
    merged
}

fn kinds(instants: &[Instant], step: f64) -> Vec<ManoeuvreKind> {
    let half = (WINDOW / step / 2.0).round() as usize;
    let level = |get: &dyn Fn(&Instant) -> f64| root_mean_square(instants, half, 0.0, get);
    let about_mean = |get: &dyn Fn(&Instant) -> f64| root_mean_square(instants, half, 1.0, get);
    let roll = level(&|i| i.state.p);
    let pitch = level(&|i| i.state.roll.cos() * i.state.q - i.state.roll.sin() * i.state.r);
    let aileron = about_mean(&|i| i.controls.aileron);
    let elevator = about_mean(&|i| i.controls.elevator);
    let throttle = about_mean(&|i| i.controls.throttle);
    (0..instants.len())
        .map(|k| {
            let rolls = roll[k] > ROLL_RATE || aileron[k] > DEFLECTION;
            let pitches = pitch[k] > PITCH_RATE || elevator[k] > DEFLECTION;
            match (rolls, pitches) {
                (true, true) => ManoeuvreKind::RollAndPitch,
                (true, false) => ManoeuvreKind::Roll,
                (false, true) => ManoeuvreKind::Pitch,
                _ if throttle[k] > THROTTLE => ManoeuvreKind::Thrust,
                _ if instants[k].state.roll.abs() > BANK => ManoeuvreKind::Turn,
                _ => ManoeuvreKind::Steady,
            }
        })
        .collect()
}

/// For each sample, √(mean square − `share` × squared mean) of the quantity `get`, over the sample and `half` samples on each
/// side.
fn root_mean_square(
    instants: &[Instant],
    half: usize,
    share: f64,
    get: &dyn Fn(&Instant) -> f64,
) -> Vec<f64> {
    let mut sums = vec![[0.0; 2]];
    for x in instants.iter().map(get) {
        let [a, b] = sums[sums.len() - 1];
        sums.push([a + x, b + x * x]);
    }
    (0..instants.len())
        .map(|k| {
            let (from, to) = (k.saturating_sub(half), (k + half + 1).min(instants.len()));
            let n = (to - from) as f64;
            let [mean, square] = [0, 1].map(|i| (sums[to][i] - sums[from][i]) / n);
            (square - share * mean * mean).max(0.0).sqrt()
        })
        .collect()
}
