//! The smoother: the path and the constants that fit all sensors best, by Gauss–Newton.

use nalgebra::Vector3;

use super::band::{self, Block, Border, Constants, Corner, CornerVector, NODE, NodeVector, Row};
use super::intake::{Log, Track};
use super::kinematics::{Drive, gust_kept};
use super::measurement;
use super::noise;
use super::nuisance::{self, COUNT, Values, WIND};
use super::path::{CHANNELS, Path};
use super::rotation::{exp, orthonormal};
use super::{Options, ReconstructError};

/// Smallest noise levels, of the size of what the kinematics leave out: gyro rad/s, force m/s².
const GYRO_FLOOR: f64 = 2e-4;
const FORCE_FLOOR: f64 = 5e-3;
/// Smallest noise levels of the measured channels.
const FLOORS: [f64; CHANNELS] = [2e-5, 2e-5, 2e-5, 1e-3, 5e-5, 5e-5, 1e-3, 1e-3, 1e-3];
/// Levels where too few samples tell: rad, m/s, rad, m/s.
const DEFAULTS: [f64; CHANNELS] = [0.02, 0.02, 0.05, 0.5, 0.02, 0.02, 0.5, 0.5, 0.5];
/// What the velocity may do where no accelerometer says it, m/s².
const UNKNOWN_FORCE: f64 = 3.0;
/// Gusts of calm air, m/s, and the factor to which their level is sought.
const CALM: f64 = 0.002;
const GUST_FACTOR: f64 = 2.2;
/// Residuals beyond this many standard deviations count less.
const BOUND: f64 = 4.0;
/// Part of their deviation within which constants are held, and iterations with them held.
const HELD: f64 = 1e-3;
const GUSTY: usize = 4;
/// Iterations before levels are taken from residuals, and in all.
const FIRST: usize = 5;
const LAST: usize = 25;
/// Blocks over which residuals are averaged to see their colour, s.
const COLOUR_BLOCKS: [f64; 2] = [1.0, 4.0];

/// Noise levels, as standard deviations.
#[derive(Clone, Copy, Debug)]
pub struct Levels {
    /// Gyros, rad/s.
    pub gyro: [f64; 3],
    /// Accelerometers, m/s².
    pub force: [f64; 3],
    /// Gusts, each component, m/s.
    pub gusts: f64,
    /// The measured channels.
    pub measured: [f64; CHANNELS],
    /// Their least levels: the white part of what was measured, where the samples come fast enough to
    /// tell. A path that may follow the measurements closely leaves residuals that are too small.
    pub white: [f64; CHANNELS],
    /// How much wider than white noise their means scatter.
    pub colour: [f64; CHANNELS],
}

/// What the smoother found.
#[derive(Clone, Debug)]
pub struct Smoothed {
    /// The path of each track.
    pub paths: Vec<Path>,
    /// The constants.
    pub values: Values,
    /// Their standard deviations.
    pub deviations: Values,
    /// Noise levels.
    pub levels: Levels,
    /// Iterations used.
    pub iterations: usize,
}

struct Problem<'a> {
    log: &'a Log,
    options: &'a Options,
    /// What is known of the constants beforehand: values and widths.
    prior: Values,
    widths: Values,
}

/// One linearisation, eliminated.
struct Solved {
    stretches: Vec<Vec<band::Eliminated>>,
    constants: CornerVector,
    covariance: Corner,
    residuals: [Vec<f64>; CHANNELS],
    /// −2 ln L up to terms without the levels of the inertial part.
    misfit: f64,
}

/// Smooths all stretches of `log` together.
///
/// # Errors
/// [`ReconstructError::NoPath`] if the search does not settle on numbers.
pub fn smooth(log: &Log, options: &Options) -> Result<Smoothed, ReconstructError> {
    let no_path = |why| ReconstructError::NoPath { flight: options.name.clone(), why };
    let widths = nuisance::prior_widths(log.step);
    let problem = Problem { log, options, prior: [0.0; COUNT], widths };
    let mut found = Smoothed {
        paths: log.tracks.iter().map(Path::guess).collect(),
        values: [0.0; COUNT],
        deviations: problem.widths,
        levels: first_levels(log),
        iterations: 0,
    };
    start(&mut found, log);
    for iteration in 0..LAST {
        let bound = if iteration < FIRST { f64::INFINITY } else { BOUND };
        let solved =
            problem.solve(&found, bound).ok_or_else(|| no_path("the equations became singular"))?;
        let moved = apply(&mut found, &solved);
        if !moved.is_finite() {
            return Err(no_path("the path left the numbers"));
        }
        found.iterations = iteration + 1;
        for place in 0..COUNT {
            found.deviations[place] = solved.covariance[(place, place)].max(0.0).sqrt();
        }
        if iteration < FIRST {
            continue;
        }
        let change = renew(&mut found.levels, &solved.residuals, log.step);
        if iteration > FIRST && moved < 0.05 && change < 0.02 {
            break;
        }
    }
    gusty(&problem, &mut found).ok_or_else(|| no_path("the gusts left the numbers"))?;
    Ok(found)
}

