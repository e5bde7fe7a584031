//! The equations of a fit: all stretches linearised at what was found, eliminated, solved.

mod erring;

use nalgebra::{SMatrix, SVector, Vector3};
use rayon::prelude::*;

use crate::flight_path::band::{self, Left, Link, Node, Stretch, add_gram};
use crate::flight_path::intake::{Log, Track};
use crate::flight_path::kinematics::{Drive, MOTION, MOTION_AND_GUST, Step, gust_kept};
use crate::flight_path::levels::Levels;
use crate::flight_path::measurement::{self, AT, Others, Reading};
use crate::flight_path::nuisance::{self, COUNT, INERTIAL, Values, WIND};
use crate::flight_path::path::{CHANNELS, Path};
use crate::flight_path::{Options, ReconstructError, noise};
use greylag_logs::Sampling;
use greylag_num::statistics;

/// Columns where the constants are free: all, those between instants; right-hand side last.
const WIDTH: usize = COUNT + 1;
const BETWEEN: usize = COUNT - INERTIAL + 1;

/// What was found so far.
#[derive(Clone, Debug)]
pub struct Found {
    /// The path of each track.
    pub paths: Vec<Path>,
    /// The constants.
    pub values: Values,
    /// Their standard deviations.
    pub deviations: Values,
    /// Noise levels.
    pub levels: Levels,
}

/// What is fitted.
#[derive(Clone, Copy)]
pub struct Problem<'a> {
    /// The log.
    pub log: &'a Log,
    /// The settings of the reconstruction.
    pub options: &'a Options,
    /// What a rate sample stands for.
    pub sampling: Sampling,
    /// Means of the constants before the data is seen.
    pub means: Values,
    /// Standard deviations of the constants before the data is seen.
    pub widths: Values,
}

/// One linearisation, solved: `N` unknowns an instant.
pub struct Solved<const N: usize> {
    /// Moves of every instant of every stretch.
    moves: Vec<Vec<[f64; N]>>,
    /// Moves of the constants; zero where they are held.
    constants: Values,
    /// Standard deviations of the constants; zero where they are held.
    pub deviations: Values,
    /// The readings before the move.
    pub readings: Vec<Vec<Reading>>,
}

/// Beyond so many of the measurements' bounds a step of the kinematics counts less: a launcher, an impact or an estimator that aligns
/// itself moves the logged path by more than gyros and accelerometers say.
const PROCESS: f64 = 1.5;

