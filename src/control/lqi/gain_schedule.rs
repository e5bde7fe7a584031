//! The gain schedule: trims with their gains over airspeed, roll and pitch.

use rayon::prelude::*;

use crate::control::SetupError;
use crate::control::lqi::design::{Gain, Weights, design};
use crate::model::{GreyBox, Trim};
use crate::physics::State;

/// Altitude of the designs, m: the start of an episode.
const ALTITUDE: f64 = 600.0;

/// Incidence that steady flight should not exceed, rad (2.9°): a quarter of the X8's stall at
/// 12.3°, which at 60° of bank asks for 22 m/s.
const COMFORT: f64 = 0.05;

/// Incidence that no commanded attitude may need, rad (5.2°): the rest is for the transient.
const TOLERABLE: f64 = 0.09;

/// Equally spaced values of one scheduling variable.
#[derive(Clone, Copy, Debug)]
struct Axis {
    first: f64,
    step: f64,
    count: usize,
}

/// Airspeed in m/s, roll in rad, pitch in rad.
const AIRSPEED: Axis = Axis { first: 12.0, step: 2.0, count: 20 };
const ROLL: Axis =
    Axis { first: -std::f64::consts::FRAC_PI_3, step: std::f64::consts::PI / 18.0, count: 13 };
const PITCH: Axis =
    Axis { first: -std::f64::consts::FRAC_PI_6, step: std::f64::consts::PI / 18.0, count: 7 };

/// What the schedule holds at a point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    /// φ θ p q r α β of the steady condition, rad and rad/s.
    pub steady: [f64; 7],
    /// Aileron and elevator that hold it, rad.
    pub deflection: [f64; 2],
    /// Throttle that holds it, 0..1.
    pub throttle: f64,
    /// The gain there.
    pub gain: Gain,
}

/// Entries over the grid, airspeed slowest, with the smallest airspeeds per attitude.
#[derive(Clone, Debug)]
pub(super) struct Schedule {
    entries: Vec<Entry>,
    /// Airspeed (m/s) from which on each attitude can be held with a margin before the stall.
    comfortable: Vec<f64>,
    /// Airspeed (m/s) from which on it can be held at all.
    tolerable: Vec<f64>,
}

impl Axis {
    fn value(self, index: usize) -> f64 {
        self.first + self.step * index as f64
    }

    /// The lower neighbour of `x` with the share of the upper one, held at the ends.
    fn place(self, x: f64) -> (usize, f64) {
        let place = ((x - self.first) / self.step).clamp(0.0, (self.count - 1) as f64);
        let low = (place as usize).min(self.count - 2);
        (low, place - low as f64)
    }
}

impl Schedule {
    /// Designs the whole grid from `model`, on all cores.
    ///
    /// A condition that cannot be trimmed takes the design of the next higher airspeed.
    pub(super) fn new(model: &GreyBox, weights: &Weights) -> Result<Schedule, SetupError> {
        let attitudes = ROLL.count * PITCH.count;
        let columns: Vec<_> =
            (0..attitudes).into_par_iter().map(|i| column(model, i, weights)).collect();
        if let Some(i) = columns.iter().position(|column| column.iter().all(Option::is_none)) {
            let (roll, pitch) = attitude(i);
            return Err(SetupError::Design {
                model: model.name.clone(),
                roll_deg: roll.to_degrees(),
                pitch_deg: pitch.to_degrees(),
            });
        }
        let slowest = |alpha| columns.iter().map(|column| slowest(column, alpha)).collect();
        let entries = (0..AIRSPEED.count)
            .flat_map(|k| columns.iter().map(move |column| nearest(column, k)))
            .collect::<Option<Vec<_>>>()
            .unwrap_or_default();
        Ok(Schedule { entries, comfortable: slowest(COMFORT), tolerable: slowest(TOLERABLE) })
    }

