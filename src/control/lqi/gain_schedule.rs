//! The gain schedule of the LQI (linear-quadratic regulator with integral action): trims and gains over airspeed, roll and
//! pitch.

use rayon::prelude::*;

use crate::SetupError;
use crate::lqi::design::{Gain, Weights, design};
use greylag_model::{GreyBox, Trim};
use greylag_physics::State;
use greylag_physics::airframe::{Envelope, Incidence};

/// Equally spaced grid values of one scheduling variable, in its unit.
#[derive(Clone, Copy, Debug)]
struct Axis {
    first: f64,
    step: f64,
    count: usize,
}

/// Number of airspeeds in the grid.
const AIRSPEEDS: usize = 20;
/// Grid spacing of roll and pitch, degrees.
const SPACING_DEG: f64 = 10.0;
/// Largest angle of the grid, in units of the grid spacing (80°). It is below 90°, where no steady turn exists.
const STEEPEST: f64 = 8.0;

/// Grid over airspeed (m/s), roll and pitch (rad). It extends beyond the envelope. The angles are rounded outwards to multiples
/// of the spacing, and the airspeeds have a margin.
#[derive(Clone, Copy, Debug)]
struct Grid {
    airspeed: Axis,
    roll: Axis,
    pitch: Axis,
}

impl Grid {
    fn over(envelope: &Envelope) -> Grid {
        let slowest = (0.95 * envelope.airspeed_min_mps).floor().max(1.0);
        let fastest = (1.1 * envelope.airspeed_max_mps).ceil();
        let step = (fastest - slowest) / (AIRSPEEDS - 1) as f64;
        let bank = (envelope.bank_max_deg / SPACING_DEG).ceil().min(STEEPEST);
        let low = (envelope.pitch_min_deg / SPACING_DEG).floor().max(-STEEPEST);
        let high = (envelope.pitch_max_deg / SPACING_DEG).ceil().min(STEEPEST);
        Grid {
            airspeed: Axis { first: slowest, step, count: AIRSPEEDS },
            roll: Axis::attitude(-bank, bank),
            pitch: Axis::attitude(low, high),
        }
    }

    fn attitudes(&self) -> usize {
        self.roll.count * self.pitch.count
    }

    fn attitude(&self, index: usize) -> (f64, f64) {
        (self.roll.value(index / self.pitch.count), self.pitch.value(index % self.pitch.count))
    }
}

/// The schedule's value at a point: steady state and gain.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    /// φ θ p q r α β of the steady state, rad and rad/s.
    pub steady: [f64; 7],
    /// Deflections of aileron, elevator and rudder in the steady state, rad.
    pub deflection: [f64; 3],
    /// Throttle in the steady state, 0..1.
    pub throttle: f64,
    /// The gain at this point.
    pub gain: Gain,
}

/// Grid entries, with airspeed as the slowest index, and the lowest airspeeds of each attitude.
#[derive(Clone, Debug)]
pub(super) struct Schedule {
    grid: Grid,
    entries: Vec<Entry>,
    /// Lowest airspeed (m/s) of each attitude at which the angle of attack is at most `Incidence::comfortable`.
    comfortable: Vec<f64>,
    /// Lowest airspeed (m/s) of each attitude at which the angle of attack is at most `Incidence::tolerable`.
    tolerable: Vec<f64>,
}

impl Axis {
    /// The grid of an angle from `low` to `high`, both in units of the grid spacing.
    fn attitude(low: f64, high: f64) -> Axis {
        // computed from 30° instead of 10°, so that a multiple of 30° has the same bits as that multiple of π/6
        let first = low / 3.0 * std::f64::consts::FRAC_PI_6;
        Axis { first, step: std::f64::consts::PI / 18.0, count: (high - low) as usize + 1 }
    }

    fn value(self, index: usize) -> f64 {
        self.first + self.step * index as f64
    }

    /// The index of the grid value below `x`, and the weight of the grid value above it. Clamped to the grid's ends.
    fn place(self, x: f64) -> (usize, f64) {
        let place = ((x - self.first) / self.step).clamp(0.0, (self.count - 1) as f64);
        let low = (place as usize).min(self.count - 2);
        (low, place - low as f64)
    }
}

impl Schedule {
    /// Designs the whole grid from `model`, on all cores.
    ///
    /// A grid point without a trim or gain takes the design of the next higher airspeed that has one. If there is none, it takes
    /// the design of the highest airspeed that has one.
    pub(super) fn new(model: &GreyBox, weights: &Weights) -> Result<Schedule, SetupError> {
        let grid = Grid::over(&model.airframe.envelope);
        let all = (0..grid.attitudes()).into_par_iter();
        let columns: Vec<_> = all.map(|i| column(model, &grid, i, weights)).collect();
        if let Some(i) = columns.iter().position(|column| column.iter().all(Option::is_none)) {
            let (roll, pitch) = grid.attitude(i);
            return Err(SetupError::Design {
                model: model.name.clone(),
                roll_deg: roll.to_degrees(),
                pitch_deg: pitch.to_degrees(),
            });
        }
        let slowest = |alpha| columns.iter().map(|column| slowest(column, &grid, alpha)).collect();
        let entries = (0..AIRSPEEDS)
            .flat_map(|k| columns.iter().map(move |column| nearest(column, k)))
            .collect::<Option<Vec<_>>>()
            .unwrap_or_default();
        let Incidence { comfortable, tolerable, .. } = model.airframe.incidence;
        let (comfortable, tolerable) = (slowest(comfortable), slowest(tolerable));
        Ok(Schedule { grid, entries, comfortable, tolerable })
    }

