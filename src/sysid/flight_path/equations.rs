//! Normal equations of the flight-path reconstruction. The unknowns are the path (motion and gusts at every instant) and the
//! constants of the flight (sensor errors, mean wind). A stretch is a part of the log without gaps. The equations of all
//! stretches are linearised at the present estimate, the paths are eliminated, and the constants are solved for.

mod along;
mod erring;

use nalgebra::{SMatrix, SVector, Vector3};
use rayon::prelude::*;

use along::{Along, PROCESS, step_deviations};

use crate::flight_path::band::{self, Keep, Left, Stretch};
use crate::flight_path::calibration::Suspect;
use crate::flight_path::intake::{Log, Track};
use crate::flight_path::kinematics::{Drive, MOTION, MOTION_AND_GUST};
use crate::flight_path::levels::Levels;
use crate::flight_path::measurement::{AT, Instruments, Others, PIECE, Residuals};
use crate::flight_path::nuisance::{self, COUNT, INERTIAL, Values, WIND};
use crate::flight_path::path::{CHANNELS, Path};
use crate::flight_path::{Options, ReconstructError, noise};
use greylag_logs::Sampling;
use greylag_num::statistics;

/// Number of columns if the constants are estimated: one for each constant, and one for the right-hand side.
const WIDTH: usize = COUNT + 1;
const BETWEEN: usize = COUNT - INERTIAL + 1;

/// The present estimate of paths, constants and noise.
#[derive(Clone, Debug)]
pub struct Found {
    /// Path of each track, the resampled data of a stretch.
    pub paths: Vec<Path>,
    /// Estimates of the constants.
    pub values: Values,
    /// Standard deviations of the constants.
    pub deviations: Values,
    /// Prior standard deviations of the constants. They were enlarged for constants that the data show to differ significantly
    /// from their prior means.
    pub widths: Values,
    /// Noise levels of the sensors.
    pub levels: Levels,
    /// Rare errors that are held at their prior means, with their estimates without the prior. Empty in strong gusts, whose effect
    /// the standard deviations of these estimates do not contain.
    pub suspects: Vec<Suspect>,
}

/// Data and priors of a fit.
#[derive(Clone, Copy)]
pub struct Problem<'a> {
    /// The log, resampled to uniform time steps.
    pub log: &'a Log,
    /// Settings of the reconstruction.
    pub options: &'a Options,
    /// Whether a rate sample is held until the next one, or is the value at an instant.
    pub sampling: Sampling,
    /// Prior means of the constants.
    pub means: Values,
    /// Prior standard deviations of the constants.
    pub widths: Values,
}

/// Solution of one linearisation with `N` unknowns for each instant.
pub struct Solved<const N: usize> {
    /// Changes of the `N` unknowns of the path, for every stretch and instant.
    moves: Vec<Vec<[f64; N]>>,
    /// Changes of the constants; zero if they are held.
    constants: Values,
    /// Standard deviations of the constants; zero if they are held.
    pub deviations: Values,
    /// Residuals (measured − predicted values) before the change, for every stretch.
    pub residuals: Vec<Vec<Residuals>>,
}