impl Problem<'_> {
    /// The path's motion with the constants, gusts as they are.
    pub fn calm(&self, found: &Found, bound: f64) -> Option<Solved<MOTION>> {
        self.solve::<MOTION, WIDTH, AT, BETWEEN>(found, bound)
    }

    /// Motion with gusts, the constants held.
    pub fn held(&self, found: &Found, bound: f64) -> Option<Solved<MOTION_AND_GUST>> {
        self.solve::<MOTION_AND_GUST, 1, 1, 1>(found, bound)
    }

    /// −2 ln L of the path and the constants at levels that are held, up to a constant: what a step has to lessen.
    pub fn merit(&self, found: &Found, bound: f64) -> f64 {
        let before = |i: usize| ((found.values[i] - self.means[i]) / self.widths[i]).powi(2);
        let pairs = self.log.tracks.par_iter().zip(&found.paths);
        let tracks: Vec<f64> =
            pairs.map(|(track, path)| self.misfit_of(track, path, found, bound)).collect();
        tracks.iter().sum::<f64>() + (0..COUNT).map(before).sum::<f64>()
    }

    fn misfit_of(&self, track: &Track, path: &Path, found: &Found, bound: f64) -> f64 {
        let (step, gravity) = (self.log.step, self.options.gravity);
        let (values, l) = (&found.values, &found.levels);
        let readings =
            measurement::readings(track, path, values, step, self.log.sensors.vanes_at());
        let drive = Drive::new(track, values, step, self.sampling, gravity);
        let spread: [f64; CHANNELS] = std::array::from_fn(|i| l.measured[i] * l.colour[i]);
        let sd = step_deviations::<MOTION>(l, step);
        let size = |r: &Reading, i: usize| (r.residual[i] / spread[i]).abs();
        let measured = readings.iter().flat_map(|r| (0..CHANNELS).map(move |i| size(r, i)));
        let measured: f64 =
            measured.filter(|size| !size.is_nan()).map(|size| huber(size, bound)).sum();
        let between = (0..path.len().saturating_sub(1)).map(|k| {
            let left = drive.step::<MOTION, 1>(path, values, k, step, gravity).rest;
            (0..MOTION).map(|i| huber((left[i][0] / sd[i]).abs(), PROCESS * bound)).sum::<f64>()
        });
        measured + between.sum::<f64>()
    }

    /// What the steps between samples leave, in the standard deviations that gyros and accelerometers are given: robust
    /// scale of each axis of turn and velocity. It is below one where these are large enough.
    pub fn strain(&self, found: &Found) -> [f64; MOTION] {
        let (step, gravity) = (self.log.step, self.options.gravity);
        let sd = step_deviations::<MOTION>(&found.levels, step);
        let mut left: [Vec<f64>; MOTION] = Default::default();
        for (track, path) in self.log.tracks.iter().zip(&found.paths) {
            let drive = Drive::new(track, &found.values, step, self.sampling, gravity);
            for k in 0..path.len().saturating_sub(1) {
                let rest = drive.step::<MOTION, 1>(path, &found.values, k, step, gravity).rest;
                (0..MOTION).for_each(|i| left[i].push(rest[i][0] / sd[i]));
            }
        }
        left.map(|mut left| noise::level(&mut left))
    }

    /// Root mean square of what the measured roll, pitch and yaw are off the path over blocks of `block` (s), rad; zero where
    /// they were not measured.
    pub fn slow_disagreement(&self, found: &Found, block: f64) -> [f64; 3] {
        let vanes_at = self.log.sensors.vanes_at();
        let mut sums = [(0.0, 0.0); 3];
        for (track, path) in self.log.tracks.iter().zip(&found.paths) {
            let readings =
                measurement::readings(track, path, &found.values, self.log.step, vanes_at);
            for block in readings.chunks((block / self.log.step).ceil() as usize) {
                for (channel, (sum, count)) in sums.iter_mut().enumerate() {
                    let residuals = block.iter().map(|r| r.residual[channel]);
                    let residuals: Vec<f64> = residuals.filter(|x| x.is_finite()).collect();
                    if !residuals.is_empty() {
                        *sum += statistics::mean(&residuals).powi(2);
                        *count += 1.0;
                    }
                }
            }
        }
        sums.map(|(sum, count): (f64, f64)| (sum / count.max(1.0)).sqrt())
    }

    /// −2 ln L of the levels, up to what does not change with the gusts' level, with the constants held.
    pub fn misfit(&self, found: &Found, bound: f64) -> Option<f64> {
        let (_, _, left) = self.eliminate::<MOTION_AND_GUST, 1, 1, 1>(found, bound, None)?;
        let components = 3.0 * found.paths.iter().map(Path::len).sum::<usize>() as f64;
        let misfit = left.corner[0][0] + left.log_det;
        Some(misfit + 2.0 * components * found.levels.gusts.ln())
    }

    /// What is known of the constants, before the data and by them (the last columns but one), those
    /// that the log cannot tell before the data alone.
    fn information<const W: usize>(&self, left: &Left<W>) -> Option<SMatrix<f64, COUNT, COUNT>> {
        let first = W.checked_sub(WIDTH)?;
        Some(SMatrix::from_fn(|i, j| {
            let before = if i == j { self.widths[i].powi(-2) } else { 0.0 };
            let seen = [i, j].iter().all(|i| !nuisance::unseeable(*i, &self.log.has));
            before + if seen { left.corner[first + i][first + j] } else { 0.0 }
        }))
    }

    fn solve<const N: usize, const W: usize, const M: usize, const D: usize>(
        &self,
        found: &Found,
        bound: f64,
    ) -> Option<Solved<N>> {
        let (stretches, readings, left) = self.eliminate::<N, W, M, D>(found, bound, None)?;
        let (mut constants, mut deviations) = ([0.0; COUNT], [0.0; COUNT]);
        let mut by = [0.0; W];
        by[W - 1] = 1.0;
        if W == WIDTH {
            let right = SVector::<f64, COUNT>::from_fn(|i, _| {
                let data =
                    if nuisance::unseeable(i, &self.log.has) { 0.0 } else { left.corner[i][W - 1] };
                data - (found.values[i] - self.means[i]) / self.widths[i].powi(2)
            });
            let factor = self.information(&left)?.cholesky()?;
            constants = factor.solve(&right).into();
            let covariance = factor.inverse();
            deviations = std::array::from_fn(|i| covariance[(i, i)].max(0.0).sqrt());
            by.iter_mut().zip(&constants).for_each(|(by, step)| *by = -step);
        }
        let moves = stretches.par_iter().map(|s| s.substitute(&by)).collect();
        Some(Solved { moves, constants, deviations, readings })
    }

    fn eliminate<const N: usize, const W: usize, const M: usize, const D: usize>(
        &self,
        found: &Found,
        bound: f64,
        others: Option<&[Vec<[Others; 3]>]>,
    ) -> Option<(Vec<Stretch<N, W>>, Vec<Vec<Reading>>, Left<W>)> {
        let pairs = self.log.tracks.par_iter().zip(&found.paths).enumerate();
        let done: Vec<_> = pairs
            .map(|(i, (track, path))| {
                let others = others.and_then(|o| o.get(i)).map(Vec::as_slice);
                self.stretch::<N, W, M, D>(track, path, found, bound, others)
            })
            .collect::<Option<_>>()?;
        let (mut stretches, mut readings, mut left) = (Vec::new(), Vec::new(), Left::ZERO);
        for (stretch, reading, share) in done {
            stretches.push(stretch);
            readings.push(reading);
            left.add(&share);
        }
        Some((stretches, readings, left))
    }

    fn stretch<const N: usize, const W: usize, const M: usize, const D: usize>(
        &self,
        track: &Track,
        path: &Path,
        found: &Found,
        bound: f64,
        others: Option<&[[Others; 3]]>,
    ) -> Option<(Stretch<N, W>, Vec<Reading>, Left<W>)> {
        let (step, gravity) = (self.log.step, self.options.gravity);
        let (values, l) = (&found.values, &found.levels);
        let readings =
            measurement::readings(track, path, values, step, self.log.sensors.vanes_at());
        let drive = Drive::new(track, values, step, self.sampling, gravity);
        let spread = std::array::from_fn(|i| l.measured[i] * l.colour[i]);
        let sd = step_deviations::<N>(l, step);
        let instant = |k: usize, node: &mut Node<N, W>, corner: &mut band::Corner<W>| {
            if k == 0 {
                start::<N, W>(&path.gust[0], l.gusts, node, corner);
            }
            measurement::add::<N, W, M>(
                path,
                values,
                k,
                &readings[k],
                &spread,
                bound,
                others.map(|o| &o[k]),
                node,
                corner,
            );
        };
        let link = |k: usize, corner: &mut band::Corner<W>| {
            let step = drive.step::<N, D>(path, values, k, step, gravity);
            weigh(step, &sd, PROCESS * bound, corner)
        };
        let (stretch, left) = band::eliminate(path.len(), instant, link)?;
        Some((stretch, readings, left))
    }
}

