//! Quality measures of an attitude manoeuvre.
//!
//! A [`Track`] contains the measurements and commands of a flight. [`Track::quality`] computes the measures. [`MEASURES`]
//! gives each measure's unit, definition and source. Simulated and recorded flights are measured in the same way.

mod limits;
mod measures;

use serde::Serialize;

use crate::{Observation, Target};
use greylag_physics::Command;

pub use limits::{Limit, Limits, OutsideS, TRANSIENT};
pub use measures::{MEASURES, Measure, Worse, measure};

/// Attitude error within which a target counts as reached, degrees.
pub const REACHED_DEG: f64 = 1.0;

/// Settling band of the combined roll and pitch error, as a fraction of the step (the change of attitude from the start to the
/// target).
const BAND: f64 = 0.05;

/// Overshoot that counts as small, as a fraction of the step.
const LITTLE: f64 = 0.03;

/// Sum of |roll error| and |pitch error| that is assumed for the remaining time after a loss of the aircraft, degrees.
const LOST_DEG: f64 = 360.0;

/// One sample of a flight. Unknown values are NaN, which the measures ignore.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// Time of the sample, s.
    pub time_s: f64,
    /// Roll φ and pitch θ, rad.
    pub attitude: [f64; 2],
    /// True airspeed V_a, m/s.
    pub airspeed: f64,
    /// Angle of attack α, rad.
    pub alpha: f64,
    /// Sideslip angle β, rad.
    pub beta: f64,
    /// Load factor: the specific force along body z, positive upwards, divided by standard gravity. It is 1 in level flight.
    /// CS-23.321 defines it as the aerodynamic force normal to the longitudinal axis divided by the weight.
    pub load_factor: f64,
    /// The command given at this time.
    pub command: Command,
}

impl Moment {
    /// A sample from an observation, its load factor and its command.
    pub fn new(seen: &Observation, load_factor: f64, command: &Command) -> Moment {
        let s = &seen.state;
        Moment {
            time_s: seen.time.as_secs_f64(),
            attitude: [s.roll, s.pitch],
            airspeed: s.airspeed,
            alpha: s.alpha,
            beta: s.beta,
            load_factor,
            command: *command,
        }
    }
}

/// The previous command, and the time since it, s.
type Earlier<'a> = (&'a Command, f64);

/// A flight towards one target.
#[derive(Clone, Debug, PartialEq)]
pub struct Track {
    /// Samples in time order. The first one is at the time at which the target was set.
    pub moments: Vec<Moment>,
    /// The commanded attitude and airspeed.
    pub target: Target,
    /// The command before the first sample. `None` at the start of a flight.
    pub before: Option<Command>,
    /// Time from the loss of the aircraft to the planned end of the flight, s. Zero if the aircraft was not lost.
    pub lost_s: f64,
}

/// One value per control.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PerControl {
    /// Value for the aileron.
    pub aileron: f64,
    /// Value for the elevator.
    pub elevator: f64,
    /// Value for the rudder.
    pub rudder: f64,
    /// Value for the throttle.
    pub throttle: f64,
}

impl PerControl {
    fn of(value: impl Fn(fn(&Command) -> f64) -> f64) -> PerControl {
        PerControl {
            aileron: value(|c| c.aileron),
            elevator: value(|c| c.elevator),
            rudder: value(|c| c.rudder),
            throttle: value(|c| c.throttle),
        }
    }

    /// Sum over aileron, elevator and rudder without NaN values. NaN if all three are NaN.
    pub fn surfaces(&self) -> f64 {
        total([self.aileron, self.elevator, self.rudder].into_iter())
    }
}

