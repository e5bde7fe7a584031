//! Uncertainty of the constants due to gusts, by simulation.
//!
//! The fit of the constants assumes white noise of the air-data sensors with a variance that includes the gusts. But gusts
//! are correlated over many seconds. White noise therefore understates the error of the mean wind and overstates that of a
//! delay. Here, random gusts of the estimated level are inserted into the equations of the fit.

use nalgebra::{Matrix3, Vector3};
use rand_distr::{Distribution, StandardNormal};

use crate::flight_path::equations::{Found, Problem};
use crate::flight_path::kinematics::gust_kept;
use crate::flight_path::measurement::{OTHERS, Others, by_gust};
use crate::flight_path::nuisance::{COUNT, Values};
use crate::flight_path::path::Path;
use greylag_num::stream::{Stream, stream};

/// Number of pairs of random draws for which one set of equations is solved. A pair is a draw without gusts and a draw with
/// gusts.
const PAIRS: usize = OTHERS / 2;
/// Number of sets of equations. Their 32 pairs determine a standard deviation to one eighth of its value.
const SETS: u64 = 4;

/// Standard deviations of the constants in `found`, a fit that assumes no gusts, for data with the noise levels of `rough`.
/// The noise of `rough` consists of gusts and of white noise of the air-data sensors.
pub fn deviations(problem: &Problem, found: &Found, rough: &Found, bound: f64) -> Option<Values> {
    let (mut assumed, mut drawn) = ([0.0; COUNT], [0.0; COUNT]);
    for set in 0..SETS {
        let mut random = stream(set, &[]);
        let others: Vec<_> = found
            .paths
            .iter()
            .map(|path| draws(problem, path, found, rough, &mut random))
            .collect();
        let moved = problem.moved_by(found, bound, &others)?;
        for place in 0..COUNT {
            for pair in 0..PAIRS {
                assumed[place] += moved[pair][place].powi(2);
                drawn[place] += moved[PAIRS + pair][place].powi(2);
            }
        }
    }
    let count = PAIRS as f64 * SETS as f64;
    Some(std::array::from_fn(|place| {
        let others = (found.deviations[place].powi(2) - assumed[place] / count).max(0.0);
        (others + drawn[place] / count).sqrt()
    }))
}

/// Random residuals of airspeed, α and β along a path. The first half of the draws has the noise that the fit assumes. The
/// second half has white noise and gusts, from the same random numbers.
fn draws(
    problem: &Problem,
    path: &Path,
    found: &Found,
    rough: &Found,
    random: &mut Stream,
) -> Vec<[Others; 3]> {
    let mut draw = || -> f64 { StandardNormal.sample(random) };
    let (level, kept) = (rough.levels.gusts, gust_kept(problem.log.step));
    let fresh = level * (1.0 - kept * kept).sqrt();
    let mut gusts: [Vector3<f64>; PAIRS] =
        std::array::from_fn(|_| Vector3::from_fn(|_, _| level * draw()));
    let (l, white) = (&found.levels, &rough.levels.measured);
    (0..path.len())
        .map(|k| {
            let by_gust = by_gust(path, k, &found.values).unwrap_or(Matrix3::zeros());
            let mut rows = [[0.0; OTHERS]; 3];
            for (pair, gust) in gusts.iter_mut().enumerate() {
                let felt = by_gust * *gust;
                for i in 0..3 {
                    let unit = draw();
                    rows[i][pair] = unit * l.measured[3 + i] * l.colour[3 + i];
                    rows[i][PAIRS + pair] = unit * white[3 + i] + felt[i];
                }
                *gust = *gust * kept + Vector3::from_fn(|_, _| fresh * draw());
            }
            rows
        })
        .collect()
}
