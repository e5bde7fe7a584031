//! Simulated errors of the reconstructed path due to random sensor noise, and changes of the constants due to given residuals
//! of the air-data sensors.
//!
//! The path is the sequence of attitude, airspeed and flow angles of a track (a section of the log without gaps). The constants
//! are sensor errors and wind.

use nalgebra::{SVector, Vector3};
use rand_distr::{Distribution, StandardNormal};

use super::along::{Along, weigh};
use super::{BETWEEN, Found, HELD, Problem, WIDTH};
use crate::flight_path::band::{self, Corner, Keep, Link, Node};
use crate::flight_path::intake::Track;
use crate::flight_path::kinematics::{MOTION, MOTION_AND_GUST};
use crate::flight_path::levels::CALM;
use crate::flight_path::measurement::{AT, OTHERS, Others};
use crate::flight_path::nuisance::{self, COUNT, Values};
use crate::flight_path::path::Path;
use greylag_logs::Sampling;
use greylag_num::stream::Stream;

/// Reconstructed paths plus a simulated error with the distribution of the reconstruction error.
#[derive(Clone, Debug)]
pub struct Erring {
    /// Path of each track.
    pub paths: Vec<Path>,
    /// Simulated noise of the gyros p, q, r for each track, rad/s.
    pub gyro: Vec<Vec<[f64; 3]>>,
}

/// The unknowns of a path, for every instant.
type Unknowns<const N: usize> = Vec<[f64; N]>;

impl Problem<'_> {
    /// Changes of the constants that [`calm`](Self::calm) would estimate if the air-data sensors had the residuals `others`,
    /// given for each track and instant. `None` if the equations are singular.
    pub fn moved_by(
        &self,
        found: &Found,
        bound: f64,
        others: &[Vec<[Others; 3]>],
    ) -> Option<[Values; OTHERS]> {
        const W: usize = WIDTH + OTHERS;
        const M: usize = AT + OTHERS;
        let left = self.constants::<MOTION, W, M, BETWEEN>(found, bound, Some(others))?;
        let factor = self.information(&left)?.cholesky()?;
        Some(std::array::from_fn(|r| {
            let seen = |i: usize| !nuisance::unseeable(i, &self.log.has);
            let right = SVector::<f64, COUNT>::from_fn(|i, _| {
                if seen(i) { left.corner[OTHERS + i][r] } else { 0.0 }
            });
            factor.solve(&right).into()
        }))
    }

    /// The reconstructed paths plus the error that one random draw of the noise of every sensor causes. The constants are held.
    /// `None` if the equations are singular.
    pub fn erring(&self, found: &Found, random: &mut Stream) -> Option<Erring> {
        let mut erring = Erring { paths: Vec::new(), gyro: Vec::new() };
        for (track, path) in self.log.tracks.iter().zip(&found.paths) {
            let (path, gyro) = if found.levels.gusts > CALM {
                self.err::<MOTION_AND_GUST>(track, path, found, random)?
            } else {
                self.err::<MOTION>(track, path, found, random)?
            };
            erring.paths.push(path);
            erring.gyro.push(gyro);
        }
        Some(erring)
    }

    /// `path` plus one random draw of the estimation error, and the drawn noise of the gyros, rad/s.
    fn err<const N: usize>(
        &self,
        track: &Track,
        path: &Path,
        found: &Found,
        random: &mut Stream,
    ) -> Option<(Path, Vec<[f64; 3]>)> {
        let (moves, noise) = self.moves::<N>(track, path, found, random)?;
        let level = found.levels.gyro;
        let of = |unit: &[f64; N]| -> [f64; 3] { std::array::from_fn(|i| level[i] * unit[i]) };
        let gyro = noise.iter().map(of).collect();
        drop(noise);
        // the path is copied last: the equations of a long flight are large, too
        let mut erring = path.clone();
        moves.iter().enumerate().for_each(|(k, x)| erring.shift(k, x));
        Some((erring, gyro))
    }

    /// Changes of the unknowns of `path` by one random draw of the noise of every sensor, and the standard normal random numbers for
    /// the kinematic steps.
    fn moves<const N: usize>(
        &self,
        track: &Track,
        path: &Path,
        found: &Found,
        random: &mut Stream,
    ) -> Option<(Unknowns<N>, Unknowns<N>)> {
        let mut unit = || -> f64 { StandardNormal.sample(random) };
        let noise: Unknowns<N> = (0..path.len()).map(|_| std::array::from_fn(|_| unit())).collect();
        let mut along = Along::<N, 1, 1>::new(self, track, path, found, f64::INFINITY, None);
        along.first = Vector3::zeros();
        // as in the fit, coloured noise is replaced by white noise with a larger standard deviation
        let spread = along.spread;
        for reading in &mut along.readings {
            *reading = reading.with(std::array::from_fn(|i| spread[i] * unit()));
        }
        let drawn = Drawn { along, noise, sampling: self.sampling };
        let keep = if path.len() > HELD { Keep::Parts } else { Keep::Instants };
        let moves = band::eliminate(&drawn, keep)?.0.substitute(&drawn, &[1.0])?;
        Some((moves, drawn.noise))
    }
}

/// Equations of the error of a path that one draw of the noise of every sensor causes.
struct Drawn<'a, const N: usize> {
    along: Along<'a, N, 1, 1>,
    /// Standard normal random numbers: one for each noise input of each kinematic step from an instant to the next.
    noise: Vec<[f64; N]>,
    sampling: Sampling,
}

impl<const N: usize> band::Equations<N, 1> for Drawn<'_, N> {
    fn count(&self) -> usize {
        band::Equations::<N, 1>::count(&self.along)
    }

    fn instant(&self, k: usize, node: &mut Node<N, 1>, corner: Option<&mut Corner<1>>) {
        self.along.instant(k, node, corner);
    }

    fn link(&self, k: usize, corner: Option<&mut Corner<1>>) -> Link<N, 1> {
        let (mut step, sd, noise) = (self.along.step(k), &self.along.sd, &self.noise);
        for i in 0..N {
            let unit = match (i, self.sampling) {
                (0..3, Sampling::Instants) => 0.5 * (noise[k][i] + noise[k + 1][i]),
                _ => noise[k][i],
            };
            step.rest[i][0] = sd[i] * unit;
        }
        weigh(step, sd, f64::INFINITY, corner)
    }
}
