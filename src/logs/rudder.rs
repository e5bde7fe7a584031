//! Checks whether the rudder moves in a log.

use std::fmt;

use super::{Sample, phases};
use greylag_num::statistics::mean;

/// The rudder moves if the standard deviation of its deflection exceeds this value, rad (0.2°). With Cnδr = −0.07/rad a
/// deflection of 0.2° causes the moment of 0.2° of sideslip at Cnβ = 0.07/rad, which is less than the noise of a vane (0.3°).
/// Ten seconds of doublets of 5° in ten minutes of flight have a standard deviation of 0.6°.
pub const MOVES_RAD: f64 = 0.0035;
/// The same limit for a command, as a fraction of the unknown travel. 1 % of a travel of 25° is 0.25°. It exceeds the
/// dead band of a servo (about 4 µs of 500 µs).
const MOVES_PART: f64 = 0.01;
/// Smallest number of rows in flight for a decision.
const ENOUGH: usize = 50;

/// Movement of the rudder in flight, as a standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RudderMotion {
    /// Standard deviation of the deflection, rad.
    Deflection(f64),
    /// Standard deviation of the command, −1..1, where the log has no deflection.
    Command(f64),
}

impl RudderMotion {
    /// The movement of the rudder in the rows of a flight; `None` if there is none beyond noise.
    pub fn of(rows: &[Sample]) -> Option<RudderMotion> {
        let sd = |get: fn(&Sample) -> f64| spread(rows, get);
        if let Some(sd) = sd(|s| s.rudder_rad) {
            return (sd > MOVES_RAD).then_some(RudderMotion::Deflection(sd));
        }
        sd(|s| s.rudder_cmd).filter(|sd| *sd > MOVES_PART).map(RudderMotion::Command)
    }

    /// Standard deviation of the rudder, divided by the limit above which it counts as movement.
    pub fn size(self) -> f64 {
        match self {
            RudderMotion::Deflection(sd) => sd / MOVES_RAD,
            RudderMotion::Command(sd) => sd / MOVES_PART,
        }
    }
}

impl fmt::Display for RudderMotion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            RudderMotion::Deflection(sd) => {
                write!(f, "The rudder moves (sd {:.1}°)", sd.to_degrees())
            }
            RudderMotion::Command(sd) => {
                write!(f, "The rudder command moves (sd {:.0} % of its travel)", 100.0 * sd)
            }
        }
    }
}

/// Standard deviation of the values of `get` in flight; `None` if there are too few.
fn spread(rows: &[Sample], get: fn(&Sample) -> f64) -> Option<f64> {
    let flying = rows.iter().filter(|s| s.airspeed_mps > phases::Flying::default().from_mps);
    let values: Vec<f64> = flying.map(get).filter(|x| x.is_finite()).collect();
    if values.len() < ENOUGH {
        return None;
    }
    let middle = mean(&values);
    let squares: Vec<f64> = values.iter().map(|x| (x - middle).powi(2)).collect();
    Some(mean(&squares).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows at `airspeed` (m/s). `set` writes the rudder of each row; its second argument is +1 and −1 in turn.
    fn rows(airspeed: f64, set: impl Fn(&mut Sample, f64)) -> Vec<Sample> {
        let row = |k: usize| {
            let mut sample = Sample { airspeed_mps: airspeed, ..Sample::default() };
            set(&mut sample, if k.is_multiple_of(2) { 1.0 } else { -1.0 });
            sample
        };
        (0..100).map(row).collect()
    }

    #[test]
    fn a_rudder_moves_beyond_its_threshold_and_in_flight_alone() {
        let deflection = |rad: f64| rows(20.0, move |s, x| s.rudder_rad = rad * x);
        // The standard deviation of ± a is a.
        let motion = RudderMotion::of(&deflection(0.0716)).unwrap();
        assert_eq!(motion.to_string(), "The rudder moves (sd 4.1°)");
        assert!(RudderMotion::of(&deflection(0.0034)).is_none(), "below 0.2°: noise");
        assert!(RudderMotion::of(&rows(2.0, |s, x| s.rudder_rad = x)).is_none(), "on the ground");
        assert!(RudderMotion::of(&rows(20.0, |_, _| ())).is_none(), "no rudder in the log");
    }

    #[test]
    fn a_command_counts_where_the_log_has_no_deflection() {
        let command = |part: f64| rows(20.0, move |s, x| s.rudder_cmd = part * x);
        let motion = RudderMotion::of(&command(0.12)).unwrap();
        assert_eq!(motion.to_string(), "The rudder command moves (sd 12 % of its travel)");
        assert!(RudderMotion::of(&command(0.009)).is_none(), "below 1 % of the travel: dead band");
        let centred = rows(20.0, |s, x| (s.rudder_rad, s.rudder_cmd) = (0.0, x));
        assert!(RudderMotion::of(&centred).is_none(), "the deflection is what acts");
    }
}
