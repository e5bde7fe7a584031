//! Equations of one stretch of a log in the flight-path reconstruction, linearised at the present path.
//!
//! The unknowns are the path (attitude, velocity and gust at each instant) and constants such as sensor errors and wind. The
//! equations compare the path with the measurements, and each step of the path with gyros and accelerometers.

use nalgebra::Vector3;

use super::{Found, Problem};
use crate::flight_path::band::{self, Link, Node, add_gram, add_upper_gram};
use crate::flight_path::intake::Track;
use crate::flight_path::kinematics::{Drive, MOTION, Step};
use crate::flight_path::levels::Levels;
use crate::flight_path::measurement::{self, Instruments, Others, Reading, Residuals};
use crate::flight_path::nuisance::Values;
use crate::flight_path::path::{CHANNELS, Path};

/// Residuals of kinematic steps are down-weighted beyond this multiple of the bound for measurements. At a launch, an impact
/// or an alignment of the autopilot's attitude estimator, the logged path moves more than gyros and accelerometers measure.
pub const PROCESS: f64 = 1.5;

/// Equations of a stretch along the present path, with `N` unknowns for each instant. `M` is the number of columns for
/// constants that act at instants, `D` for constants that act between instants. Both numbers include the right-hand side.
pub struct Along<'a, const N: usize, const M: usize, const D: usize> {
    path: &'a Path,
    values: &'a Values,
    /// Measurements less their predictions.
    pub readings: Vec<Reading>,
    drive: Drive<'a>,
    /// Gust at the first instant of the path; `gusts` is the standard deviation of gusts. Both in m/s.
    pub first: Vector3<f64>,
    gusts: f64,
    /// Standard deviations of the measured channels. `sd` holds those of the residuals of a kinematic step.
    pub spread: [f64; CHANNELS],
    pub sd: [f64; N],
    bound: f64,
    others: Option<&'a [[Others; 3]]>,
}

impl<'a, const N: usize, const M: usize, const D: usize> Along<'a, N, M, D> {
    /// Equations of `track` along `path`, with the constants and levels of `found`.
    pub fn new(
        problem: &Problem,
        track: &'a Track,
        path: &'a Path,
        found: &'a Found,
        bound: f64,
        others: Option<&'a [[Others; 3]]>,
    ) -> Self {
        let (step, gravity) = (problem.log.step, problem.options.gravity);
        let (values, l) = (&found.values, &found.levels);
        let sensors = Instruments { track, values, step, vanes_at: problem.log.sensors.vanes_at() };
        Along {
            readings: sensors.readings(path),
            drive: Drive::new(track, values, step, problem.sampling, gravity).in_gusts(l.gust_time),
            first: path.gust[0],
            gusts: l.gusts,
            spread: std::array::from_fn(|i| l.measured[i] * l.colour[i]),
            sd: step_deviations::<N>(l, step),
            path,
            values,
            bound,
            others,
        }
    }

    /// The residuals of the readings. They use the memory of the readings, because both would be large in a long flight.
    pub fn residuals(self) -> Vec<Residuals> {
        let mut all: Vec<Residuals> = self.readings.into_iter().map(|r| r.residual).collect();
        all.shrink_to_fit();
        all
    }

    /// The kinematic step from sample `k` to the next one.
    pub fn step(&self, k: usize) -> Step<N, D> {
        self.drive.step::<N, D>(self.path, k)
    }
}

impl<const N: usize, const W: usize, const M: usize, const D: usize> band::Equations<N, W>
    for Along<'_, N, M, D>
{
    fn count(&self) -> usize {
        self.path.len()
    }

    fn instant(&self, k: usize, node: &mut Node<N, W>, mut corner: Option<&mut band::Corner<W>>) {
        if k == 0 {
            start::<N, W>(&self.first, self.gusts, node, corner.as_deref_mut());
        }
        measurement::add::<N, W, M>(
            self.path,
            self.values,
            k,
            &self.readings[k],
            &self.spread,
            self.bound,
            self.others.map(|o| &o[k]),
            node,
            corner,
        );
    }

    fn link(&self, k: usize, corner: Option<&mut band::Corner<W>>) -> Link<N, W> {
        weigh(self.step(k), &self.sd, PROCESS * self.bound, corner)
    }
}

/// Standard deviations of the residuals of a kinematic step over `step` (s): attitude (rad), velocity (m/s), gust (m/s).
pub fn step_deviations<const N: usize>(levels: &Levels, step: f64) -> [f64; N] {
    let gust = levels.gust_step(step);
    std::array::from_fn(|i| match i {
        0..3 => levels.gyro[i] * step,
        3..MOTION => levels.force[i - 3] * step,
        _ => gust,
    })
}

/// Adds the prior of the first instant. Its standard deviations of 10 rad and 100 m/s hardly constrain the motion. The gust
/// has the standard deviation `level`.
fn start<const N: usize, const W: usize>(
    gust: &Vector3<f64>,
    level: f64,
    node: &mut Node<N, W>,
    mut corner: Option<&mut band::Corner<W>>,
) {
    for i in 0..N {
        let information = [0.01, 1e-4, level.powi(-2)][i / 3];
        node.own[i][i] += information;
        if i >= MOTION {
            let gust = gust[i - MOTION];
            node.rest[i][W - 1] -= gust * information;
            if let Some(corner) = &mut corner {
                corner[W - 1][W - 1] += gust * gust * information;
            }
        }
    }
}

/// Normal equations of a kinematic step. The rows of the step have the standard deviations `sd`. A residual beyond `bound`
/// standard deviations is down-weighted.
pub fn weigh<const N: usize, const W: usize, const D: usize>(
    mut step: Step<N, D>,
    sd: &[f64; N],
    bound: f64,
    corner: Option<&mut band::Corner<W>>,
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
    let Some(corner) = corner else { return link };
    let mut own = [[0.0; D]; D];
    add_upper_gram(&mut own, &step.rest);
    for (row, own) in corner[W - D..].iter_mut().zip(&own) {
        row[W - D..].iter_mut().zip(own).for_each(|(x, y)| *x += y);
    }
    link
}