/// The measures of a [`Track`], defined in [`MEASURES`]. An unknown value is NaN.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Quality {
    /// Step of roll and pitch from the start to the target, degrees.
    pub step_deg: [f64; 2],
    /// Integral of |roll error| + |pitch error|, ° s.
    pub error_integral_deg_s: f64,
    /// Time after which roll and pitch stay within [`REACHED_DEG`] of the target, s. The whole duration if they never stay
    /// within it.
    pub to_one_deg_s: f64,
    /// Time after which the combined roll and pitch error stays within 5 % of the step, s. The whole duration if it never
    /// stays within it.
    pub to_five_percent_s: f64,
    /// Overshoot of roll and pitch, degrees.
    pub overshoot_deg: [f64; 2],
    /// Smallest and largest load factor.
    pub load_factor: [f64; 2],
    /// Smallest and largest angle of attack, degrees.
    pub alpha_deg: [f64; 2],
    /// Largest |sideslip|, degrees.
    pub sideslip_deg: f64,
    /// Root mean square of the airspeed error, m/s.
    pub airspeed_rms_mps: f64,
    /// Smallest and largest airspeed, m/s.
    pub airspeed_mps: [f64; 2],
    /// Total variation of each command, in the command's unit.
    pub travel: PerControl,
    /// Mean square of each command's rate, 1/s².
    pub mean_square_rate: PerControl,
    /// Fraction of the ticks (sample intervals) in which each command is at its smallest or largest value.
    pub saturated: PerControl,
    /// Fraction of the ticks in which any surface command is at its smallest or largest value.
    pub surface_saturated: f64,
    /// Time outside each limit of the aircraft, s.
    pub outside_s: OutsideS,
    /// Whether load factor and angle of attack stayed within their limits plus [`TRANSIENT`]. False if the aircraft was lost.
    pub kept: bool,
    /// Whether the aircraft was lost.
    pub lost: bool,
}

impl Quality {
    /// Whether roll and pitch overshoot by at most 1° or 3 % of their step, whichever is larger. False if the aircraft was
    /// lost.
    pub fn overshoots_little(&self) -> bool {
        let little = |step: f64, over: f64| over <= (LITTLE * step.abs()).max(REACHED_DEG);
        !self.lost
            && self.step_deg.iter().zip(self.overshoot_deg).all(|(step, over)| little(*step, over))
    }
}

impl Track {
    /// Computes the measures of the flight with the limits of its aircraft.
    pub fn quality(&self, limits: &Limits) -> Quality {
        let errors: Vec<[f64; 2]> = self.errors();
        let first = errors.first().copied().unwrap_or([f64::NAN; 2]);
        let band = BAND * first[0].hypot(first[1]);
        let (load_factor, alpha_deg) = (
            ends(self.moments.iter().map(|m| m.load_factor)),
            ends(self.moments.iter().map(|m| m.alpha.to_degrees())),
        );
        let sideslip = ends(self.moments.iter().map(|m| m.beta.to_degrees().abs()));
        let off = self.moments.iter().map(|m| (m.airspeed - self.target.airspeed).powi(2));
        let lost = self.lost_s > 0.0;
        Quality {
            step_deg: first.map(|e| -e),
            // if the aircraft is lost before the first sample, only the assumed error after the loss counts
            error_integral_deg_s: total(
                [self.integral(&errors), LOST_DEG * self.lost_s].into_iter(),
            ),
            to_one_deg_s: self.stays(&errors, |e| e[0].abs().max(e[1].abs()), REACHED_DEG),
            to_five_percent_s: self.stays(&errors, |e| e[0].hypot(e[1]), band),
            overshoot_deg: [0, 1].map(|axis| overshoot(errors.iter().map(|e| e[axis]))),
            load_factor,
            alpha_deg,
            sideslip_deg: sideslip[1],
            airspeed_rms_mps: mean(off).sqrt(),
            airspeed_mps: ends(self.moments.iter().map(|m| m.airspeed)),
            travel: PerControl::of(|of| total(self.changes(of).map(|(by, _)| by.abs()))),
            mean_square_rate: PerControl::of(|of| {
                mean(self.changes(of).map(|(by, seconds)| (by / seconds).powi(2)))
            }),
            saturated: PerControl {
                throttle: self.share(|c| stop(0.5 - c.throttle, 0.5)),
                ..PerControl::of(|of| self.share(|c| stop(of(c), 1.0)))
            },
            surface_saturated: self.share(|c| {
                let surfaces = [c.aileron, c.elevator, c.rudder];
                surfaces.into_iter().map(|x| stop(x, 1.0)).fold(f64::NAN, f64::max)
            }),
            outside_s: limits.outside(self),
            kept: !lost && limits.kept(load_factor, alpha_deg),
            lost,
        }
    }

    /// Roll and pitch errors of every sample, degrees.
    fn errors(&self) -> Vec<[f64; 2]> {
        self.moments.iter().map(|m| attitude_error_deg(m.attitude, &self.target)).collect()
    }