impl Problem<'_> {
    /// Solves for the motion and the constants, with the gusts held. Here and in the methods below, residuals beyond `bound`
    /// standard deviations have less weight (Huber).
    pub fn calm(&self, found: &Found, bound: f64) -> Option<Solved<MOTION>> {
        self.solve::<MOTION, WIDTH, AT, BETWEEN>(found, bound)
    }

    /// Solves for motion and gusts, with the constants held.
    pub fn held(&self, found: &Found, bound: f64) -> Option<Solved<MOTION_AND_GUST>> {
        self.solve::<MOTION_AND_GUST, 1, 1, 1>(found, bound)
    }

    /// The function that the line search minimises: −2 ln L of the path and the constants, where L is the likelihood with the
    /// prior. The noise levels are fixed, and terms that depend only on them are left out. `residuals` are those of `found`, for
    /// each stretch, if they are known.
    pub fn merit(&self, found: &Found, bound: f64, residuals: Option<&[Vec<Residuals>]>) -> f64 {
        let before = |i: usize| ((found.values[i] - self.means[i]) / self.widths[i]).powi(2);
        let pairs = self.log.tracks.par_iter().zip(&found.paths).enumerate();
        let one = |(k, pair): (usize, (&Track, &Path))| {
            self.misfit_of(pair, found, bound, residuals.map(|all| all[k].as_slice()))
        };
        let tracks: Vec<f64> = pairs.map(one).collect();
        tracks.iter().sum::<f64>() + (0..COUNT).map(before).sum::<f64>()
    }

    fn misfit_of(
        &self,
        (track, path): (&Track, &Path),
        found: &Found,
        bound: f64,
        residuals: Option<&[Residuals]>,
    ) -> f64 {
        let (step, gravity) = (self.log.step, self.options.gravity);
        let (values, l) = (&found.values, &found.levels);
        let spread: [f64; CHANNELS] = std::array::from_fn(|i| l.measured[i] * l.colour[i]);
        let of = |residuals: &Residuals| -> f64 {
            let sizes = (0..CHANNELS).map(|i| (residuals[i] / spread[i]).abs());
            sizes.filter(|size| !size.is_nan()).map(|size| huber(size, bound)).sum()
        };
        let measured: f64 = match residuals {
            Some(residuals) => residuals.iter().map(of).sum(),
            None => {
                // the readings of a long flight would take much memory
                let vanes_at = self.log.sensors.vanes_at();
                let sensors = Instruments { track, values, step, vanes_at };
                let pieces = (0..path.len()).step_by(PIECE);
                pieces.flat_map(|from| sensors.residuals(path, from, PIECE)).map(|r| of(&r)).sum()
            }
        };
        let drive = Drive::new(track, values, step, self.sampling, gravity);
        let sd = step_deviations::<MOTION>(l, step);
        let between = (0..path.len().saturating_sub(1)).map(|k| {
            let left = drive.step::<MOTION, 1>(path, k).rest;
            (0..MOTION).map(|i| huber((left[i][0] / sd[i]).abs(), PROCESS * bound)).sum::<f64>()
        });
        measured + between.sum::<f64>()
    }

    /// Robust standard deviations of the residuals of the kinematic steps, for each axis of rotation and velocity. They are
    /// ratios to the standard deviations that the assumed noise of gyros and accelerometers gives. If that noise is large
    /// enough, they are at most about 1.
    pub fn step_residuals(&self, found: &Found) -> [f64; MOTION] {
        let (step, gravity) = (self.log.step, self.options.gravity);
        let sd = step_deviations::<MOTION>(&found.levels, step);
        let mut left: [Vec<f64>; MOTION] = Default::default();
        for (track, path) in self.log.tracks.iter().zip(&found.paths) {
            let drive = Drive::new(track, &found.values, step, self.sampling, gravity);
            for k in 0..path.len().saturating_sub(1) {
                let rest = drive.step::<MOTION, 1>(path, k).rest;
                (0..MOTION).for_each(|i| left[i].push(rest[i][0] / sd[i]));
            }
        }
        left.map(|mut left| noise::level(&mut left))
    }

    /// Slow differences between measured and estimated roll, pitch and yaw, rad. The differences are averaged over blocks of
    /// `block` (s), and the root mean square of these means is returned. It is 0 for an angle that is not measured.
    pub fn slow_disagreement(&self, found: &Found, block: f64) -> [f64; 3] {
        let (step, vanes_at) = (self.log.step, self.log.sensors.vanes_at());
        let length = (block / step).ceil() as usize;
        let piece = length * (PIECE / length).max(1);
        let mut sums = [(0.0, 0.0); 3];
        for (track, path) in self.log.tracks.iter().zip(&found.paths) {
            let sensors = Instruments { track, values: &found.values, step, vanes_at };
            for from in (0..path.len()).step_by(piece) {
                for block in sensors.residuals(path, from, piece).chunks(length) {
                    for (channel, (sum, count)) in sums.iter_mut().enumerate() {
                        let residuals = block.iter().map(|residuals| residuals[channel]);
                        let residuals: Vec<f64> = residuals.filter(|x| x.is_finite()).collect();
                        if !residuals.is_empty() {
                            *sum += statistics::mean(&residuals).powi(2);
                            *count += 1.0;
                        }
                    }
                }
            }
        }
        sums.map(|(sum, count): (f64, f64)| (sum / count.max(1.0)).sqrt())
    }

    /// −2 ln L of the noise levels, where L is the likelihood with the constants held. Terms that do not depend on the level of
    /// the gusts are left out. `None` if the equations have no solution.
    pub fn misfit(&self, found: &Found, bound: f64) -> Option<f64> {
        let left = self.constants::<MOTION_AND_GUST, 1, 1, 1>(found, bound, None)?;
        let (first, new) = (found.levels.gusts.ln(), found.levels.gust_step(self.log.step).ln());
        let scale = |path: &Path| 2.0 * 3.0 * (first + path.len().saturating_sub(1) as f64 * new);
        let scales = found.paths.iter().map(scale).sum::<f64>();
        Some(left.corner[0][0] + left.log_det + scales)
    }

    /// Information matrix of the constants, from prior and data. For a constant that no column of the log can show, it has only
    /// the information of the prior.
    fn information<const W: usize>(&self, left: &Left<W>) -> Option<SMatrix<f64, COUNT, COUNT>> {
        let first = W.checked_sub(WIDTH)?;
        Some(SMatrix::from_fn(|i, j| {
            let before = if i == j { self.widths[i].powi(-2) } else { 0.0 };
            let seen = [i, j].iter().all(|i| !nuisance::unseeable(*i, &self.log.has));
            before + if seen { left.corner[first + i][first + j] } else { 0.0 }
        }))
    }

    /// Estimate and standard deviation of each of the constants `places`, computed without the prior of that constant. NaN
    /// if the data have no information on the constant.
    pub fn unbound(&self, found: &Found, bound: f64, places: &[usize]) -> Option<Vec<[f64; 2]>> {
        let left = self.constants::<MOTION, WIDTH, AT, BETWEEN>(found, bound, None)?;
        let bound = self.information(&left)?;
        let pull = self.pull(found, &left);
        let of = |place: &usize| {
            let (mut information, mut right) = (bound, pull);
            information[(*place, *place)] = left.corner[*place][*place];
            right[*place] = left.corner[*place][WIDTH - 1];
            information.cholesky().map_or([f64::NAN; 2], |factor| {
                let variance = factor.inverse()[(*place, *place)];
                let value = found.values[*place] + factor.solve(&right)[*place];
                [value, variance.max(0.0).sqrt()]
            })
        };
        Some(places.iter().map(of).collect())
    }

    /// Right-hand side of the equations of the constants: gradient of the log-likelihood of data and prior.
    fn pull<const W: usize>(&self, found: &Found, left: &Left<W>) -> SVector<f64, COUNT> {
        SVector::<f64, COUNT>::from_fn(|i, _| {
            let data =
                if nuisance::unseeable(i, &self.log.has) { 0.0 } else { left.corner[i][W - 1] };
            data - (found.values[i] - self.means[i]) / self.widths[i].powi(2)
        })
    }

    fn solve<const N: usize, const W: usize, const M: usize, const D: usize>(
        &self,
        found: &Found,
        bound: f64,
    ) -> Option<Solved<N>> {
        let instants = found.paths.iter().map(Path::len).sum::<usize>();
        let keep = if instants > HELD { Keep::Parts } else { Keep::Instants };
        let (stretches, left) = self.eliminate::<N, W, M, D>(found, bound, None, keep)?;
        let (mut constants, mut deviations) = ([0.0; COUNT], [0.0; COUNT]);
        let mut by = [0.0; W];
        by[W - 1] = 1.0;
        if W == WIDTH {
            let right = self.pull(found, &left);
            let factor = self.information(&left)?.cholesky()?;
            constants = factor.solve(&right).into();
            let covariance = factor.inverse();
            deviations = std::array::from_fn(|i| covariance[(i, i)].max(0.0).sqrt());
            by.iter_mut().zip(&constants).for_each(|(by, step)| *by = -step);
        }
        let solved = stretches.par_iter().map(|(along, stretch)| stretch.substitute(along, &by));
        let moves = solved.collect::<Option<_>>()?;
        let residuals = stretches.into_iter().map(|(along, _)| along.residuals()).collect();
        Some(Solved { moves, constants, deviations, residuals })
    }

    /// Equations of the constants alone, after the elimination of the paths.
    fn constants<const N: usize, const W: usize, const M: usize, const D: usize>(
        &self,
        found: &Found,
        bound: f64,
        others: Option<&[Vec<[Others; 3]>]>,
    ) -> Option<Left<W>> {
        Some(self.eliminate::<N, W, M, D>(found, bound, others, Keep::Constants)?.1)
    }

    fn eliminate<'a, const N: usize, const W: usize, const M: usize, const D: usize>(
        &'a self,
        found: &'a Found,
        bound: f64,
        others: Option<&'a [Vec<[Others; 3]>]>,
        keep: Keep,
    ) -> Option<(Vec<(Along<'a, N, M, D>, Stretch<N, W>)>, Left<W>)> {
        let pairs = self.log.tracks.par_iter().zip(&found.paths).enumerate();
        let one = |(i, (track, path)): (usize, (&'a Track, &'a Path))| {
            let others = others.and_then(|o| o.get(i)).map(Vec::as_slice);
            let along = Along::<N, M, D>::new(self, track, path, found, bound, others);
            let (stretch, left) = band::eliminate::<N, W>(&along, keep)?;
            // without a back substitution, only the equations of the constants are needed afterwards
            Some((Some((along, stretch)).filter(|_| keep != Keep::Constants), left))
        };
        let done: Vec<_> = pairs.map(one).collect::<Option<_>>()?;
        let (mut stretches, mut left) = (Vec::new(), Left::ZERO);
        for (stretch, share) in done {
            stretches.extend(stretch);
            left.add(&share);
        }
        Some((stretches, left))
    }
}