impl Problem<'_> {
    fn solve(&self, found: &Smoothed, bound: f64) -> Option<Solved> {
        let mut constants = Constants {
            matrix: Corner::zeros(),
            right: CornerVector::zeros(),
            log_det: 0.0,
            fall: 0.0,
        };
        let mut cost = 0.0;
        for place in 0..COUNT {
            let information = self.widths[place].powi(-2);
            constants.matrix[(place, place)] = information;
            let away = found.values[place] - self.prior[place];
            constants.right[place] = -information * away;
            cost += information * away * away;
        }
        let mut residuals: [Vec<f64>; CHANNELS] = Default::default();
        let mut stretches = Vec::new();
        for (track, path) in self.log.tracks.iter().zip(&found.paths) {
            let mut rows = self.inertial(track, path, found, &mut constants, &mut cost);
            let spread = std::array::from_fn(|i| found.levels.measured[i] * found.levels.colour[i]);
            let mut sums = measurement::Sums {
                matrix: &mut constants.matrix,
                right: &mut constants.right,
                cost: &mut cost,
            };
            measurement::add(
                track,
                path,
                &found.values,
                self.log.step,
                &spread,
                bound,
                &mut rows,
                &mut sums,
                &mut residuals,
            );
            stretches.push(band::eliminate(&rows, &mut constants)?);
        }
        let factor = constants.matrix.cholesky()?;
        let step = factor.solve(&constants.right);
        let fall = constants.fall + constants.right.dot(&step);
        let log_det = constants.log_det + 2.0 * factor.l_dirty().diagonal().map(f64::ln).sum();
        let covariance = factor.inverse();
        Some(Solved {
            stretches,
            constants: step,
            covariance,
            residuals,
            misfit: cost - fall + log_det,
        })
    }

    fn inertial(
        &self,
        track: &Track,
        path: &Path,
        found: &Smoothed,
        constants: &mut Constants,
        cost: &mut f64,
    ) -> Vec<Row> {
        let (step, gravity) = (self.log.step, self.options.gravity);
        let drive = Drive::new(track, &found.values, step, self.options.timing, gravity);
        let mut rows = vec![Row::zero(); path.len()];
        // a start of which nothing is known
        let l = &found.levels;
        let information = l.gusts.powi(-2);
        let start: [f64; NODE] = std::array::from_fn(|i| [0.01, 1e-4, information][i / 3]);
        rows[0].own = Block::from_diagonal(&NodeVector::from(start));
        rows[0].right.fixed_rows_mut::<3>(6).copy_from(&(path.gust[0] * -information));
        *cost += information * path.gust[0].norm_squared();
        let gusts = l.gusts * (1.0 - gust_kept(step).powi(2)).sqrt();
        let weight = NodeVector::from_fn(|i, _| match i {
            0..3 => (l.gyro[i] * step).powi(-2),
            3..6 => (l.force[i - 3] * step).powi(-2),
            _ => gusts.powi(-2),
        });
        for k in 0..path.len() - 1 {
            let link = drive.link(path, &found.values, k, step, gravity);
            let weigh = |m: &Block| Block::from_fn(|i, j| m[(i, j)] * weight[i]);
            let (first, second) = (weigh(&link.first).transpose(), weigh(&link.second).transpose());
            rows[k].own += first * link.first;
            rows[k].right -= first * link.residual;
            rows[k].border += first * link.constants;
            rows[k + 1].own += second * link.second;
            rows[k + 1].right -= second * link.residual;
            rows[k + 1].border += second * link.constants;
            rows[k + 1].back += second * link.first;
            let weighted = Border::from_fn(|i, j| link.constants[(i, j)] * weight[i]).transpose();
            constants.matrix += weighted * link.constants;
            constants.right -= weighted * link.residual;
            *cost += link.residual.component_mul(&link.residual).dot(&weight);
        }
        rows
    }

    /// The level of the gusts that the data find likeliest, m/s.
    fn gusts(&self, found: &Smoothed, bound: f64) -> Option<f64> {
        let components = 3.0 * found.paths.iter().map(Path::len).sum::<usize>() as f64;
        let misfit = |gusts: f64| {
            let levels = Levels { gusts, ..found.levels };
            let solved = self.solve(&Smoothed { levels, ..found.clone() }, bound)?;
            Some(solved.misfit + 2.0 * components * gusts.ln())
        };
        let (mut best, mut least) = (CALM, misfit(CALM)?);
        for coarse in [0.02, 0.2, 1.0, 5.0] {
            let now = misfit(coarse)?;
            if now > least {
                break;
            }
            (best, least) = (coarse, now);
        }
        if best > CALM {
            for fine in [best / GUST_FACTOR, best * GUST_FACTOR] {
                let now = misfit(fine)?;
                if now < least {
                    (best, least) = (fine, now);
                }
            }
        }
        Some(best)
    }
}

