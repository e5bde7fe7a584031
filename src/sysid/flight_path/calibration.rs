//! Errors that an instrument has seldom, freed one after the other where a flight shows them beyond doubt.
//!
//! Gains of gyros, accelerometers and vanes, an offset of airspeed or heading, a delay far beyond a sample: free in every
//! flight, they would cost every flight what it knows of its biases. Each is therefore held until what it would be without
//! a prior is clearly not zero (a score test with the path and all other constants fitted along; Klein and Morelli, Aircraft
//! System Identification, section 5.3.3) and large enough to matter.

use crate::flight_path::equations::{Found, Problem};
use crate::flight_path::nuisance::{
    self, AIRSPEED_OFFSET, COUNT, HEADING, SKEW_ATTITUDE, SKEW_FORCE, SKEW_VELOCITY,
};

/// Standard deviations beyond which an error is beyond doubt: fifteen of them are looked at in every flight, whose noise is
/// not quite white.
const BEYOND_DOUBT: f64 = 6.0;
/// Least size that matters: a gain, an airspeed (m/s), a heading (rad).
const GAIN: f64 = 0.01;
const AIRSPEED: f64 = 0.3;
const ASKEW: f64 = 1.5 * std::f64::consts::PI / 180.0;
/// Prior standard deviations of a delay beyond which it is none of the usual ones.
const UNUSUAL: f64 = 4.0;
/// A delay's least size that matters, s.
const DELAY: f64 = 0.02;
/// A constant that the data know to no better than this part of its width is not freed.
const KNOWN: f64 = 0.25;

/// The next constant to be freed with its width from then on; `None` if no other one is beyond doubt.
pub fn next(problem: &Problem, found: &Found, bound: f64) -> Option<(usize, f64)> {
    let open = |place: &usize| {
        let freed = nuisance::wide(*place).is_some_and(|wide| problem.widths[*place] >= wide);
        let stated = problem.log.sensors.known(nuisance::NAMES[*place].0).is_some();
        let has = &problem.log.has;
        !freed
            && !stated
            && nuisance::wide(*place).is_some()
            && nuisance::concerned(*place, has)
            && !nuisance::unseeable(*place, has)
    };
    let places: Vec<usize> = (0..COUNT).filter(open).collect();
    let unbound = problem.unbound(found, bound, &places)?;
    let beyond = places.iter().zip(unbound).filter_map(|(place, [value, sd])| {
        let (off, wide) = ((value - problem.means[*place]).abs(), nuisance::wide(*place)?);
        let certain = off / sd;
        let shown = certain > BEYOND_DOUBT && sd < KNOWN * wide && off > least(problem, *place);
        shown.then_some((*place, wide, certain))
    });
    let (place, wide, _) = beyond.max_by(|a, b| a.2.total_cmp(&b.2))?;
    Some((place, wide))
}

/// The size under which an error does not matter.
fn least(problem: &Problem, place: usize) -> f64 {
    match place {
        AIRSPEED_OFFSET => AIRSPEED,
        HEADING => ASKEW,
        SKEW_ATTITUDE..=SKEW_VELOCITY | SKEW_FORCE => DELAY.max(UNUSUAL * problem.widths[place]),
        _ => GAIN,
    }
}
