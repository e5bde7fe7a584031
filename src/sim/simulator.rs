//! JSBSim as an [`Environment`]: controllers fly episodes in it.

use greylag_sitl::plant::{Inputs, Plant, PlantOptions, Start, Truth};

use crate::{Environment, Trouble};
use greylag_control::Observation;
use greylag_physics::atmosphere::STANDARD_GRAVITY;
use greylag_physics::{ActuatorState, Command, State, Time};

/// One aircraft in JSBSim with its initial state.
pub struct Simulator {
    plant: Plant,
    start: Start,
    previous: [Command; 2],
}

impl Simulator {
    /// Loads an aircraft into JSBSim.
    ///
    /// # Errors
    ///
    /// If the aircraft cannot be loaded.
    pub fn new(options: &PlantOptions) -> Result<Simulator, Trouble> {
        let plant = Plant::new(options)?;
        Ok(Simulator { plant, start: options.start, previous: [Command::IDLE; 2] })
    }

    /// Initial state of the episodes.
    pub fn start(&self) -> Start {
        self.start
    }

    /// The true state of the plant.
    pub fn truth(&self) -> Truth {
        self.plant.truth()
    }

    fn observe(&self, truth: &Truth) -> Observation {
        Observation {
            time: Time::from_micros((truth.time_s * 1e6).round() as u64),
            incidence_sd: [0.0; 2],
            state: State {
                roll: truth.roll_rad,
                pitch: truth.pitch_rad,
                airspeed: truth.airspeed_mps,
                p: truth.p_radps,
                q: truth.q_radps,
                r: truth.r_radps,
                alpha: truth.alpha_rad,
                beta: truth.beta_rad,
            },
            actuators: ActuatorState {
                aileron: truth.aileron_rad,
                aileron_rate: truth.aileron_rate_radps,
                elevator: truth.elevator_rad,
                elevator_rate: truth.elevator_rate_radps,
                throttle: truth.throttle,
                rudder: truth.rudder_rad,
                rudder_rate: truth.rudder_rate_radps,
            },
            altitude: truth.altitude_m,
            previous: self.previous,
        }
    }
}

impl Environment for Simulator {
    fn reset(&mut self) -> Result<Observation, Trouble> {
        self.previous = [Command::IDLE; 2];
        let truth = self.plant.reset(&self.start)?;
        Ok(self.observe(&truth))
    }

    fn step(&mut self, command: Command) -> Result<Observation, Trouble> {
        let command = command.clamped();
        let Command { aileron, elevator, throttle, rudder } = command;
        let truth = self.plant.step(Inputs { aileron, elevator, throttle, rudder })?;
        self.previous = [command, self.previous[0]];
        Ok(self.observe(&truth))
    }

    fn load_factor(&self) -> f64 {
        -self.truth().specific_force_mps2[2] / STANDARD_GRAVITY
    }

    fn reseed(&mut self, seed: u32) {
        self.plant.reseed(seed);
    }
}