/// Lets the air gust along the path where the data find that likelier, the constants held.
///
/// Until here gusts are noise of airspeed and vanes. To seek the path, the gusts and the constants
/// together would find an airspeed scale far above one, for it makes every gust smaller.
fn gusty(problem: &Problem, found: &mut Smoothed) -> Option<()> {
    let mut trial = found.clone();
    for channel in 3..6 {
        trial.levels.measured[channel] = trial.levels.white[channel];
        trial.levels.colour[channel] = 1.0;
    }
    let held =
        Problem { prior: found.values, widths: found.deviations.map(|d| HELD * d), ..*problem };
    trial.levels.gusts = held.gusts(&trial, f64::INFINITY)?;
    if trial.levels.gusts <= CALM {
        return Some(());
    }
    for _ in 0..GUSTY {
        let solved = held.solve(&trial, BOUND)?;
        if !apply(&mut trial, &solved).is_finite() {
            return None;
        }
    }
    trial.deviations = found.deviations;
    *found = trial;
    Some(())
}

/// Sets out in the wind that the measurements leave.
fn start(found: &mut Smoothed, log: &Log) {
    let mut sum = (Vector3::zeros(), 0.0);
    for (path, track) in found.paths.iter().zip(&log.tracks) {
        let (left, count) = path.wind_left(track);
        sum = (sum.0 + left, sum.1 + count);
    }
    if sum.1 > 0.0 {
        let wind = sum.0 / sum.1;
        found.values[WIND..WIND + 3].copy_from_slice(wind.as_slice());
        found.paths.iter_mut().for_each(|path| path.carry(wind));
    }
}

/// Moves the path and the constants; returns the largest move of a constant in its deviation.
fn apply(found: &mut Smoothed, solved: &Solved) -> f64 {
    let mut largest = 0.0_f64;
    for place in 0..COUNT {
        let step = solved.constants[place];
        found.values[place] += step;
        let moved = step.abs() / solved.covariance[(place, place)].sqrt();
        largest = if moved.is_finite() { largest.max(moved) } else { f64::NAN };
    }
    let wind = Vector3::from_column_slice(&found.values[WIND..WIND + 3]);
    for (path, stretch) in found.paths.iter_mut().zip(&solved.stretches) {
        path.wind = wind;
        for (k, x) in band::substitute(stretch, &solved.constants).into_iter().enumerate() {
            let turn = x.fixed_rows::<3>(0).into_owned();
            path.attitude[k] = orthonormal(&(path.attitude[k] * exp(&turn)));
            path.velocity[k] += x.fixed_rows::<3>(3);
            path.gust[k] += x.fixed_rows::<3>(6);
        }
    }
    largest
}

/// Levels before anything is fitted: the white part of every channel.
fn first_levels(log: &Log) -> Levels {
    let over = |get: &dyn Fn(&Track, usize) -> f64| {
        noise::white(log.tracks.iter().flat_map(|t| (0..t.len()).map(move |k| get(t, k))))
    };
    let or = |level: f64, default: f64| if level.is_finite() { level } else { default };
    let attitude = |i: usize| {
        // angles near ±π jump; their sine and cosine do not
        let (a, b) = (over(&|t, k| t.attitude[k][i].sin()), over(&|t, k| t.attitude[k][i].cos()));
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
        let count = tracks.flat_map(|t| (0..t.len()).map(move |k| measurement::measured(t, i, k)));
        2 * count.filter(|x| x.is_finite()).count() > samples
    };
    let force = |i: usize| over(&|t, k| t.force[k][i]).max(FORCE_FLOOR);
    Levels {
        gyro: std::array::from_fn(|i| or(over(&|t, k| t.rates[k][i]), 0.0).max(GYRO_FLOOR)),
        force: std::array::from_fn(|i| if log.has.force { force(i) } else { UNKNOWN_FORCE }),
        gusts: CALM,
        measured: std::array::from_fn(|i| or(white[i], DEFAULTS[i]).max(FLOORS[i])),
        white: std::array::from_fn(|i| if dense(i) { white[i].max(FLOORS[i]) } else { FLOORS[i] }),
        colour: [1.0; CHANNELS],
    }
}

/// Takes the levels anew from the residuals; returns the largest relative change.
fn renew(levels: &mut Levels, residuals: &[Vec<f64>; CHANNELS], step: f64) -> f64 {
    let mut change = 0.0_f64;
    for (channel, residuals) in residuals.iter().enumerate() {
        let level = noise::level(residuals);
        if level.is_nan() {
            continue;
        }
        let level = level.max(levels.white[channel]);
        change = change.max((level / levels.measured[channel]).ln().abs());
        levels.measured[channel] = level;
        let over = |block: f64| noise::colour(residuals, (block / step).round() as usize);
        levels.colour[channel] = COLOUR_BLOCKS.map(over).into_iter().fold(1.0, f64::max);
    }
    change
}
