//! Data collection for model learning: exploratory episodes in JSBSim, section IV-A of \[GSFM26\] (see `src/lib.rs`).

use rand::seq::SliceRandom;
use rand::{Rng, RngExt as _};
use rand_distr::{Distribution, StandardNormal};

use crate::episode::STEPS;
use crate::{Environment, Simulator, Trouble};
use greylag_control::{Controller, Observation, Target};
use greylag_logs::{Flight, Sample};
use greylag_num::stream::{self, Stream};
use greylag_physics::{Command, State};

/// Number of bins in roll, and in pitch. Each pair of a roll bin and a pitch bin is used once before any pair is used again.
const BINS: usize = 5;
/// Largest |roll| and |pitch| of the targets, rad (Table II of \[GSFM26\]).
const ENVELOPE: [f64; 2] = [60.0 * DEGREE, 30.0 * DEGREE];
const DEGREE: f64 = std::f64::consts::PI / 180.0;
/// Number of 10 ms steps for which a random action is held. With a new random action at every step, the aircraft would never
/// leave the neighbourhood of trim.
const HELD: usize = 25;
/// Correlation of Ornstein–Uhlenbeck actions from one step to the next. It corresponds to a time constant of 0.33 s.
const MEMORY: f64 = 0.97;

/// Ids of the random streams.
const TARGETS: u64 = 10;
const ACTIONS: u64 = 11;
const CHOICES: u64 = 12;

/// Identifies an episode of a data collection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// Seed of the collection.
    pub seed: u64,
    /// Round, from 0. In round 0 no model has been learned yet.
    pub round: u32,
    /// Episode within the round, from 0.
    pub episode: u32,
}

impl Place {
    fn stream(&self, purpose: u64) -> Stream {
        stream::stream(self.seed, &[purpose, self.round.into(), self.episode.into()])
    }

    /// The target of the episode, with `airspeed` in m/s. The attitudes are stratified over 5 × 5 bins of roll and pitch.
    pub fn target(&self, airspeed: f64) -> Target {
        let cycle = u64::from(self.episode) / (BINS * BINS) as u64;
        let mut bins: Vec<usize> = (0..BINS * BINS).collect();
        bins.shuffle(&mut stream::stream(self.seed, &[TARGETS, self.round.into(), cycle]));
        let bin = bins[self.episode as usize % (BINS * BINS)];
        let mut rng = self.stream(TARGETS);
        let mut within = |k: usize, most: f64| {
            most * (2.0 * (k as f64 + rng.random_range(0.0..1.0)) / BINS as f64 - 1.0)
        };
        let roll = within(bin % BINS, ENVELOPE[0]);
        Target { roll, pitch: within(bin / BINS, ENVELOPE[1]), airspeed }
    }

    /// Probability of random actions in an interval of an episode with a controller: one half in rounds 0 and 1, and 0.5ⁿ in a
    /// later round n.
    pub fn random_part(&self) -> f64 {
        0.5_f64.powi(self.round.clamp(1, 100) as i32)
    }
}

/// Random actions. In even episodes each action is held for some time. In odd episodes the actions are Ornstein–Uhlenbeck
/// noise. Their amplitude is drawn for each episode.
struct Wander {
    held: bool,
    size: f64,
    throttle: f64,
    now: [f64; 3],
    rng: Stream,
}

impl Wander {
    fn new(place: &Place) -> Wander {
        let mut rng = place.stream(ACTIONS);
        let size = rng.random_range(0.1..0.8);
        let throttle = rng.random_range(0.1..0.7);
        Wander { held: place.episode.is_multiple_of(2), size, throttle, now: [0.0; 3], rng }
    }

    fn next(&mut self, step: usize) -> Command {
        let memory = if self.held { 0.0 } else { MEMORY };
        if !self.held || step.is_multiple_of(HELD) {
            for x in &mut self.now {
                let drive: f64 = StandardNormal.sample(&mut self.rng);
                *x = memory * *x + (1.0 - memory * memory).sqrt() * drive;
            }
        }
        let [aileron, elevator, throttle] = self.now.map(|x| self.size * x);
        Command { aileron, elevator, throttle: self.throttle + 0.5 * throttle, rudder: 0.0 }
            .clamped()
    }
}

