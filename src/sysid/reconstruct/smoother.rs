//! The smoother: the path and the constants that fit all sensors best, by Gauss–Newton.

use nalgebra::SMatrix;

use super::band::{self, Block, Border, Constants, Corner, CornerVector, NodeVector, Row};
use super::intake::{Log, Track};
use super::kinematics::Drive;
use super::measurement;
use super::noise;
use super::nuisance::{self, COUNT, Values};
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
/// First guess of how far the velocity over ground is from airspeed and vanes, m/s.
const FIRST_VELOCITY_LEVEL: f64 = 1.0;
/// Residuals beyond this many standard deviations count less.
const BOUND: f64 = 4.0;
/// Iterations before levels are taken from residuals, and in all.
const FIRST: usize = 5;
const LAST: usize = 25;
/// Block over which residuals are averaged to see their colour, s.
const COLOUR_BLOCK: f64 = 1.0;
/// Gain in −2 ln L for which a rougher air is believed.
const GUST_GAIN: f64 = 10.0;

/// Noise levels, as standard deviations.
#[derive(Clone, Copy, Debug)]
pub struct Levels {
    /// Gyros, rad/s.
    pub gyro: [f64; 3],
    /// Accelerometers, m/s².
    pub force: [f64; 3],
    /// Random change of the air's velocity together with the accelerometers' noise, as a multiple of
    /// the latter.
    pub gusts: f64,
    /// The measured channels.
    pub measured: [f64; CHANNELS],
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
    let problem = Problem { log, options, widths: nuisance::prior_widths(log.step) };
    let mut found = Smoothed {
        paths: log.tracks.iter().map(Path::guess).collect(),
        values: [0.0; COUNT],
        deviations: problem.widths,
        levels: first_levels(log),
        iterations: 0,
    };
    for iteration in 0..LAST {
        let bound = if iteration < FIRST { f64::INFINITY } else { BOUND };
        if iteration == FIRST && log.has.force {
            found.levels.gusts = problem.gusts(&found, bound).unwrap_or(1.0);
        }
        let solved = problem
            .solve(&found, bound)
            .ok_or_else(|| no_path("the equations became singular"))?;
        let moved = apply(&mut found, &solved);
        if !moved.is_finite() {
            return Err(no_path("the path left the numbers"));
        }
        found.iterations = iteration + 1;
        for place in 0..COUNT {
            found.deviations[place] = solved.covariance[(place, place)].max(0.0).sqrt();
        }
        let change = renew(&mut found.levels, &solved.residuals, log.step, iteration >= FIRST);
        if iteration > FIRST + 1 && moved < 0.02 && change < 0.02 {
            return Ok(found);
        }
    }
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
            constants.right[place] = -information * found.values[place];
            cost += information * found.values[place].powi(2);
        }
        let mut residuals: [Vec<f64>; CHANNELS] = Default::default();
        let mut stretches = Vec::new();
        for (track, path) in self.log.tracks.iter().zip(&found.paths) {
            let mut rows = self.inertial(track, path, found, &mut constants, &mut cost);
            let spread =
                std::array::from_fn(|i| found.levels.measured[i] * found.levels.colour[i]);
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
        let log_det = constants.log_det
            + 2.0 * factor.l_dirty().diagonal().map(f64::ln).sum();
        let covariance = factor.inverse();
        Some(Solved { stretches, constants: step, covariance, residuals, misfit: cost - fall + log_det })
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
        rows[0].own = Block::from_diagonal(&NodeVector::from([0.01, 0.01, 0.01, 1e-4, 1e-4, 1e-4]));
        let l = &found.levels;
        let spread: [f64; 6] =
            std::array::from_fn(|i| if i < 3 { l.gyro[i] } else { l.gusts * l.force[i - 3] } * step);
        let weight = SMatrix::<f64, 6, 1>::from(spread.map(|s| 1.0 / (s * s)));
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

    /// How rough the air is: the multiple of the accelerometers' noise that the data find likeliest.
    fn gusts(&self, found: &Smoothed, bound: f64) -> Option<f64> {
        const FACTOR: f64 = 1.8;
        let intervals: usize = found.paths.iter().map(|p| p.len() - 1).sum();
        let misfit = |gusts: f64| {
            let levels = Levels { gusts, ..found.levels };
            let solved = self.solve(&Smoothed { levels, ..found.clone() }, bound)?;
            Some(solved.misfit + 6.0 * intervals as f64 * gusts.ln())
        };
        let (mut best, mut least) = (1.0, misfit(1.0)?);
        let needed = least - GUST_GAIN;
        // 1.8^10 is 357
        for n in 1..=10 {
            let gusts = FACTOR.powi(n);
            let now = misfit(gusts)?;
            if now > least {
                break;
            }
            (best, least) = (gusts, now);
        }
        Some(if least < needed { best } else { 1.0 })
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
    for (path, stretch) in found.paths.iter_mut().zip(&solved.stretches) {
        for (k, x) in band::substitute(stretch, &solved.constants).into_iter().enumerate() {
            let turn = x.fixed_rows::<3>(0).into_owned();
            path.attitude[k] = orthonormal(&(path.attitude[k] * exp(&turn)));
            path.velocity[k] += x.fixed_rows::<3>(3);
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
        _ => FIRST_VELOCITY_LEVEL,
    });
    let force = |i: usize| over(&|t, k| t.force[k][i]).max(FORCE_FLOOR);
    Levels {
        gyro: std::array::from_fn(|i| or(over(&|t, k| t.rates[k][i]), 0.0).max(GYRO_FLOOR)),
        force: std::array::from_fn(|i| if log.has.force { force(i) } else { UNKNOWN_FORCE }),
        gusts: 1.0,
        measured: std::array::from_fn(|i| or(white[i], DEFAULTS[i]).max(FLOORS[i])),
        colour: [1.0; CHANNELS],
    }
}

/// Takes the levels anew from the residuals, at first of the velocity over ground only; returns the
/// largest relative change.
fn renew(levels: &mut Levels, residuals: &[Vec<f64>; CHANNELS], step: f64, all: bool) -> f64 {
    let mut change = 0.0_f64;
    for (channel, residuals) in residuals.iter().enumerate() {
        if channel < 6 && !all {
            continue;
        }
        let level = noise::level(residuals);
        if level.is_nan() {
            continue;
        }
        let level = level.max(FLOORS[channel]);
        change = change.max((level / levels.measured[channel]).ln().abs());
        levels.measured[channel] = level;
        if all {
            let block = (COLOUR_BLOCK / step).round() as usize;
            levels.colour[channel] = noise::colour(residuals, block);
        }
    }
    change
}
