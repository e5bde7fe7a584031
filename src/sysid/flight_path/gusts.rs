//! Uncertainty of the estimated constants (sensor errors and mean wind) due to gusts, by simulation.
//!
//! The fit of the constants assumes white noise of the air-data sensors, with a variance that includes the gusts. But gusts are
//! correlated over many seconds. The fit therefore understates the error of the mean wind and overstates that of a delay. Here,
//! random gusts of the estimated level are inserted into the equations of the fit, and the resulting changes of the constants
//! are evaluated.

use nalgebra::{Matrix3, Vector3};
use rand_distr::{Distribution, StandardNormal};

use crate::flight_path::equations::{Found, Problem};
use crate::flight_path::levels::Levels;
use crate::flight_path::measurement::{OTHERS, Others, by_gust};
use crate::flight_path::nuisance::{COUNT, Values};
use crate::flight_path::path::Path;
use greylag_num::stream::{Stream, stream};

/// Number of pairs of random draws for which one set of equations is solved. A pair has one draw without gusts and one with
/// gusts.
const PAIRS: usize = OTHERS / 2;
/// Number of sets of equations. With their 32 pairs, the relative error of a standard deviation is one eighth.
const SETS: u64 = 4;

/// Standard deviations of the constants in `found`, which is a fit that assumes no gusts. The data have the noise levels of
/// `rough`: gusts, and white noise of the air-data sensors. Residuals beyond `bound` standard deviations are down-weighted, as
/// in the fit. `None` if the equations are singular.
pub fn deviations(problem: &Problem, found: &Found, rough: &Levels, bound: f64) -> Option<Values> {
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

/// Random residuals of airspeed, α and β along a path, for all draws. The first half of the draws has the white noise that the
/// fit assumes. The second half has white noise and gusts, with the same random numbers for the white noise.
fn draws(
    problem: &Problem,
    path: &Path,
    found: &Found,
    rough: &Levels,
    random: &mut Stream,
) -> Vec<[Others; 3]> {
    let mut draw = || -> f64 { StandardNormal.sample(random) };
    let step = problem.log.step;
    let (level, kept) = (rough.gusts, rough.gust_kept(step));
    let fresh = rough.gust_step(step);
    let mut gusts: [Vector3<f64>; PAIRS] =
        std::array::from_fn(|_| Vector3::from_fn(|_, _| level * draw()));
    let (l, white) = (&found.levels, &rough.measured);
    (0..path.len())
        .map(|k| {
            let by_gust = by_gust(path, k, &found.values).unwrap_or(Matrix3::zeros());
            let mut rows = [[0.0_f32; OTHERS]; 3];
            for (pair, gust) in gusts.iter_mut().enumerate() {
                let felt = by_gust * *gust;
                for i in 0..3 {
                    let unit = draw();
                    rows[i][pair] = (unit * l.measured[3 + i] * l.colour[3 + i]) as f32;
                    rows[i][PAIRS + pair] = (unit * white[3 + i] + felt[i]) as f32;
                }
                *gust = *gust * kept + Vector3::from_fn(|_, _| fresh * draw());
            }
            rows
        })
        .collect()
}