    /// The entry at `airspeed` (m/s), `roll` and `pitch` (rad), linear between grid points.
    pub(super) fn at(&self, airspeed: f64, roll: f64, pitch: f64) -> Entry {
        let places = [AIRSPEED.place(airspeed), ROLL.place(roll), PITCH.place(pitch)];
        let mut sum =
            Entry { steady: [0.0; 7], deflection: [0.0; 2], throttle: 0.0, gain: Gain::zeros() };
        for corner in 0..8 {
            let mut weight = 1.0;
            let mut index = [0; 3];
            for (axis, (low, part)) in places.into_iter().enumerate() {
                let upper = corner >> axis & 1;
                index[axis] = low + upper;
                weight *= if upper == 1 { part } else { 1.0 - part };
            }
            let entry = &self.entries[(index[0] * ROLL.count + index[1]) * PITCH.count + index[2]];
            for (s, e) in sum.steady.iter_mut().zip(entry.steady) {
                *s += weight * e;
            }
            for (s, e) in sum.deflection.iter_mut().zip(entry.deflection) {
                *s += weight * e;
            }
            sum.throttle += weight * entry.throttle;
            sum.gain += entry.gain * weight;
        }
        sum
    }

    /// The airspeed (m/s) from which on the attitude can be held with a margin before the stall.
    pub(super) fn comfortable_airspeed(&self, roll: f64, pitch: f64) -> f64 {
        over_attitude(&self.comfortable, roll, pitch)
    }

    /// The part (0..=1) of `roll` that `airspeed` (m/s) allows at `pitch`.
    pub(super) fn tolerable_part(&self, airspeed: f64, roll: f64, pitch: f64) -> f64 {
        let allowed = |part: f64| over_attitude(&self.tolerable, part * roll, pitch) <= airspeed;
        if allowed(1.0) {
            return 1.0;
        }
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..8 {
            let middle = 0.5 * (low + high);
            if allowed(middle) { low = middle } else { high = middle }
        }
        low
    }
}

/// Bilinear interpolation of one number per attitude.
fn over_attitude(values: &[f64], roll: f64, pitch: f64) -> f64 {
    let ((i, x), (j, y)) = (ROLL.place(roll), PITCH.place(pitch));
    let at = |i: usize, j: usize| values[i * PITCH.count + j];
    (at(i, j) * (1.0 - y) + at(i, j + 1) * y) * (1.0 - x)
        + (at(i + 1, j) * (1.0 - y) + at(i + 1, j + 1) * y) * x
}

/// The lowest airspeed (m/s) of a column that needs no more incidence than `alpha` (rad), linear
/// between designs; the highest of the grid if none does.
fn slowest(column: &[Option<Entry>], alpha: f64) -> f64 {
    let needs = |k: usize| column[k].map(|entry| entry.steady[5]);
    let Some(k) = (0..column.len()).find(|&k| needs(k).is_some_and(|a| a <= alpha)) else {
        return AIRSPEED.value(AIRSPEED.count - 1);
    };
    match k.checked_sub(1).and_then(needs).zip(needs(k)) {
        Some((slower, here)) => {
            AIRSPEED.value(k) - AIRSPEED.step * (alpha - here) / (slower - here)
        }
        None => AIRSPEED.value(k),
    }
}

fn attitude(index: usize) -> (f64, f64) {
    (ROLL.value(index / PITCH.count), PITCH.value(index % PITCH.count))
}

/// The designs of one attitude over airspeed; `None` where there is none.
fn column(model: &GreyBox, index: usize, weights: &Weights) -> Vec<Option<Entry>> {
    let (roll, pitch) = attitude(index);
    (0..AIRSPEED.count)
        .map(|k| {
            let trim = Trim::attitude(model, roll, pitch, AIRSPEED.value(k), ALTITUDE).ok()?;
            let State { roll, pitch, p, q, r, alpha, beta, .. } = trim.state;
            let stop = model.airframe.actuators.deflection_max;
            let c = trim.controls;
            let flyable = alpha.abs() < 0.5 && c.aileron.abs() < stop && c.elevator.abs() < stop;
            Some(Entry {
                steady: [roll, pitch, p, q, r, alpha, beta],
                deflection: [c.aileron, c.elevator],
                throttle: c.throttle,
                gain: flyable.then(|| design(model, &trim, ALTITUDE, weights))??,
            })
        })
        .collect()
}

/// The design at airspeed `k`, or the next one above, or the highest there is.
fn nearest(column: &[Option<Entry>], k: usize) -> Option<Entry> {
    column[k..].iter().flatten().next().or_else(|| column.iter().flatten().last()).copied()
}
