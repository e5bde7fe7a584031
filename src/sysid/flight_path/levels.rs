//! Noise levels (standard deviations) of the sensors. They are estimated first from the measurements alone, then from the
//! residuals of the fit.
//!
//! The fit reconstructs the path: attitude, velocity and flow angles over time. A kinematic step predicts the path from one
//! sample to the next with gyros and accelerometers. The colour of a channel is the ratio of its slow noise to white noise.

use crate::flight_path::intake::{Log, Track};
use crate::flight_path::measurement::{self, Residuals};
use crate::flight_path::noise;
use crate::flight_path::path::CHANNELS;
use greylag_physics::sensors::Noisy;

/// Smallest noise levels of gyros (rad/s) and accelerometers (m/s²), about as large as the errors of the discrete kinematic
/// steps.
const GYRO_FLOOR: f64 = 2e-4;
const FORCE_FLOOR: f64 = 5e-3;
/// Smallest noise levels of the measured channels: attitude (rad), airspeed (m/s), vanes (rad), velocity (m/s).
const FLOORS: [f64; CHANNELS] = [2e-5, 2e-5, 2e-5, 1e-3, 5e-5, 5e-5, 1e-3, 1e-3, 1e-3];
/// Smallest ratio of a channel's noise level to the change of the path in one kinematic step that the noise of gyros or
/// accelerometers causes.
///
/// With a smaller ratio the path would follow every single measurement. The most likely delay of a sensor would then be half a
/// sample for any true delay, because interpolation at half a sample averages two measurements.
const CARRIED: f64 = 30.0;
/// Noise levels used if there are too few samples for an estimate: attitude (rad), airspeed (m/s), vanes (rad), velocity
/// (m/s).
const DEFAULTS: [f64; CHANNELS] = [0.02, 0.02, 0.05, 0.5, 0.02, 0.02, 0.5, 0.5, 0.5];
/// Largest products of noise level and colour: the largest plausible errors of attitude (rad), airspeed (m/s), vanes (rad) and
/// velocity (m/s). Without this limit, a path that departs from a sensor would reduce the sensor's weight and depart further.
const WIDEST: [f64; CHANNELS] = [0.05, 0.05, 0.1, 2.0, 0.1, 0.1, 1.0, 1.0, 1.0];
/// Noise levels of gyros or accelerometers are raised if the residual of the kinematic steps exceeds this number of standard
/// deviations. At a launch, it reaches 8.
const EXCESSIVE: f64 = 2.0;
/// Standard deviation of the specific force if the log has no accelerometers, m/s².
const UNKNOWN_FORCE: f64 = 3.0;
/// Usual correlation time of gusts, s: length scale of turbulence at an altitude of some hundred metres divided by the airspeed
/// of a small aircraft.
pub const GUST_TIME: f64 = 20.0;
/// Standard deviation of the gusts in calm air, m/s.
pub const CALM: f64 = 0.002;
/// Index of the airspeed among the measured channels.
const AIRSPEED: usize = 3;
/// Lengths of the blocks over which residuals are averaged to detect coloured noise, s.
const COLOUR_BLOCKS: [f64; 2] = [1.0, 4.0];
/// Slow error of a dynamic pressure sensor, Pa, and its correlation time, s. The sensor's zero drifts, and the error of the
/// static port changes with attitude. The figures are assumed, not measured: the error is 0.3 % of the airspeed at 17 m/s.
const PITOT: (f64, f64) = (1.0, 30.0);
/// Air density for converting the pressure error to a speed, kg/m³. A typical value suffices, because only the order of
/// magnitude of the pressure error is known.
const NEAR_THE_GROUND: f64 = 1.2;

