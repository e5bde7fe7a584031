//! Excitations for system identification: signals that are added to a command or a target during a step of a flight-test
//! schedule.

use std::f64::consts::TAU;

use rand::RngExt;

use greylag_num::stream::stream;

/// Number of sines in a multisine.
const LINES: usize = 7;
/// Fade-in and fade-out time of a multisine, s. Without fading, the signal would step at its ends, which would excite the
/// aircraft in addition.
const FADE_S: f64 = 0.25;

/// The excited command or target.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Axis {
    /// The aileron command, −1..1.
    Aileron,
    /// The elevator command, −1..1.
    Elevator,
    /// The throttle command, 0..1.
    Throttle,
    /// The rudder command, −1..1. It has no effect on an aircraft without a rudder.
    Rudder,
    /// The roll target, rad.
    Roll,
    /// The pitch target, rad.
    Pitch,
    /// The airspeed target, m/s.
    Airspeed,
}

impl Axis {
    /// All axes that can be excited.
    pub const ALL: [Axis; 7] = [
        Axis::Aileron,
        Axis::Elevator,
        Axis::Throttle,
        Axis::Rudder,
        Axis::Roll,
        Axis::Pitch,
        Axis::Airspeed,
    ];

    /// Name in schedule files.
    pub const fn name(self) -> &'static str {
        match self {
            Axis::Aileron => "aileron",
            Axis::Elevator => "elevator",
            Axis::Throttle => "throttle",
            Axis::Rudder => "rudder",
            Axis::Roll => "roll",
            Axis::Pitch => "pitch",
            Axis::Airspeed => "airspeed",
        }
    }
}

/// Waveform of an excitation with unit amplitude.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A rectangular pulse: +1 for `width` (s).
    Step {
        /// Duration, s. If infinite, the excitation lasts to the end of the schedule's step.
        width: f64,
    },
    /// A doublet: +1, then −1, each for `width` (s).
    Doublet {
        /// Duration of each part, s.
        width: f64,
    },
    /// A 3-2-1-1: +1 for 3 `width`, −1 for 2 `width`, +1 for `width`, −1 for `width` (s).
    ThreeTwoOneOne {
        /// The unit duration, s.
        width: f64,
    },
    /// A sum of sines with frequencies from `low` to `high` (Hz) and random phases. Its power is that of one sine of amplitude
    /// 1.
    Multisine {
        /// Lowest frequency of the band, Hz.
        low: f64,
        /// Highest frequency of the band, Hz.
        high: f64,
        /// Seed of frequencies and phases. Multisines of different seeds are independent.
        seed: u64,
        /// Angular frequency (rad/s) and phase (rad) of each line.
        lines: Vec<[f64; 2]>,
    },
}

impl Shape {
    /// A multisine from `low` to `high` (Hz), drawn from `seed`.
    pub fn multisine(low: f64, high: f64, seed: u64) -> Shape {
        let mut random = stream(seed, &[3211]);
        let lines = (0..LINES)
            .map(|k| {
                let place: f64 = (k as f64 + random.random::<f64>()) / LINES as f64;
                [TAU * low * (high / low).powf(place), TAU * random.random::<f64>()]
            })
            .collect();
        Shape::Multisine { low, high, seed, lines }
    }
}

/// An excitation of one axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Excitation {
    /// The axis that is excited.
    pub axis: Axis,
    /// Amplitude in the axis's unit. A negative amplitude reverses the sign.
    pub amplitude: f64,
    /// Start of the excitation after the start of the schedule's step, s.
    pub start: f64,
    /// Waveform of the excitation.
    pub shape: Shape,
    /// Fraction (0..=1) of the controller's reaction on this axis that is applied during the excitation. The reaction is the
    /// change of the controller's command since the start of the excitation. With the full reaction, a good controller would
    /// cancel the excitation before the aircraft responds.
    pub authority: f64,
}

impl Excitation {
    /// Makes an excitation of `axis`. `amplitude` is in the axis's unit. `start` (s) counts from the start of the schedule's
    /// step. The controller's reaction is applied in full.
    pub fn new(axis: Axis, amplitude: f64, start: f64, shape: Shape) -> Excitation {
        Excitation { axis, amplitude, start, shape, authority: 1.0 }
    }

    /// The same excitation, with only the fraction `authority` (0..=1) of the controller's reaction applied.
    pub fn against(self, authority: f64) -> Excitation {
        Excitation { authority, ..self }
    }

    /// Duration, s. If infinite, the excitation lasts to the end of the schedule's step.
    pub fn length(&self) -> f64 {
        match self.shape {
            Shape::Step { width } => width,
            Shape::Doublet { width } => 2.0 * width,
            Shape::ThreeTwoOneOne { width } => 7.0 * width,
            Shape::Multisine { .. } => f64::INFINITY,
        }
    }

    /// Upper bound of the absolute value, in the axis's unit.
    pub fn peak(&self) -> f64 {
        match &self.shape {
            Shape::Multisine { lines, .. } => self.amplitude.abs() * (lines.len() as f64).sqrt(),
            _ => self.amplitude.abs(),
        }
    }

    /// Value at `t` (s) after the start of a schedule's step of `duration` (s). `None` before the start and after the end of
    /// the excitation.
    pub(super) fn at(&self, t: f64, duration: f64) -> Option<f64> {
        let into = t - self.start;
        if into < 0.0 || into >= self.length() {
            return None;
        }
        let unit = match &self.shape {
            Shape::Step { .. } => 1.0,
            Shape::Doublet { width } => sign(into < *width),
            Shape::ThreeTwoOneOne { width } => {
                sign(into < 3.0 * width || (5.0 * width..6.0 * width).contains(&into))
            }
            Shape::Multisine { lines, .. } => {
                let fade = (into.min(duration - t) / FADE_S).clamp(0.0, 1.0);
                let sum: f64 = lines.iter().map(|[w, phase]| (w * into + phase).sin()).sum();
                fade * sum / (lines.len() as f64).sqrt()
            }
        };
        Some(self.amplitude * unit)
    }
}

fn sign(up: bool) -> f64 {
    if up { 1.0 } else { -1.0 }
}