/// Flies an episode of [`STEPS`] steps. In randomly chosen intervals of 0.25 s the actions are random; in the others `controller`
/// acts. Without a controller all actions are random. The episode ends early if a state is not finite.
///
/// # Errors
///
/// If the simulator cannot be reset.
pub fn explore(
    simulator: &mut Simulator,
    controller: Option<&mut dyn Controller>,
    place: &Place,
) -> Result<Flight, Trouble> {
    let target = place.target(simulator.start().airspeed_mps);
    simulator.reseed(place.stream(CHOICES).next_u32());
    let mut seen = simulator.reset()?;
    let mut controller = controller;
    if let Some(controller) = &mut controller {
        controller.reset(place.stream(CHOICES).next_u64());
    }
    let (mut wander, mut choices) = (Wander::new(place), place.stream(CHOICES));
    let mut random = true;
    let mut samples = Vec::with_capacity(STEPS + 1);
    for step in 0..STEPS {
        if step.is_multiple_of(HELD) {
            random = choices.random_bool(place.random_part());
        }
        let wandering = wander.next(step);
        let command = match &mut controller {
            Some(controller) if !random => {
                let command = controller.command(&seen, &target);
                if command.is_finite() { command } else { wandering }
            }
            _ => wandering,
        };
        samples.push(sample(&seen, Some(&command), &target));
        seen = match simulator.step(command) {
            Ok(seen) => seen,
            Err(_) => return Ok(Flight::from(samples)),
        };
    }
    samples.push(sample(&seen, None, &target));
    Ok(Flight::from(samples))
}

/// A log sample with the state, the actuator positions and the command of one instant. If `command` is `None`, the sample
/// has the previous command.
pub fn sample(seen: &Observation, command: Option<&Command>, target: &Target) -> Sample {
    let State { roll, pitch, airspeed, p, q, r, alpha, beta } = seen.state;
    let command = command.unwrap_or(&seen.previous[0]);
    Sample {
        time_s: seen.time.as_secs_f64(),
        attitude_rad: [roll, pitch, f64::NAN],
        rates_radps: [p, q, r],
        airspeed_mps: airspeed,
        alpha_rad: alpha,
        beta_rad: beta,
        altitude_m: seen.altitude,
        aileron_rad: seen.actuators.aileron,
        elevator_rad: seen.actuators.elevator,
        throttle: seen.actuators.throttle,
        aileron_cmd: command.aileron,
        elevator_cmd: command.elevator,
        throttle_cmd: command.throttle,
        roll_target_rad: target.roll,
        pitch_target_rad: target.pitch,
        rate_hold_s: greylag_model::STEP,
        ..Sample::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use greylag_sitl::plant::PlantOptions;

    #[test]
    fn every_bin_is_visited_before_any_is_again() {
        let place = |episode| Place { seed: 3, round: 1, episode };
        for cycle in 0..3 {
            let mut seen = [[false; BINS]; BINS];
            for k in 0..25 {
                let target = place(25 * cycle + k).target(16.0);
                let bin = |x: f64, most: f64| (((x / most + 1.0) / 2.0) * BINS as f64) as usize;
                let (i, j) = (bin(target.roll, ENVELOPE[0]), bin(target.pitch, ENVELOPE[1]));
                assert!(!std::mem::replace(&mut seen[i][j], true), "bin {i}, {j} again");
            }
        }
    }

    #[test]
    fn random_flights_reach_the_stall_and_high_bank_and_repeat_to_the_bit() {
        let mut simulator = Simulator::new(&PlantOptions::default()).unwrap();
        let mut fly = |episode| {
            explore(&mut simulator, None, &Place { seed: 1, round: 0, episode }).unwrap().samples
        };
        let flights: Vec<_> = (0..6).map(&mut fly).collect();
        let most = |get: &dyn Fn(&Sample) -> f64| {
            flights.iter().flatten().map(|s| get(s).abs()).fold(0.0, f64::max)
        };
        // The aircraft stalls at 12.3°, and the hard targets have up to 60° of bank.
        assert!(most(&|s| s.alpha_rad).to_degrees() > 13.0);
        assert!(most(&|s| s.attitude_rad[0]).to_degrees() > 60.0);
        let again = fly(2);
        assert_eq!(again.len(), STEPS + 1);
        let bits = |rows: &[Sample]| -> Vec<u64> {
            rows.iter().map(|s| s.airspeed_mps.to_bits() ^ s.rates_radps[0].to_bits()).collect()
        };
        assert_eq!(bits(&again), bits(&flights[2]));
    }
}