/// Huber's loss of a residual of so many standard deviations: its square, beyond `bound` linear.
fn huber(size: f64, bound: f64) -> f64 {
    if size <= bound { size * size } else { bound * (2.0 * size - bound) }
}

/// Standard deviations of the differences between samples `step` (s) apart.
fn step_deviations<const N: usize>(levels: &Levels, step: f64) -> [f64; N] {
    let gust = levels.gusts * (1.0 - gust_kept(step).powi(2)).sqrt();
    std::array::from_fn(|i| match i {
        0..3 => levels.gyro[i] * step,
        3..MOTION => levels.force[i - 3] * step,
        _ => gust,
    })
}

/// A start of which nothing is known but the size of gusts.
fn start<const N: usize, const W: usize>(
    gust: &Vector3<f64>,
    level: f64,
    node: &mut Node<N, W>,
    corner: &mut band::Corner<W>,
) {
    for i in 0..N {
        let information = [0.01, 1e-4, level.powi(-2)][i / 3];
        node.own[i][i] += information;
        if i >= MOTION {
            let gust = gust[i - MOTION];
            node.rest[i][W - 1] -= gust * information;
            corner[W - 1][W - 1] += gust * gust * information;
        }
    }
}

/// The equations of a step whose rows have the standard deviations `sd`; a residual beyond `bound` of them counts less.
fn weigh<const N: usize, const W: usize, const D: usize>(
    mut step: Step<N, D>,
    sd: &[f64; N],
    bound: f64,
    corner: &mut band::Corner<W>,
) -> Link<N, W> {
    for (i, sd) in sd.iter().enumerate() {
        let size = (step.rest[i][D - 1] / sd).abs();
        let weight = (bound / size).min(1.0).sqrt() / sd;
        step.first[i].iter_mut().for_each(|x| *x *= weight);
        step.second[i].iter_mut().for_each(|x| *x *= weight);
        step.rest[i].iter_mut().for_each(|x| *x *= weight);
    }
    let mut link = Link { first: Node::ZERO, second: Node::ZERO, coupling: [[0.0; N]; N] };
    add_gram(&mut link.first.own, &step.first, &step.first);
    add_gram(&mut link.second.own, &step.second, &step.second);
    add_gram(&mut link.coupling, &step.first, &step.second);
    for (node, by) in [(&mut link.first, &step.first), (&mut link.second, &step.second)] {
        let mut rest = [[0.0; D]; N];
        add_gram(&mut rest, by, &step.rest);
        for (row, rest) in node.rest.iter_mut().zip(&rest) {
            row[W - D..].copy_from_slice(rest);
        }
    }
    let mut own = [[0.0; D]; D];
    add_gram(&mut own, &step.rest, &step.rest);
    for (row, own) in corner[W - D..].iter_mut().zip(&own) {
        row[W - D..].iter_mut().zip(own).for_each(|(x, y)| *x += y);
    }
    link
}

impl<const N: usize> Solved<N> {
    /// Moves the path and the constants by a `part` of the step; returns the largest move of a constant in its
    /// deviation.
    ///
    /// # Errors
    /// The path left the numbers.
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
            Err(no_path(flight, "the path left the numbers"))
        }
    }
}

/// The search ended without numbers.
pub fn no_path(flight: &str, why: &'static str) -> ReconstructError {
    ReconstructError::NoPath { flight: flight.into(), why }
}