/// If a flight has more instants than this, the back substitution recomputes equations instead of storing them, and fits are made
/// again instead of being kept.
pub const HELD: usize = 100_000;

/// Huber's loss of a residual in standard deviations: quadratic up to `bound`, then linear.
fn huber(size: f64, bound: f64) -> f64 {
    if size <= bound { size * size } else { bound * (2.0 * size - bound) }
}

impl<const N: usize> Solved<N> {
    /// Changes the paths and the constants in `found` by the fraction `part` of the computed changes. Returns the largest change
    /// of a constant, in standard deviations.
    ///
    /// # Errors
    /// If the change of a constant is not finite. The error names `flight`.
    pub fn apply(
        &self,
        found: &mut Found,
        part: f64,
        flight: &str,
    ) -> Result<f64, ReconstructError> {
        let mut largest = 0.0_f64;
        for place in 0..COUNT {
            let (step, deviation) = (part * self.constants[place], self.deviations[place]);
            if deviation > 0.0 {
                found.deviations[place] = deviation;
            }
            found.values[place] += step;
            let moved = if step == 0.0 { 0.0 } else { step.abs() / deviation };
            largest = if moved.is_finite() { largest.max(moved) } else { f64::NAN };
        }
        let wind = Vector3::from_column_slice(&found.values[WIND..WIND + 3]);
        for (path, moves) in found.paths.iter_mut().zip(&self.moves) {
            path.wind = wind;
            for (k, x) in moves.iter().enumerate() {
                path.shift(k, &x.map(|x| part * x));
            }
        }
        if largest.is_finite() {
            Ok(largest)
        } else {
            Err(no_path(flight, "the path is not finite any more"))
        }
    }
}

/// The error of a reconstruction that has no finite path. `why` is the reason in words.
pub fn no_path(flight: &str, why: &'static str) -> ReconstructError {
    ReconstructError::NoPath { flight: flight.into(), why }
}
