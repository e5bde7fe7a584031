//! How well an attitude was flown: what happened on the way from one attitude to another, in numbers.
//!
//! A [`Track`] is what was seen and commanded; [`Track::quality`] measures it; [`MEASURES`] names each measure with its
//! unit, its definition and where that comes from. It is pure: simulated flights and recordings are measured alike.

mod limits;
mod measures;

use serde::Serialize;

use crate::{Observation, Target};
use greylag_physics::Command;

pub use limits::{Limits, OutsideS, TRANSIENT};
pub use measures::{MEASURES, Measure, Worse, measure};

/// Attitude error within which a target counts as reached, degrees.
pub const REACHED_DEG: f64 = 1.0;

/// Part of a step within which its end counts as reached: the usual band of settling times.
const BAND: f64 = 0.05;

/// Part of a step that an overshoot may have and still be little.
const LITTLE: f64 = 0.03;

/// What a lost aircraft is off by in the time that was left to fly, degrees of roll and of pitch together.
const LOST_DEG: f64 = 360.0;

/// One tick of a flight. What is not known is NaN and left out of the measures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// When, s.
    pub time_s: f64,
    /// Roll φ and pitch θ, rad.
    pub attitude: [f64; 2],
    /// True airspeed, m/s.
    pub airspeed: f64,
    /// Angle of attack α, rad.
    pub alpha: f64,
    /// Sideslip β, rad.
    pub beta: f64,
    /// Load factor: the specific force along body z, upwards, divided by the standard gravity (CS-23.321: the
    /// aerodynamic force normal to the longitudinal axis divided by the weight); 1 in level flight.
    pub load_factor: f64,
    /// The command given at this moment.
    pub command: Command,
}

impl Moment {
    /// What was seen and commanded, under a load factor.
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

/// A flight towards one target.
#[derive(Clone, Debug, PartialEq)]
pub struct Track {
    /// Its ticks in time order, from the one at which the target was set.
    pub moments: Vec<Moment>,
    /// Where to.
    pub target: Target,
    /// The command in force before; `None` where the flight begins.
    pub before: Option<Command>,
    /// Time that was left to fly when the aircraft was lost, s; 0 if it was not.
    pub lost_s: f64,
}

/// A number for each control.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PerControl {
    /// Aileron.
    pub aileron: f64,
    /// Elevator.
    pub elevator: f64,
    /// Rudder.
    pub rudder: f64,
    /// Throttle.
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

    /// Aileron, elevator and rudder together; what is not known of one is left out.
    pub fn surfaces(&self) -> f64 {
        total([self.aileron, self.elevator, self.rudder].into_iter())
    }
}

/// The measures of a [`Track`]; [`MEASURES`] says how each is defined. NaN where nothing is known.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Quality {
    /// Roll and pitch from the start to the target, degrees.
    pub step_deg: [f64; 2],
    /// Integral of |roll error| + |pitch error|, ° s.
    pub error_integral_deg_s: f64,
    /// Time after which roll and pitch stay within [`REACHED_DEG`] of the target, s; the whole flight's if they
    /// never do.
    pub to_one_deg_s: f64,
    /// Time after which the error in roll and pitch together stays within 5 % of the step, s; the same.
    pub to_five_percent_s: f64,
    /// How far roll and pitch went beyond the target, degrees.
    pub overshoot_deg: [f64; 2],
    /// Least and largest load factor.
    pub load_factor: [f64; 2],
    /// Least and largest angle of attack, degrees.
    pub alpha_deg: [f64; 2],
    /// Largest |sideslip|, degrees.
    pub sideslip_deg: f64,
    /// Root mean square of the airspeed less what was wanted, m/s.
    pub airspeed_rms_mps: f64,
    /// Least and largest airspeed, m/s.
    pub airspeed_mps: [f64; 2],
    /// Sum of |changes| of each command, in the command's unit.
    pub travel: PerControl,
    /// Mean square of each command's rate, 1/s².
    pub mean_square_rate: PerControl,
    /// Share of the ticks with each command at a stop.
    pub saturated: PerControl,
    /// Share of the ticks with any surface at a stop.
    pub surface_saturated: f64,
    /// Seconds outside each limit.
    pub outside_s: OutsideS,
    /// Whether load factor and angle of attack kept to their limits but for a transient, see [`TRANSIENT`].
    pub kept: bool,
    /// Whether the aircraft was lost.
    pub lost: bool,
}