    /// The entry at `airspeed` (m/s), `roll` and `pitch` (rad), by trilinear interpolation between grid points.
    pub(super) fn at(&self, airspeed: f64, roll: f64, pitch: f64) -> Entry {
        let Grid { airspeed: speeds, roll: rolls, pitch: pitches } = self.grid;
        let places = [speeds.place(airspeed), rolls.place(roll), pitches.place(pitch)];
        let gain = Gain::zeros(self.entries[0].gain.rudder.is_some());
        let mut sum = Entry { steady: [0.0; 7], deflection: [0.0; 3], throttle: 0.0, gain };
        for corner in 0..8 {
            let mut weight = 1.0;
            let mut index = [0; 3];
            for (axis, (low, part)) in places.into_iter().enumerate() {
                let upper = corner >> axis & 1;
                index[axis] = low + upper;
                weight *= if upper == 1 { part } else { 1.0 - part };
            }
            let at = (index[0] * rolls.count + index[1]) * pitches.count + index[2];
            let entry = &self.entries[at];
            for (s, e) in sum.steady.iter_mut().zip(entry.steady) {
                *s += weight * e;
            }
            for (s, e) in sum.deflection.iter_mut().zip(entry.deflection) {
                *s += weight * e;
            }
            sum.throttle += weight * entry.throttle;
            sum.gain.add(&entry.gain, weight);
        }
        sum
    }

    /// The lowest airspeed (m/s) of an attitude (rad) at which the angle of attack is at most `Incidence::comfortable`.
    pub(super) fn comfortable_airspeed(&self, roll: f64, pitch: f64) -> f64 {
        self.over_attitude(&self.comfortable, roll, pitch)
    }

    /// The largest fraction (0..=1) of `roll` (rad) at which steady flight at `airspeed` (m/s) and `pitch` (rad) requires at most
    /// the angle of attack `Incidence::tolerable`. The fraction is accurate to 1/256.
    pub(super) fn tolerable_part(&self, airspeed: f64, roll: f64, pitch: f64) -> f64 {
        let allowed =
            |part: f64| self.over_attitude(&self.tolerable, part * roll, pitch) <= airspeed;
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

    /// Bilinear interpolation over roll and pitch.
    fn over_attitude(&self, values: &[f64], roll: f64, pitch: f64) -> f64 {
        let Grid { roll: rolls, pitch: pitches, .. } = self.grid;
        let ((i, x), (j, y)) = (rolls.place(roll), pitches.place(pitch));
        let at = |i: usize, j: usize| values[i * pitches.count + j];
        (at(i, j) * (1.0 - y) + at(i, j + 1) * y) * (1.0 - x)
            + (at(i + 1, j) * (1.0 - y) + at(i + 1, j + 1) * y) * x
    }
}

/// The lowest airspeed (m/s) of a column at which the angle of attack is at most `alpha` (rad), interpolated linearly between
/// designs. If no design meets the limit, the result is the grid's highest airspeed.
fn slowest(column: &[Option<Entry>], grid: &Grid, alpha: f64) -> f64 {
    let airspeeds = grid.airspeed;
    let needs = |k: usize| column[k].map(|entry| entry.steady[5]);
    let Some(k) = (0..column.len()).find(|&k| needs(k).is_some_and(|a| a <= alpha)) else {
        return airspeeds.value(airspeeds.count - 1);
    };
    match k.checked_sub(1).and_then(needs).zip(needs(k)) {
        Some((slower, here)) => {
            airspeeds.value(k) - airspeeds.step * (alpha - here) / (slower - here)
        }
        None => airspeeds.value(k),
    }
}

/// The designs of one attitude over airspeed. `None` where a design fails.
fn column(model: &GreyBox, grid: &Grid, index: usize, weights: &Weights) -> Vec<Option<Entry>> {
    let (roll, pitch) = grid.attitude(index);
    let altitude = model.airframe.reference.altitude;
    let figures = &model.airframe.actuators;
    (0..AIRSPEEDS)
        .map(|k| {
            let trim = Trim::attitude(model, roll, pitch, grid.airspeed.value(k), altitude).ok()?;
            let State { roll, pitch, p, q, r, alpha, beta, .. } = trim.state;
            let c = trim.controls;
            let rudder_reaches = figures.rudder.is_none_or(|s| s.travel.reaches(c.rudder));
            let flyable = alpha.abs() < 0.5
                && figures.aileron.travel.reaches(c.aileron)
                && figures.elevator.travel.reaches(c.elevator)
                && rudder_reaches;
            Some(Entry {
                steady: [roll, pitch, p, q, r, alpha, beta],
                deflection: [c.aileron, c.elevator, c.rudder],
                throttle: c.throttle,
                gain: flyable.then(|| design(model, &trim, altitude, weights))??,
            })
        })
        .collect()
}

/// The design at the airspeed with index `k`. Without one, the design at the next higher airspeed that has one, or else at the
/// highest airspeed that has one.
fn nearest(column: &[Option<Entry>], k: usize) -> Option<Entry> {
    column[k..].iter().flatten().next().or_else(|| column.iter().flatten().last()).copied()
}
