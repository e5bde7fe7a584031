//! Rare instrument errors. Each is estimated only if a flight shows it significantly.
//!
//! These are gains of gyros, accelerometers and vanes, an offset of airspeed or heading, and a delay far beyond a
//! sample. If they were free in every flight, the biases would be less certain in every flight. Each is therefore held
//! until its estimate without its own prior differs from the prior mean significantly and by enough to matter (a score
//! test with the path and all other constants fitted along; Klein and Morelli, Aircraft System Identification, section
//! 5.3.3).

use crate::flight_path::equations::{Found, Problem};
use crate::flight_path::nuisance::{
    self, AIRSPEED_OFFSET, COUNT, HEADING, SKEW_ATTITUDE, SKEW_FORCE, SKEW_VELOCITY,
};

/// Standard deviations for significance; high because fifteen errors are tested in every flight, whose noise is not
/// quite white.
const BEYOND_DOUBT: f64 = 6.0;
/// Least relevant size: of a gain, an airspeed (m/s), a heading (rad).
const GAIN: f64 = 0.01;
const AIRSPEED: f64 = 0.3;
const ASKEW: f64 = 1.5 * std::f64::consts::PI / 180.0;
/// Prior standard deviations beyond which a delay is unusual.
const UNUSUAL: f64 = 4.0;
/// Least relevant size of a delay, s.
const DELAY: f64 = 0.02;
/// A constant is freed only if its standard deviation is below this share of its new prior width.
const KNOWN: f64 = 0.25;

/// The next constant to free with its new prior width; `None` if no other one is significant.
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

/// Size below which an error is irrelevant.
fn least(problem: &Problem, place: usize) -> f64 {
    match place {
        AIRSPEED_OFFSET => AIRSPEED,
        HEADING => ASKEW,
        SKEW_ATTITUDE..=SKEW_VELOCITY | SKEW_FORCE => DELAY.max(UNUSUAL * problem.widths[place]),
        _ => GAIN,
    }
}