impl Quality {
    /// Whether roll and pitch overshoot by at most 1° or 3 % of their step, whichever is more.
    pub fn overshoots_little(&self) -> bool {
        let little = |step: f64, over: f64| over <= (LITTLE * step.abs()).max(REACHED_DEG);
        !self.lost
            && self.step_deg.iter().zip(self.overshoot_deg).all(|(step, over)| little(*step, over))
    }
}

impl Track {
    /// Measures the flight against the limits of its aircraft.
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
            // an aircraft may be lost before the first moment
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

    /// Roll and pitch errors at every moment, degrees.
    fn errors(&self) -> Vec<[f64; 2]> {
        self.moments.iter().map(|m| attitude_error_deg(m.attitude, &self.target)).collect()
    }

    /// Trapezoidal integral of |roll error| + |pitch error|, ° s.
    fn integral(&self, errors: &[[f64; 2]]) -> f64 {
        let size = |e: &[f64; 2]| e[0].abs() + e[1].abs();
        let parts = errors.windows(2).zip(self.ticks());
        total(parts.map(|(pair, (_, _, length))| 0.5 * length * (size(&pair[0]) + size(&pair[1]))))
    }

    /// Time from the first moment to the last one at which `size` of the error exceeds `band`, s.
    fn stays(&self, errors: &[[f64; 2]], size: impl Fn(&[f64; 2]) -> f64, band: f64) -> f64 {
        let Some(start) = self.moments.first().map(|m| m.time_s) else {
            return if self.lost_s > 0.0 { self.lost_s } else { f64::NAN };
        };
        let away = errors.iter().rposition(|e| size(e) > band);
        away.map_or(0.0, |k| self.moments[k].time_s - start) + self.lost_s
    }

    /// Every moment but the last, which only ends the flight: with the command before and how long it lasts, s.
    fn ticks(&self) -> impl Iterator<Item = (&Moment, Option<&Command>, f64)> {
        let before = std::iter::once(self.before.as_ref());
        let before = before.chain(self.moments.iter().map(|m| Some(&m.command)));
        let pairs = self.moments.windows(2).zip(before);
        pairs.map(|(pair, before)| (&pair[0], before, pair[1].time_s - pair[0].time_s))
    }

    /// Changes of a command with the time that each took, s.
    fn changes(&self, of: fn(&Command) -> f64) -> impl Iterator<Item = (f64, f64)> + '_ {
        let changed = move |(m, before, length): (&Moment, Option<&Command>, f64)| {
            before.map(|old| (of(&m.command) - of(old), length))
        };
        self.ticks().filter_map(changed).filter(|(by, _)| by.is_finite())
    }

    /// Mean over the ticks of a number that each command has.
    fn share(&self, of: impl Fn(&Command) -> f64) -> f64 {
        mean(self.ticks().map(|(m, ..)| of(&m.command)))
    }
}

/// 1 for a command at its stop or beyond, else 0; NaN for one that is not known.
fn stop(command: f64, most: f64) -> f64 {
    if command.is_nan() { f64::NAN } else { f64::from(u8::from(command.abs() >= most)) }
}

/// Roll and pitch (rad) less their commands, degrees, the shorter way round.
pub fn attitude_error_deg([roll, pitch]: [f64; 2], target: &Target) -> [f64; 2] {
    let wrap = |x: f64| (x + 180.0).rem_euclid(360.0) - 180.0;
    [wrap((roll - target.roll).to_degrees()), wrap((pitch - target.pitch).to_degrees())]
}

/// How far errors go beyond zero, seen from the first: in the direction of the step. Where there is no step, the
/// largest |error|.
fn overshoot(mut errors: impl Iterator<Item = f64>) -> f64 {
    let Some(first) = errors.next() else { return f64::NAN };
    let beyond = |e: f64| if first == 0.0 { e.abs() } else { -first.signum() * e };
    errors.map(beyond).filter(|e| e.is_finite()).fold(0.0, f64::max)
}

/// Least and largest of what is known; NaN for nothing.
fn ends(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::NAN; 2], |[least, most], x| [least.min(x), most.max(x)])
}

/// Sum of what is known; NaN for nothing.
fn total(values: impl Iterator<Item = f64>) -> f64 {
    values.filter(|x| x.is_finite()).fold(f64::NAN, |sum, x| if sum.is_nan() { x } else { sum + x })
}

/// Mean of what is known; NaN for nothing.
fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) =
        values.filter(|x| x.is_finite()).fold((0.0, 0.0), |(sum, count), x| (sum + x, count + 1.0));
    sum / count
}

#[cfg(test)]
mod tests;