    /// Trapezoidal integral of |roll error| + |pitch error|, ° s.
    fn integral(&self, errors: &[[f64; 2]]) -> f64 {
        let size = |e: &[f64; 2]| e[0].abs() + e[1].abs();
        let parts = errors.windows(2).zip(self.ticks());
        total(parts.map(|(pair, (_, _, length))| 0.5 * length * (size(&pair[0]) + size(&pair[1]))))
    }

    /// Time from the first sample to the last sample at which `size` of the error exceeds `band`, plus `Track::lost_s`, s. NaN
    /// if the band or all errors are unknown and the aircraft was not lost.
    fn stays(&self, errors: &[[f64; 2]], size: impl Fn(&[f64; 2]) -> f64, band: f64) -> f64 {
        let unknown = band.is_nan() || errors.iter().all(|e| size(e).is_nan());
        let Some(start) = self.moments.first().map(|m| m.time_s).filter(|_| !unknown) else {
            return if self.lost_s > 0.0 { self.lost_s } else { f64::NAN };
        };
        let away = errors.iter().rposition(|e| size(e) > band);
        away.map_or(0.0, |k| self.moments[k].time_s - start) + self.lost_s
    }

    /// The ticks (sample intervals): every sample except the last, with the previous command and the time since it, s, and with
    /// the time to the next sample, s. The time since [`Track::before`] is not known; the time to the next sample stands for it.
    fn ticks(&self) -> impl Iterator<Item = (&Moment, Option<Earlier<'_>>, f64)> {
        self.moments.windows(2).enumerate().map(move |(k, pair)| {
            let length = pair[1].time_s - pair[0].time_s;
            let before = match k.checked_sub(1).map(|k| &self.moments[k]) {
                Some(old) => Some((&old.command, pair[0].time_s - old.time_s)),
                None => self.before.as_ref().map(|command| (command, length)),
            };
            (&pair[0], before, length)
        })
    }

    /// Changes of a command, each with the time since the previous command, s.
    fn changes(&self, of: fn(&Command) -> f64) -> impl Iterator<Item = (f64, f64)> + '_ {
        let changed = move |(m, before, _): (&Moment, Option<Earlier<'_>>, f64)| {
            before.map(|(old, since)| (of(&m.command) - of(old), since))
        };
        self.ticks().filter_map(changed).filter(|(by, _)| by.is_finite())
    }

    /// Mean of the function `of` of the command over the ticks.
    fn share(&self, of: impl Fn(&Command) -> f64) -> f64 {
        mean(self.ticks().map(|(m, ..)| of(&m.command)))
    }
}

/// Saturation of a command: 1 if |`command`| is at or above `most`, else 0. NaN for NaN.
fn stop(command: f64, most: f64) -> f64 {
    if command.is_nan() { f64::NAN } else { f64::from(u8::from(command.abs() >= most)) }
}

/// Roll and pitch (rad) minus the target's, degrees, wrapped to ±180°.
pub fn attitude_error_deg([roll, pitch]: [f64; 2], target: &Target) -> [f64; 2] {
    let wrap = |x: f64| (x + 180.0).rem_euclid(360.0) - 180.0;
    [wrap((roll - target.roll).to_degrees()), wrap((pitch - target.pitch).to_degrees())]
}

/// Largest excursion of the error past zero in the direction of the step. Without a step, it is the largest |error|. NaN if
/// there are no errors.
fn overshoot(mut errors: impl Iterator<Item = f64>) -> f64 {
    let Some(first) = errors.next() else { return f64::NAN };
    let beyond = |e: f64| if first == 0.0 { e.abs() } else { -first.signum() * e };
    errors.map(beyond).filter(|e| e.is_finite()).fold(0.0, f64::max)
}

/// Minimum and maximum without NaN values. NaN if all values are NaN.
fn ends(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::NAN; 2], |[least, most], x| [least.min(x), most.max(x)])
}

/// Sum of the finite values. NaN if there are none.
fn total(values: impl Iterator<Item = f64>) -> f64 {
    values.filter(|x| x.is_finite()).fold(f64::NAN, |sum, x| if sum.is_nan() { x } else { sum + x })
}

/// Mean of the finite values. NaN if there are none.
fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) =
        values.filter(|x| x.is_finite()).fold((0.0, 0.0), |(sum, count), x| (sum + x, count + 1.0));
    sum / count
}

#[cfg(test)]
mod tests;
