//! Estimates the discretisation error of fitted coefficients by a second fit to every other sample.
//!
//! The standard deviations of a fit cover only noise. At a sampling interval of 20 or 40 ms, deflections and rates change between
//! two samples, but the fit replaces integrals by sums over samples. The resulting error is systematic: it is the same in every
//! flight.

use crate::diagnose::search::round::{Problem, Round};
use crate::diagnose::search::settling::SETTLING;
use greylag_logs::Sampling;

/// Standard deviation of the discretisation error, as a fraction of the difference between the fits to half of the samples and to
/// all samples. The error is one third of this difference if it is proportional to the square of the sampling interval.
const LEFT: f64 = 1.0 / 3.0;

/// Standard deviation due to discretisation of each coefficient of the re-estimated model of `round`, in the order and the units
/// of the coefficients.
///
/// It is zero if the fit to half of the samples fails. It is also zero if the log has the time steps of a simulator, for which
/// the sums are exact.
pub fn left_by_sums(problem: &Problem, round: &Round) -> Vec<f64> {
    let fine = round.tuned();
    let none = vec![0.0; fine.coefficients().len()];
    if problem.flights.iter().any(|f| f.sampling == Sampling::Held) {
        return none;
    }
    let halved = halved(problem);
    let mut coarse = fine.clone();
    for _ in 0..SETTLING {
        let Some(round) = Round::new(&halved, coarse, &[]) else { return none };
        coarse = round.tuned();
    }
    let pairs = fine.coefficients().iter().zip(coarse.coefficients());
    let left = pairs.map(|(fine, coarse)| LEFT * (coarse.value - fine.value).abs());
    left.map(|x| if x.is_finite() { x } else { 0.0 }).collect()
}

/// The problem with every other sample of its flights.
fn halved(problem: &Problem) -> Problem {
    Problem {
        flights: problem.flights.iter().map(|f| f.every_other()).collect(),
        prior: problem.prior.clone(),
        path: problem.path.iter().map(|path| path.map(|[sd, kept]| [sd, kept * kept])).collect(),
        sensors: problem.sensors.clone(),
        per_flight: problem.per_flight,
        seed: problem.seed,
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::diagnose::regression::{sensors, shared};
    use crate::flight_path::ActuatorClock;
    use crate::flight_path::reconstruction::{Instant, Reconstruction, Segment};
    use crate::per_flight::PerFlight;
    use crate::weak_form::prepared::Prepared;
    use greylag_model::{GreyBox, Integrator, Memory};
    use greylag_physics::{Controls, State};

    const STEP_S: f64 = 0.01;

    /// Simulates 40 s of flight of `model` with sinusoidal deflections, and records every `every`-th step without noise and
    /// without specific force.
    fn flown(model: &GreyBox, every: usize, sampling: Sampling) -> Reconstruction {
        let surfaces = |time: f64| Controls {
            aileron: 0.03 * (5.0 * time).sin() + 0.05 * (23.0 * time).sin(),
            elevator: 0.02 * (4.1 * time).sin() + 0.01 * (7.3 * time).cos(),
            throttle: 0.2,
            ..Controls::default()
        };
        let (mut state, mut memory) = (State::NEUTRAL, Memory::default());
        let mut instants = Vec::new();
        for k in 0..4000 {
            let time_s = STEP_S * k as f64;
            if k % every == 0 {
                instants.push(Instant {
                    time_s,
                    state,
                    controls: surfaces(time_s),
                    altitude: 600.0,
                    density: 1.15,
                    yaw: f64::NAN,
                    command: None,
                    specific_force: [f64::NAN; 3],
                });
            }
            state = model.step(&state, &surfaces(time_s + 0.5 * STEP_S), 600.0, &mut memory);
        }
        Reconstruction {
            name: "f".into(),
            step_s: STEP_S * every as f64,
            sampling,
            clock: ActuatorClock::AsRecorded,
            segments: vec![Segment { instants }],
            nuisances: Vec::new(),
            installation: Vec::new(),
            noise: [0.0; 8],
            left: [0.0; 8],
            force_noise: [f64::NAN; 3],
            gust_step: 0.0,
            rudder: None,
            notes: Vec::new(),
        }
    }

    /// Fits the roll damping Clp to a flight. Returns its error, its standard deviation due to noise, and the estimated standard
    /// deviation due to discretisation.
    fn roll_damping(every: usize, sampling: Sampling) -> [f64; 3] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/x8/jsbsim.toml");
        let mut model = GreyBox::load(&path).unwrap();
        model.integrator = Integrator::Rk4;
        let flight = flown(&model, every, sampling);
        let prepared = Prepared::new(&flight, 5.0).unwrap();
        let problem = Problem {
            prior: model.coefficients().iter().map(|c| (c.value, c.width())).collect(),
            path: vec![shared::path_error(&flight, prepared.dt)],
            sensors: vec![sensors::widths(&flight, prepared.dt)],
            per_flight: PerFlight::default(),
            seed: 1,
            flights: vec![prepared],
        };
        let place = model.coefficients().iter().position(|c| c.name == "roll_linear.Clp").unwrap();
        let truth = model.coefficients()[place].value;
        let mut round = Round::new(&problem, model, &[]).unwrap();
        for _ in 0..SETTLING {
            round = Round::new(&problem, round.tuned(), &[]).unwrap();
        }
        // a parameter of a flight has the flight's name and not its number, which changes if an earlier flight is left out
        assert!(round.known.iter().any(|known| known.name == "gyro_bias_p of flight f"));
        let k = round.coefficients.iter().position(|of| *of == place).unwrap();
        let noise = round.projected.covariance[(k, k)].sqrt();
        let sums = left_by_sums(&problem, &round)[place];
        [round.tuned().coefficients()[place].value - truth, noise, sums]
    }

    #[test]
    fn what_sums_over_samples_leave_is_of_the_size_that_is_stated() {
        let [error, noise, sums] = roll_damping(4, Sampling::Instants);
        println!("25 Hz: Clp off by {error:.4}, noise {noise:.4}, sums {sums:.4}");
        assert!(error.abs() > 2.0 * noise, "nothing to show: {error} {noise}");
        assert!(error.abs() < 2.0 * noise.hypot(sums), "{error} {noise} {sums}");
        let [_, _, less] = roll_damping(1, Sampling::Instants);
        println!("100 Hz: sums {less:.4}");
        assert!(less < 0.3 * sums, "{less} {sums}");
    }

    #[test]
    fn the_steps_of_a_simulator_have_exact_sums() {
        assert_eq!(roll_damping(1, Sampling::Held)[2], 0.0);
    }
}
