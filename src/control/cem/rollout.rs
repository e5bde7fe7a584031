//! Rollouts of many candidates at once, in the widest vectors that the processor has.

use crate::control::task::Task;
use crate::control::{Observation, Target};
use crate::model::{GreyBox, Memory};
use crate::num::{Lanes, Real};
use crate::physics::actuators::Actuators;
use crate::physics::inputs::InputMemory;
use crate::physics::{ActuatorState, Command, State};

/// Candidates that move together.
pub(super) const WIDTH: usize = 16;

/// Steps planned ahead, H of \[GSFM26\].
pub(super) const HORIZON: usize = 5;

/// The actions (aileron, elevator, throttle of eq. 29) of `WIDTH` candidates over the horizon.
pub(super) type Block = [[Lanes<WIDTH>; 3]; HORIZON];

/// What all candidates of a tick share.
#[derive(Clone, Copy)]
pub(super) struct Scene<'a> {
    pub model: &'a GreyBox,
    pub task: &'a Task,
    pub seen: &'a Observation,
    pub target: &'a Target,
}

/// The vector instructions a rollout is compiled for. No operation is fused or reordered between
/// them, so all give the same numbers to the bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Instructions {
    #[cfg(target_arch = "x86_64")]
    Avx512,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    Baseline,
}

impl Instructions {
    /// The widest that this processor has.
    pub fn detect() -> Instructions {
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512vl") {
                return Instructions::Avx512;
            }
            if is_x86_feature_detected!("avx2") {
                return Instructions::Avx2;
            }
        }
        Instructions::Baseline
    }

    /// Discounted returns of every block's candidates, eq. (13).
    pub fn returns(self, scene: &Scene, blocks: &[Block], out: &mut [Lanes<WIDTH>]) {
        match self {
            // SAFETY: `detect` has seen the processor's features
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512 => unsafe { returns_avx512(scene, blocks, out) },
            // SAFETY: as above
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2 => unsafe { returns_avx2(scene, blocks, out) },
            Instructions::Baseline => returns(scene, blocks, out),
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl")]
fn returns_avx512(scene: &Scene, blocks: &[Block], out: &mut [Lanes<WIDTH>]) {
    returns(scene, blocks, out);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn returns_avx2(scene: &Scene, blocks: &[Block], out: &mut [Lanes<WIDTH>]) {
    returns(scene, blocks, out);
}

#[inline(always)]
fn returns(scene: &Scene, blocks: &[Block], out: &mut [Lanes<WIDTH>]) {
    for (block, out) in blocks.iter().zip(out) {
        *out = rollout(scene, block);
    }
}

/// The return of one block: actuators, model and reward in the order of the simulator.
///
/// The integrator's memory starts empty: the first step of [`Integrator::Jsbsim`] is then Euler's.
/// Effects on the deflections start at rest where the surfaces are: over the five steps a plan under
/// a lag or a delay so believes in more of the present deflection than really acts.
///
/// [`Integrator::Jsbsim`]: crate::model::Integrator::Jsbsim
#[inline(always)]
fn rollout(scene: &Scene, block: &Block) -> Lanes<WIDTH> {
    let Scene { model, task, seen, target } = scene;
    let figures = &model.airframe.actuators;
    let lane = Lanes::<WIDTH>::from_f64;
    let mut state: State<Lanes<WIDTH>> = seen.state.map(lane);
    let target = target.map(lane);
    let z = &seen.actuators;
    let observed = ActuatorState {
        aileron: lane(z.aileron),
        aileron_rate: lane(z.aileron_rate),
        elevator: lane(z.elevator),
        elevator_rate: lane(z.elevator_rate),
        throttle: lane(z.throttle),
    };
    let previous = seen.previous.map(|c| Command {
        aileron: lane(c.aileron),
        elevator: lane(c.elevator),
        throttle: lane(c.throttle),
    });
    let mut actuators = Actuators::from_observed(&observed, &previous, figures);
    let mut memory = Memory::default();
    // what acted before the tick is not observed: the surfaces are taken to have been where they are
    let mut inputs = (!model.acts_at_once()).then(|| InputMemory::at_rest(&actuators.controls()));
    let mut sum = Lanes::zero();
    let mut weight = 1.0;
    for [aileron, elevator, thrust] in block {
        let mut controls = actuators.controls();
        if let Some(inputs) = &mut inputs {
            controls = model.act(&controls, inputs);
        }
        state = model.step_inlined(&state, &controls, seen.altitude, &mut memory);
        let throttle = (*thrust + lane(1.0)).scale(0.5);
        actuators.step(&Command { aileron: *aileron, elevator: *elevator, throttle }, figures);
        sum += task.reward(&state, &target).scale(weight);
        weight *= task.discount;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physics::Time;
    use std::path::Path;

    /// The same candidates in every instruction set give the same returns to the bit.
    #[test]
    fn instruction_sets_agree() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8/jsbsim.toml");
        let model = GreyBox::load(&path).unwrap();
        let seen = Observation {
            time: Time::default(),
            state: State::NEUTRAL,
            actuators: ActuatorState::default(),
            altitude: 600.0,
            previous: [Command::IDLE; 2],
        };
        let target = Target { roll: 0.7, pitch: 0.2, airspeed: 16.67 };
        let scene = Scene { model: &model, task: &Task::PAPER, seen: &seen, target: &target };
        let wave = |k: usize| Lanes(std::array::from_fn(|i| ((k * 16 + i) as f32 * 0.37).sin()));
        let blocks = [std::array::from_fn(|h| std::array::from_fn(|c| wave(3 * h + c)))];
        let run = |instructions: Instructions| {
            let mut out = [Lanes::zero()];
            instructions.returns(&scene, &blocks, &mut out);
            out[0].0.map(f32::to_bits)
        };
        let baseline = run(Instructions::Baseline);
        assert_eq!(run(Instructions::detect()), baseline);
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            assert_eq!(run(Instructions::Avx2), baseline);
        }
    }
}
