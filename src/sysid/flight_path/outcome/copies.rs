//! Random copies of a reconstructed flight with the errors that the noise of the sensors causes.

use super::state;
use crate::flight_path::ReconstructError;
use crate::flight_path::actuator_skew::{self, ByAxis, Moving};
use crate::flight_path::channel::wrap;
use crate::flight_path::equations::{Found, Problem, no_path};
use crate::flight_path::path::{Path, flow_angles};
use crate::flight_path::rotation::to_euler;
use greylag_num::stream::{Stream, stream};
use greylag_physics::State;

/// Number of random draws of the error of the path. With three draws, the RMS errors over a flight are accurate to a few
/// percent.
const DRAWS: usize = 3;

/// A sample of a copy. It has only what is evaluated, because a copy of the whole flight would take much memory.
struct Erred {
    state: State,
    deflections: [f64; 2],
}

impl Moving for Erred {
    fn state(&self) -> &State {
        &self.state
    }

    fn deflections(&self) -> [f64; 2] {
        self.deflections
    }
}

/// Simulates the error of the path in random copies of the flight. Returns the root mean square error of each state, and the
/// actuator delays that are estimated from each copy. The returned errors of the body rates are the noise levels of the gyros.
///
/// # Errors
/// [`ReconstructError::NoPath`] if the equations of the simulated path errors are singular.
pub(super) fn draws(
    problem: &Problem,
    found: &Found,
) -> Result<([f64; 8], Vec<ByAxis>), ReconstructError> {
    let singular = || no_path(&problem.options.name, "the equations became singular");
    let mut random = stream(0, &[]);
    let (mut squares, mut count, mut delays) = ([0.0; 8], 0.0_f64, Vec::new());
    for _ in 0..DRAWS {
        // only one copy is in memory at a time
        let copy = copy(problem, found, &mut random).ok_or_else(singular)?;
        let pairs = found.paths.iter().zip(&copy);
        let samples = pairs.flat_map(|(own, copy)| {
            copy.iter().enumerate().map(move |(k, at)| (drawn(own, k), at.state.to_array()))
        });
        for (a, b) in samples {
            for (a, i) in a.iter().zip(DRAWN) {
                let error = if i == 0 { wrap(b[i] - a) } else { b[i] - a };
                squares[i] += error * error;
            }
            count += 1.0;
        }
        let copy: Vec<&[Erred]> = copy.iter().map(Vec::as_slice).collect();
        delays.push(actuator_skew::by_axis(&copy, problem.log.step, problem.sampling));
    }
    let mut left = squares.map(|sum| (sum / count).sqrt());
    left[3..6].copy_from_slice(&found.levels.gyro);
    Ok((left, delays))
}

/// A random copy of the flight, for each track. `None` if the equations are singular.
fn copy(problem: &Problem, found: &Found, random: &mut Stream) -> Option<Vec<Vec<Erred>>> {
    let (erring, step) = (problem.erring(found, random)?, problem.log.step);
    let tracks = problem.log.tracks.iter().zip(erring.paths.iter().zip(&erring.gyro));
    let samples = tracks.map(|(track, (path, gyro))| {
        let sample = |(k, noise): (usize, &[f64; 3])| {
            let [aileron, elevator, ..] = track.controls[k];
            let (state, _) = state(track, path, &found.values, step, (k, *noise));
            Erred { state, deflections: [aileron, elevator] }
        };
        gyro.iter().enumerate().map(sample).collect::<Vec<Erred>>()
    });
    Some(samples.collect())
}

/// Indices of the states that have a drawn error: roll, pitch, airspeed, α, β.
const DRAWN: [usize; 5] = [0, 1, 2, 6, 7];

/// These states of `path` at sample `k`.
fn drawn(path: &Path, k: usize) -> [f64; DRAWN.len()] {
    let [roll, pitch, _] = to_euler(&path.attitude[k]);
    let air = path.air_velocity(k);
    let [alpha, beta] = flow_angles(&air);
    [roll, pitch, air.norm(), alpha, beta]
}
