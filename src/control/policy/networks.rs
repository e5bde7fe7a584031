//! The networks of a policy: the actor π and its critics Q.

use crate::policy::OBSERVATIONS;
use greylag_num::dense::Units;
use greylag_num::{Dense, Lanes, Real};
use greylag_physics::Command;

/// Number of components of an action: aileron, elevator and throttle, each −1..1 (eq. 29 of \[GSFM26\], see `src/lib.rs`).
pub const ACTIONS: usize = 3;

/// Number of aircraft in a block, one per vector lane.
const WIDTH: usize = 16;

/// Error for a network whose numbers of inputs and outputs do not fit an actor or a critic.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{what} takes a network of {inputs} inputs and {outputs} outputs, not {found:?}{why}")]
pub struct ShapeError {
    what: &'static str,
    inputs: usize,
    outputs: usize,
    found: Vec<usize>,
    why: &'static str,
}

/// The actor network π, which maps an observation to an action.
#[derive(Clone, Debug, PartialEq)]
pub struct Actor {
    network: Dense,
}

/// A critic network Q, which maps an observation and an action to the expected return.
#[derive(Clone, Debug, PartialEq)]
pub struct Critic {
    network: Dense,
}

/// Checks the numbers of inputs and outputs of a network.
fn check(
    what: &'static str,
    inputs: usize,
    outputs: usize,
    network: Dense,
) -> Result<Dense, ShapeError> {
    let found = network.sizes();
    if (found[0], found[found.len() - 1]) == (inputs, outputs) {
        return Ok(network);
    }
    let why = if found[0] + 1 == inputs {
        "; it was trained before policies observed the airspeed error"
    } else {
        ""
    };
    Err(ShapeError { what, inputs, outputs, found: found.into(), why })
}

/// The command of an action, with throttle = (a + 1)/2. The rudder is neutral, because a policy does not command it.
#[inline(always)]
pub fn command<R: Real>([aileron, elevator, thrust]: [R; ACTIONS]) -> Command<R> {
    let throttle = (thrust + R::from_f64(1.0)).scale(0.5);
    Command { aileron, elevator, throttle, rudder: R::zero() }
}

impl Actor {
    /// The actor with `network`, whose outputs pass through tanh.
    ///
    /// # Errors
    ///
    /// If the network does not have `OBSERVATIONS` inputs and `ACTIONS` outputs.
    pub fn new(network: Dense) -> Result<Actor, ShapeError> {
        check("an actor", OBSERVATIONS, ACTIONS, network).map(|network| Actor { network })
    }

    /// The network without the final tanh.
    pub fn network(&self) -> &Dense {
        &self.network
    }

    /// The network for training. The caller must keep its weights finite.
    pub fn network_mut(&mut self) -> &mut Dense {
        &mut self.network
    }

    /// The action (−1..1) for the observation of one aircraft, or of several aircraft in the lanes of vectors.
    #[inline(always)]
    pub fn act<R: Real>(&self, units: &mut Units<R>, observed: &[R; OBSERVATIONS]) -> [R; ACTIONS] {
        let answer = self.network.evaluate_in(units, observed);
        [answer[0].tanh(), answer[1].tanh(), answer[2].tanh()]
    }

    /// The action (−1..1) for a single observation, computed with the processor's widest vector instructions. Operations are
    /// neither fused nor reordered. The results of all instruction sets are therefore bit-identical.
    pub fn act_one(
        &self,
        units: &mut Units<f32>,
        observed: &[f32; OBSERVATIONS],
    ) -> [f32; ACTIONS] {
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512vl") {
                // SAFETY: the processor has the features
                return unsafe { self.act_avx512(units, observed) };
            }
            if is_x86_feature_detected!("avx2") {
                // SAFETY: the processor has the feature
                return unsafe { self.act_avx2(units, observed) };
            }
        }
        self.act_baseline(units, observed)
    }

    /// The actions (−1..1) of a block of aircraft. The vectors have 256 bits even if the processor supports 512, because the
    /// compiler does not vectorise this kernel with 512 bits (measured for two layers of 300: 1180 µs instead of 40 µs).
    pub fn act_block(
        &self,
        units: &mut Units<Lanes<WIDTH>>,
        observed: &[Lanes<WIDTH>; OBSERVATIONS],
    ) -> [Lanes<WIDTH>; ACTIONS] {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has the feature
            return unsafe { self.block_avx2(units, observed) };
        }
        self.act(units, observed)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn block_avx2(
        &self,
        units: &mut Units<Lanes<WIDTH>>,
        observed: &[Lanes<WIDTH>; OBSERVATIONS],
    ) -> [Lanes<WIDTH>; ACTIONS] {
        self.act(units, observed)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx512f,avx512vl")]
    fn act_avx512(&self, units: &mut Units<f32>, observed: &[f32]) -> [f32; ACTIONS] {
        self.act_baseline(units, observed)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn act_avx2(&self, units: &mut Units<f32>, observed: &[f32]) -> [f32; ACTIONS] {
        self.act_baseline(units, observed)
    }

    #[inline(always)]
    fn act_baseline(&self, units: &mut Units<f32>, observed: &[f32]) -> [f32; ACTIONS] {
        let answer = self.network.evaluate_one(units, observed);
        [answer[0].tanh(), answer[1].tanh(), answer[2].tanh()]
    }
}

impl Critic {
    /// The critic with `network`.
    ///
    /// # Errors
    ///
    /// If the network does not have `OBSERVATIONS` + `ACTIONS` inputs and one output.
    pub fn new(network: Dense) -> Result<Critic, ShapeError> {
        check("a critic", OBSERVATIONS + ACTIONS, 1, network).map(|network| Critic { network })
    }

    /// The underlying network.
    pub fn network(&self) -> &Dense {
        &self.network
    }

    /// The expected discounted return after `action`, in units of the reward of eq. (30).
    #[inline(always)]
    pub fn value<R: Real>(
        &self,
        units: &mut Units<R>,
        observed: &[R; OBSERVATIONS],
        action: &[R; ACTIONS],
    ) -> R {
        let mut input = [R::zero(); OBSERVATIONS + ACTIONS];
        input[..OBSERVATIONS].copy_from_slice(observed);
        input[OBSERVATIONS..].copy_from_slice(action);
        self.network.evaluate_in(units, &input)[0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use greylag_num::stream;

    #[test]
    fn every_instruction_set_gives_the_same_action_to_the_bit() {
        let sizes = [OBSERVATIONS, 300, 300, ACTIONS];
        let actor =
            Actor::new(Dense::uniform(&sizes, &mut stream::stream(2, &[])).unwrap()).unwrap();
        let observed = std::array::from_fn(|i| (i as f32 * 0.7).sin());
        let mut units = Units::new(0.0);
        let widest = actor.act_one(&mut units, &observed);
        assert_eq!(widest, actor.act_baseline(&mut units, &observed));
        assert!(widest.iter().all(|a| a.abs() < 1.0 && *a != 0.0));
    }

    #[test]
    fn networks_of_another_shape_are_refused() {
        let network = || Dense::uniform(&[15, 8, 2], &mut stream::stream(2, &[])).unwrap();
        let said = Actor::new(network()).unwrap_err().to_string();
        assert!(said.contains("16 inputs and 3 outputs, not [15, 8, 2]"), "{said}");
        assert!(said.contains("before policies observed the airspeed error"), "{said}");
        let other = Dense::uniform(&[12, 8, 3], &mut stream::stream(2, &[])).unwrap();
        let said = Actor::new(other).unwrap_err().to_string();
        assert!(!said.contains("before"), "{said}");
        assert!(Critic::new(network()).is_err());
    }
}