/// Noise levels, as standard deviations.
#[derive(Clone, Copy, Debug)]
pub struct Levels {
    /// Gyro noise, rad/s.
    pub gyro: [f64; 3],
    /// Accelerometer noise, m/s².
    pub force: [f64; 3],
    /// Gusts, standard deviation of each component, m/s.
    pub gusts: f64,
    /// Correlation time of the gusts, s.
    pub gust_time: f64,
    /// Noise of the measured channels, in their units.
    pub measured: [f64; CHANNELS],
    /// Smallest levels of the channels: the white part of the measurements, if more than half of the samples have a
    /// measurement. Without this limit, residuals of a path that follows the measurements closely would seem smaller than the
    /// noise.
    pub white: [f64; CHANNELS],
    /// Colour of the channels, at least 1: standard deviation of block means of the residuals, divided by that of white noise.
    pub colour: [f64; CHANNELS],
    /// Whether the log's sensor description states the level, which is then not estimated.
    pub stated: [bool; CHANNELS],
    /// Standard deviation of white airspeed noise whose time averages vary as much as the slow error of the sensor, m/s.
    /// Zero if a vane measures α or the log has no velocity over ground.
    ///
    /// In all other logs, the mean vertical wind and α follow from the change of airspeed with climb. In 13 minutes of a PX4
    /// flight without wind, a slow error of 0.01 m/s was estimated as 0.18 ± 0.04 m/s of vertical wind.
    slow_airspeed: f64,
}

impl Levels {
    /// Levels before the fit: the white part of every channel's measurements.
    pub fn first(log: &Log) -> Levels {
        let over = |get: &dyn Fn(&Track, usize) -> f64| {
            noise::white(log.tracks.iter().flat_map(|t| (0..t.len()).map(move |k| get(t, k))))
        };
        let or = |level: f64, default: f64| if level.is_finite() { level } else { default };
        let attitude = |i: usize| {
            // angles jump at ±π, but their sine and cosine do not
            let (a, b) =
                (over(&|t, k| t.attitude[k][i].sin()), over(&|t, k| t.attitude[k][i].cos()));
            a.hypot(b)
        };
        let white: [f64; CHANNELS] = std::array::from_fn(|i| match i {
            0..3 => attitude(i),
            3 => over(&|t, k| t.airspeed[k]),
            4 | 5 => over(&|t, k| t.vanes[k][i - 4]),
            _ => over(&|t, k| t.velocity[k][i - 6]),
        });
        let samples: usize = log.tracks.iter().map(Track::len).sum();
        let dense = |i: usize| {
            let tracks = log.tracks.iter();
            let count =
                tracks.flat_map(|t| (0..t.len()).map(move |k| measurement::measured(t, i, k)));
            2 * count.filter(|x| x.is_finite()).count() > samples
        };
        let force = |i: usize| over(&|t, k| t.force[k][i]).max(FORCE_FLOOR);
        let gyro = [0, 1, 2].map(|i| or(over(&|t, k| t.rates[k][i]), 0.0).max(GYRO_FLOOR));
        let force = [0, 1, 2].map(|i| if log.has.force { force(i) } else { UNKNOWN_FORCE });
        let speeds = log.tracks.iter().flat_map(|t| &t.airspeed).filter(|v| v.is_finite());
        let (sum, count) = speeds.fold((0.0, 0.0), |(sum, count), v| (sum + v, count + 1.0));
        let between = |sd: [f64; 3]| CARRIED * log.step * sd.into_iter().fold(0.0, f64::max);
        // the unknown force in a log without accelerometers is not noise, because its mean differs from zero
        let gain = if log.has.force { between(force) } else { 0.0 };
        let turn = between(gyro);
        let floor: [f64; CHANNELS] = std::array::from_fn(|i| {
            FLOORS[i].max(match i {
                0..=2 => turn,
                4 | 5 => or(gain * count / sum, 0.0),
                _ => gain,
            })
        });
        Levels {
            gyro,
            force,
            gusts: CALM,
            gust_time: GUST_TIME,
            measured: std::array::from_fn(|i| or(white[i], DEFAULTS[i]).max(floor[i])),
            white: std::array::from_fn(
                |i| if dense(i) { white[i].max(floor[i]) } else { floor[i] },
            ),
            colour: [1.0; CHANNELS],
            stated: [false; CHANNELS],
            slow_airspeed: slow_airspeed(log, sum / count),
        }
        .as_stated(log)
    }

    /// Autocorrelation of a gust after the time `step` (s).
    pub fn gust_kept(&self, step: f64) -> f64 {
        (-step / self.gust_time).exp()
    }

    /// Standard deviation of the part of a gust that is new after the time `step` (s), m/s.
    pub fn gust_step(&self, step: f64) -> f64 {
        self.gusts * (1.0 - self.gust_kept(step).powi(2)).sqrt()
    }

