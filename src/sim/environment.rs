//! What a controller flies in: JSBSim, or a model imagined in its place.

use greylag_sitl::plant::{Inputs, Plant, PlantError, PlantOptions, Start, Truth};

use crate::control::Observation;
use crate::model::{GreyBox, Twin};
use crate::physics::{ActuatorState, Command, State, Time};

/// Altitude at which an episode starts, m.
pub const START_ALTITUDE: f64 = 600.0;

/// Why an environment cannot go on.
#[derive(Debug, thiserror::Error)]
pub enum Trouble {
    /// The plant says so.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// A model's state is no longer a number.
    #[error("the imagined aircraft of model {0} left the numbers; its model does not hold there")]
    Diverged(String),
    /// One of several equal simulators could not be made.
    #[error("{0}")]
    Worker(String),
    /// The controller's command is not finite.
    #[error("the command is not a finite number; the controller has lost its state")]
    Command,
}

/// A world that advances by 0.01 s a step.
pub trait Environment {
    /// Back to the neutral start.
    ///
    /// # Errors
    /// If the plant cannot be set there.
    fn reset(&mut self) -> Result<Observation, Trouble>;
    /// One step under `command`, limited to its ranges.
    ///
    /// # Errors
    /// If the aircraft has left the numbers.
    fn step(&mut self, command: Command) -> Result<Observation, Trouble>;
}

/// JSBSim.
pub struct Simulator {
    plant: Plant,
    previous: [Command; 2],
}

impl Simulator {
    /// Loads an aircraft.
    ///
    /// # Errors
    /// If there is no such aircraft.
    pub fn new(options: &PlantOptions) -> Result<Simulator, Trouble> {
        Ok(Simulator { plant: Plant::new(options)?, previous: [Command::IDLE; 2] })
    }

    /// The seed of the turbulence from the next reset on.
    pub fn reseed(&mut self, seed: u32) {
        self.plant.reseed(seed);
    }

    /// The whole truth of the plant.
    pub fn truth(&self) -> Truth {
        self.plant.truth()
    }

    fn observe(&self, truth: &Truth) -> Observation {
        Observation {
            time: Time::from_micros((truth.time_s * 1e6).round() as u64),
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
            },
            altitude: truth.altitude_m,
            previous: self.previous,
        }
    }
}

impl Environment for Simulator {
    fn reset(&mut self) -> Result<Observation, Trouble> {
        self.previous = [Command::IDLE; 2];
        let truth = self.plant.reset(&Start::NEUTRAL)?;
        Ok(self.observe(&truth))
    }

    fn step(&mut self, command: Command) -> Result<Observation, Trouble> {
        let command = command.clamped();
        let Command { aileron, elevator, throttle } = command;
        let truth = self.plant.step(Inputs { aileron, elevator, throttle })?;
        self.previous = [command, self.previous[0]];
        Ok(self.observe(&truth))
    }
}

/// A model with the exact actuator filters as its state.
#[derive(Clone, Debug)]
pub struct Imagined {
    model: GreyBox,
    twin: Twin,
    previous: [Command; 2],
    steps: u64,
}

impl Imagined {
    /// An aircraft that flies as `model` says.
    pub fn new(model: GreyBox) -> Imagined {
        let twin = Twin::new(State::NEUTRAL, START_ALTITUDE);
        Imagined { model, twin, previous: [Command::IDLE; 2], steps: 0 }
    }

    fn observe(&self) -> Observation {
        Observation {
            time: Time::from_micros(self.steps * 10_000),
            state: self.twin.state,
            actuators: self.twin.actuators.observed(&self.model.airframe.actuators),
            altitude: self.twin.altitude,
            previous: self.previous,
        }
    }
}

impl Environment for Imagined {
    fn reset(&mut self) -> Result<Observation, Trouble> {
        self.twin = Twin::new(State::NEUTRAL, START_ALTITUDE);
        (self.previous, self.steps) = ([Command::IDLE; 2], 0);
        Ok(self.observe())
    }

    fn step(&mut self, command: Command) -> Result<Observation, Trouble> {
        if !command.is_finite() {
            return Err(Trouble::Command);
        }
        let command = command.clamped();
        self.twin.step(&self.model, &command);
        self.previous = [command, self.previous[0]];
        self.steps += 1;
        if self.twin.state.is_finite() {
            return Ok(self.observe());
        }
        Err(Trouble::Diverged(self.model.name.clone()))
    }
}
