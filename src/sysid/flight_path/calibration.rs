//! Rare instrument errors: the prior distribution of such an error is wide only if a flight shows the error significantly.
//!
//! Rare errors are gains of gyros, accelerometers and vanes, a roll of the board against the vanes, an offset of airspeed or
//! heading, and a delay of many samples. If all of them had wide priors, the biases would be less certain in every flight. At first, gains and offsets are therefore held
//! at their prior means, and delays are estimated with a narrow prior. An error gets a wide prior (it is freed) if the data
//! contradict its prior mean. This is the case if its estimate without its prior differs from the prior mean significantly and by
//! a relevant size. This is a score test with the path and all other constants (sensor errors, wind, Earth's rate) fitted (Klein
//! and Morelli, Aircraft System Identification, section 5.3.3).

use crate::flight_path::equations::{Found, Problem};
use crate::flight_path::installation::Estimate;
use crate::flight_path::nuisance::{
    self, AIRSPEED_OFFSET, BOARD_ROLL, COUNT, FORCE_GAIN, GYRO_GAIN, HEADING, SKEW_AIRSPEED,
    SKEW_ATTITUDE, SKEW_FORCE, SKEW_VANES, SKEW_VELOCITY, VANE_GAIN,
};

/// Number of standard deviations above which a difference is significant. It is large because sixteen errors are tested in
/// every flight, and because the noise is not quite white.
const BEYOND_DOUBT: f64 = 6.0;
/// Rare errors of the air-data sensors, whose estimates are biased in gusts.
///
/// An aircraft turns into a gust. Its motion against the mean air then has the opposite sign to the gust that the vane measures,
/// as if the vane showed only a part of the motion. In gusts of 0.5 to 0.9 m/s, correlated over 1.5 s, vane gains of −20 to −94 %
/// were found that did not exist. No weight of the residuals removes this bias, because the gust is the cause of the motion.
pub const OF_AIR: [usize; 6] =
    [SKEW_AIRSPEED, SKEW_VANES, VANE_GAIN, VANE_GAIN + 1, AIRSPEED_OFFSET, BOARD_ROLL];
/// Rare errors that belong to the installation: they are the same in every flight of an aircraft.
const INSTALLED: [usize; 9] = [
    VANE_GAIN,
    VANE_GAIN + 1,
    BOARD_ROLL,
    GYRO_GAIN,
    GYRO_GAIN + 1,
    GYRO_GAIN + 2,
    FORCE_GAIN,
    FORCE_GAIN + 1,
    FORCE_GAIN + 2,
];
/// Smallest relevant error of a gain, dimensionless. `AIRSPEED` (m/s) and `ASKEW` (rad) are the smallest relevant offsets
/// of airspeed and heading, `ROLLED` (rad) is the smallest relevant roll of the board.
const GAIN: f64 = 0.01;
const AIRSPEED: f64 = 0.3;
const ASKEW: f64 = 1.5 * std::f64::consts::PI / 180.0;
const ROLLED: f64 = 0.5 * std::f64::consts::PI / 180.0;
/// Number of prior standard deviations beyond which a delay is relevant.
const UNUSUAL: f64 = 4.0;
/// Smallest relevant delay, s.
const DELAY: f64 = 0.02;
/// An error is freed only if the standard deviation of its estimate without its prior is below this fraction of the standard
/// deviation of its wide prior. The flight then determines the error better than the wide prior does.
const KNOWN: f64 = 0.25;

/// Estimate of a rare error without its prior, while it is held at its prior mean.
#[derive(Clone, Copy, Debug)]
pub struct Suspect {
    /// Index of the constant.
    pub place: usize,
    /// Estimate, in the constant's unit.
    pub value: f64,
    /// Standard deviation of the estimate, in the constant's unit.
    pub sd: f64,
}

impl Suspect {
    /// Whether the flight determines the error better than its wide prior does.
    fn is_known(&self) -> bool {
        nuisance::wide(self.place).is_some_and(|wide| self.sd < KNOWN * wide)
    }
}

/// Estimates of the rare errors that are held at their prior means in `found`.
///
/// `bound` is the residual, in standard deviations, beyond which a measurement is down-weighted. The constants `held` are left
/// out, and so are those for which the user states a prior.
pub fn suspects(problem: &Problem, found: &Found, bound: f64, held: &[usize]) -> Vec<Suspect> {
    let open = |place: &usize| {
        let freed = nuisance::wide(*place).is_some_and(|wide| problem.widths[*place] >= wide);
        let stated = problem.log.sensors.known(nuisance::NAMES[*place].0).is_some();
        let has = &problem.log.has;
        !freed
            && !stated
            && !held.contains(place)
            && nuisance::wide(*place).is_some()
            && nuisance::concerned(*place, has)
            && !nuisance::unseeable(*place, has)
    };
    let places: Vec<usize> = (0..COUNT).filter(open).collect();
    let unbound = problem.unbound(found, bound, &places).unwrap_or_default();
    let pairs = places.into_iter().zip(unbound);
    pairs.map(|(place, [value, sd])| Suspect { place, value, sd }).collect()
}

/// Index of the next constant to free, and the standard deviation of its wide prior. `None` if no other constant is significant.
pub fn next(problem: &Problem, suspects: &[Suspect]) -> Option<(usize, f64)> {
    let beyond = suspects.iter().filter_map(|suspect| {
        let Suspect { place, value, sd } = *suspect;
        let (off, wide) = ((value - problem.means[place]).abs(), nuisance::wide(place)?);
        let certain = off / sd;
        let shown = certain > BEYOND_DOUBT && suspect.is_known() && off > least(problem, place);
        shown.then_some((place, wide, certain))
    });
    let (place, wide, _) = beyond.max_by(|a, b| a.2.total_cmp(&b.2))?;
    Some((place, wide))
}

/// Estimates of the constants of the installation in `found`. `problem` has the priors before any error was freed.
pub fn installed(problem: &Problem, found: &Found) -> Vec<Estimate> {
    let of = |place: usize| {
        let name = nuisance::NAMES[place].0;
        if found.widths[place] > problem.widths[place] {
            let (value, sd) = (found.values[place], found.deviations[place]);
            return Some(Estimate { name, value, sd, shown: true });
        }
        let suspect = found.suspects.iter().find(|s| s.place == place && s.is_known())?;
        Some(Estimate { name, value: suspect.value, sd: suspect.sd, shown: false })
    };
    INSTALLED.into_iter().filter_map(of).collect()
}

/// Indices of the errors that were freed in `found` and are not significant with the standard deviations of `found`. `problem` has
/// the priors before any error was freed.
pub fn doubtful(problem: &Problem, found: &Found) -> Vec<usize> {
    let doubtful = |place: &usize| {
        let off = (found.values[*place] - problem.means[*place]).abs();
        found.widths[*place] > problem.widths[*place]
            && off < BEYOND_DOUBT * found.deviations[*place]
    };
    (0..COUNT).filter(doubtful).collect()
}

/// Smallest relevant error of the constant `place`, in its unit.
fn least(problem: &Problem, place: usize) -> f64 {
    match place {
        AIRSPEED_OFFSET => AIRSPEED,
        HEADING => ASKEW,
        BOARD_ROLL => ROLLED,
        SKEW_ATTITUDE..=SKEW_VELOCITY | SKEW_FORCE => DELAY.max(UNUSUAL * problem.widths[place]),
        _ => GAIN,
    }
}