    /// These levels with vanes that have white noise alone, beside gusts that are estimated: see [`noise::white_beside_walk`].
    /// Stated levels stay. So does that of the airspeed: the standard deviation of its estimate is larger than a gust's change in
    /// a sample, which would take up the difference.
    pub fn beside_gusts(mut self, log: &Log) -> Levels {
        let readings = |of: &dyn Fn(&Track, usize) -> f64| {
            noise::white_beside_walk(
                log.tracks.iter().map(|t| (0..t.len()).map(|k| of(t, k)).collect::<Vec<f64>>()),
            )
        };
        for (channel, floor) in FLOORS.iter().enumerate().take(6).skip(4) {
            let white = readings(&|t, k| measurement::measured(t, channel, k));
            if !self.stated[channel] && white.is_finite() {
                self.measured[channel] = self.measured[channel].min(white.max(*floor));
            }
        }
        self
    }

    /// These levels, with the stated noise of the log's sensors instead of the estimates.
    fn as_stated(mut self, log: &Log) -> Levels {
        let kinds = [(Noisy::Attitude, 0..3), (Noisy::Airspeed, 3..4), (Noisy::Vanes, 4..6)];
        for (kind, channels) in kinds.into_iter().chain([(Noisy::Velocity, 6..9)]) {
            if let Some(sd) = log.sensors.noise(kind) {
                self.measured[channels.clone()].fill(sd);
                self.white[channels.clone()].fill(sd);
                self.stated[channels].fill(true);
            }
        }
        self
    }

    /// Raises the noise levels of gyros or accelerometers if their kinematic residuals (in standard deviations) exceed
    /// `EXCESSIVE`. The three axes have a common factor. Returns the natural logarithm of the largest factor.
    pub fn loosen(&mut self, step_residuals: &[f64; 6]) -> f64 {
        let worst = |of: &[f64]| {
            let worst = of.iter().copied().fold(1.0, f64::max);
            if worst > EXCESSIVE { worst } else { 1.0 }
        };
        let (turn, pull) = (worst(&step_residuals[..3]), worst(&step_residuals[3..]));
        self.gyro.iter_mut().for_each(|level| *level *= turn);
        self.force.iter_mut().for_each(|level| *level *= pull);
        turn.max(pull).ln()
    }

    /// Smallest colour of a channel that slow errors cause if a sample has the noise `level`.
    fn least_colour(&self, channel: usize, level: f64) -> f64 {
        let least = if channel == AIRSPEED { self.slow_airspeed } else { 0.0 };
        1.0_f64.hypot(least / level)
    }

    /// Estimates the levels again from the `residuals` of every stretch. `step` is the sampling interval, s. Returns the largest
    /// |natural logarithm| of the ratio of a new to an old level.
    pub fn renew(&mut self, residuals: &[Vec<Residuals>], step: f64) -> f64 {
        let mut change = 0.0_f64;
        for (channel, widest) in WIDEST.into_iter().enumerate() {
            let all = residuals.iter().flatten().map(|r| r[channel]);
            let mut residuals: Vec<f64> = all.filter(|x| !x.is_nan()).collect();
            let over = |block: f64| noise::colour(&residuals, (block / step).round() as usize);
            let colour = COLOUR_BLOCKS.map(over).into_iter().fold(1.0, f64::max);
            let level = noise::level(&mut residuals);
            if level.is_nan() {
                continue;
            }
            if self.stated[channel] {
                // the stated noise is that of one sample and does not include the correlation of errors over time
                self.colour[channel] = self.least_colour(channel, self.measured[channel]);
                continue;
            }
            let level = level.max(self.white[channel]).min(widest);
            let colour = colour.max(self.least_colour(channel, level)).min(widest / level);
            change = change.max((level / self.measured[channel]).ln().abs());
            (self.measured[channel], self.colour[channel]) = (level, colour);
        }
        change
    }
}

/// White noise, m/s, that represents the slow error [`PITOT`] at `airspeed` (m/s): see [`Levels::slow_airspeed`].
fn slow_airspeed(log: &Log, airspeed: f64) -> f64 {
    if log.has.alpha || !log.has.velocity {
        return 0.0;
    }
    let (pressure, lasting) = PITOT;
    let samples = lasting / log.periods.airspeed.max(log.step);
    pressure / (NEAR_THE_GROUND * airspeed) * samples.sqrt()
}
