//! A trained policy: a neural network that computes the command of each tick. The modules contain its inputs (observation),
//! its networks and its files. [`Policy`] is the controller that flies it.
//!
//! The policy is that of section IV-B of the paper \[GSFM26\] (see `src/lib.rs`). The training is in `learn` and is not needed
//! in flight.

mod file;
mod networks;
pub mod observation;

use std::sync::Arc;

pub use file::{AgentError, Evaluated, Origin};
pub use networks::{ACTIONS, Actor, Critic, ShapeError, command};
pub use observation::{OBSERVATIONS, observe};

use crate::{Controller, Observation, Target};
use greylag_num::dense::Units;
use greylag_physics::Command;

/// The networks of a policy and their provenance.
#[derive(Clone, Debug, PartialEq)]
pub struct Agent {
    /// The actor network π.
    pub actor: Arc<Actor>,
    /// The two critics Q1 and Q2: estimates of the sum of future rewards. `None` if the policy's folder has none. Controllers
    /// that use critics then cannot be built.
    pub critics: Option<Arc<[Critic; 2]>>,
    /// Provenance that is stored in the policy's files.
    pub origin: Origin,
}

/// The controller that commands the actor's action at every tick.
#[derive(Clone, Debug)]
pub struct Policy {
    actor: Arc<Actor>,
    units: Units<f32>,
}

impl Policy {
    /// A controller for the actor of `agent`.
    pub fn new(agent: &Agent) -> Policy {
        Policy::of(agent.actor.clone())
    }

    /// A controller for `actor`.
    pub fn of(actor: Arc<Actor>) -> Policy {
        Policy { actor, units: Units::new(0.0) }
    }
}

impl Controller for Policy {
    fn name(&self) -> &'static str {
        "policy"
    }

    fn boxed_clone(&self) -> Box<dyn Controller> {
        Box::new(self.clone())
    }

    fn reset(&mut self, _seed: u64) {}

    fn command(&mut self, seen: &Observation, target: &Target) -> Command {
        let observed = observe(&seen.state, &seen.actuators, target);
        let action = self.actor.act_one(&mut self.units, &observed.map(|x| x as f32));
        command(action.map(f64::from)).clamped()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use greylag_num::{Dense, stream};
    use greylag_physics::{ActuatorState, State, Time};

    #[test]
    fn commands_are_the_actors_and_a_lost_state_is_not_hidden() {
        let network =
            Dense::uniform(&[OBSERVATIONS, 300, 300, ACTIONS], &mut stream::stream(1, &[]));
        let actor = Arc::new(Actor::new(network.unwrap()).unwrap());
        let mut policy = Policy::of(actor.clone());
        let mut seen = Observation {
            time: Time::default(),
            state: State { roll: 0.3, alpha: 0.1, ..State::NEUTRAL },
            incidence_sd: [0.0; 2],
            actuators: ActuatorState { aileron: 0.2, throttle: 0.4, ..ActuatorState::default() },
            altitude: 600.0,
            previous: [Command::IDLE; 2],
        };
        let target = Target { roll: 0.5, pitch: -0.2, airspeed: 16.67 };
        let there = observe(&seen.state, &seen.actuators, &target);
        let expected: Command = command(actor.act(&mut Units::new(0.0), &there));
        let given = policy.command(&seen, &target);
        // the tolerance covers single-precision rounding in sums of 300 terms
        assert!((given.aileron - expected.aileron).abs() < 1e-5);
        assert!((given.elevator - expected.elevator).abs() < 1e-5);
        assert!((given.throttle - expected.throttle).abs() < 1e-5);
        seen.state.q = f64::NAN;
        assert!(!policy.command(&seen, &target).is_finite());
    }
}
