//! Simulated environments in which controllers fly: JSBSim, or a model in its place.

#[cfg(feature = "sitl")]
use greylag_sitl::plant::PlantError;

use greylag_control::Observation;
use greylag_model::{GreyBox, Twin};
use greylag_physics::atmosphere::STANDARD_GRAVITY;
use greylag_physics::{Command, State, Time};

/// Reason why an environment cannot continue.
#[derive(Debug, thiserror::Error)]
pub enum Trouble {
    /// The plant, which is the aircraft in JSBSim, reports an error.
    #[cfg(feature = "sitl")]
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// A state of the model is not finite.
    #[error("the simulated state of model {0} diverged; the model is not valid there")]
    Diverged(String),
    /// A copy of the simulator cannot be made.
    #[error("{0}")]
    Worker(String),
    /// The controller's command is not finite.
    #[error("the command is not a finite number; the controller has lost its state")]
    Command,
}

/// A simulated world with steps of 0.01 s.
pub trait Environment {
    /// Resets to the initial state of a flight and returns the first observation.
    ///
    /// # Errors
    ///
    /// If the plant cannot be set to this state.
    fn reset(&mut self) -> Result<Observation, Trouble>;
    /// Advances one step under `command`, which is clamped to its ranges. Returns the observation after the step.
    ///
    /// # Errors
    ///
    /// If the command or a state is not finite.
    fn step(&mut self, command: Command) -> Result<Observation, Trouble>;
    /// Load factor at the present state: the specific force along body z, upwards, divided by the standard gravity.
    fn load_factor(&self) -> f64;
    /// Sets the seed of the random numbers from the next reset on. A deterministic environment ignores it.
    fn reseed(&mut self, _seed: u32) {}
}

/// One aircraft simulated by a model and its exact actuator filters. The module `sim::imagined` simulates many aircraft at
/// once for training.
#[derive(Clone, Debug)]
pub struct Imagined {
    model: GreyBox,
    start: State,
    twin: Twin,
    previous: [Command; 2],
    steps: u64,
}

impl Imagined {
    /// An aircraft simulated by `model` that starts at its reference airspeed and altitude.
    pub fn new(model: GreyBox) -> Imagined {
        let start = model.airframe.start();
        Imagined::starting(model, start)
    }

    /// An aircraft simulated by `model` that starts at its cruise airspeed and reference altitude.
    pub fn cruising(model: GreyBox) -> Imagined {
        let airspeed = model.airframe.envelope.airspeed_cruise_mps;
        let start = State { airspeed, ..model.airframe.start() };
        Imagined::starting(model, start)
    }

    fn starting(model: GreyBox, start: State) -> Imagined {
        let twin = Twin::new(start, model.airframe.reference.altitude);
        Imagined { model, start, twin, previous: [Command::IDLE; 2], steps: 0 }
    }

    /// Replaces the model without changing the state.
    pub fn change(&mut self, model: GreyBox) {
        self.model = model;
    }

    fn observe(&self) -> Observation {
        Observation {
            time: Time::from_micros(self.steps * 10_000),
            state: self.twin.state,
            incidence_sd: [0.0; 2],
            actuators: self.twin.actuators.observed(&self.model.airframe.actuators),
            altitude: self.twin.altitude,
            previous: self.previous,
        }
    }
}

impl Environment for Imagined {
    fn reset(&mut self) -> Result<Observation, Trouble> {
        self.twin = Twin::new(self.start, self.model.airframe.reference.altitude);
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

    fn load_factor(&self) -> f64 {
        -self.twin.specific_force(&self.model)[2] / STANDARD_GRAVITY
    }
}
