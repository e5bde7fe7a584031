//! Rollouts of many candidates at once, in the widest vectors that the processor has.

use crate::control::policy::{Agent, OBSERVATIONS, command, observe};
use crate::control::task::Task;
use crate::control::{Observation, Target};
use crate::model::{GreyBox, Memory};
use crate::num::dense::Units;
use crate::num::{Lanes, Real};
use crate::physics::actuators::Actuators;
use crate::physics::inputs::InputMemory;
use crate::physics::{ActuatorState, State};

/// Candidates that move together.
pub(super) const WIDTH: usize = 16;

/// Steps planned ahead, H of \[GSFM26\].
pub(super) const HORIZON: usize = 5;

/// The actions (aileron, elevator, throttle of eq. 29) of `WIDTH` candidates over the horizon.
pub(super) type Block = [[[f32; WIDTH]; 3]; HORIZON];

/// What all candidates of a tick share.
#[derive(Clone, Copy)]
pub(super) struct Scene<'a> {
    pub model: &'a GreyBox,
    pub task: &'a Task,
    pub seen: &'a Observation,
    pub target: &'a Target,
    /// The policy that proposes and whose critics value the end.
    pub agent: Option<&'a Agent>,
    /// Weight α of what the critics say of the end, eq. (26); `None` leaves them out.
    pub alpha: Option<f64>,
}

/// Who chooses the actions of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Actions {
    /// The block holds them.
    Given,
    /// The policy does; the block holds what is added to its actions, and has the sums afterwards.
    Policy,
}

/// What the candidates of a block are worth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Worth {
    /// Discounted returns, eq. (13), or eq. (26) with critics.
    pub returns: [f32; WIDTH],
    /// How far the critics' values of the end lie apart, discounted and weighted as these are.
    pub doubt: [f32; WIDTH],
}

impl Worth {
    pub const NONE: Worth = Worth { returns: [0.0; WIDTH], doubt: [0.0; WIDTH] };
}

/// The vector instructions a rollout is compiled for, with memory for its networks.
///
/// Where a multiply-add is fused it is used: the last bits differ from those of a processor that has
/// none. There is no copy for AVX-512: given scatters, the compiler vectorises across blocks and not
/// along lanes, at a fiftieth of the speed (a hybrid tick took 380 ms), and Zen 4 makes two halves of
/// each instruction anyway.
#[derive(Clone, Debug)]
pub(super) enum Machine {
    #[cfg(target_arch = "x86_64")]
    Avx2(Units<Lanes<WIDTH, true>>),
    Baseline(Units<Lanes<WIDTH, BASELINE_FUSED>>),
}

/// Whether a multiply-add is fused in what the target always has.
const BASELINE_FUSED: bool = cfg!(target_arch = "aarch64");

impl Machine {
    /// The widest that this processor has.
    pub fn detect() -> Machine {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            return Machine::Avx2(Units::new(Lanes::zero()));
        }
        Machine::baseline()
    }

    /// What the target always has.
    pub fn baseline() -> Machine {
        Machine::Baseline(Units::new(Lanes::zero()))
    }

    /// Flies every block, and says what its candidates are worth.
    pub fn fly(
        &mut self,
        scene: &Scene,
        actions: Actions,
        blocks: &mut [Block],
        out: &mut [Worth],
    ) {
        match self {
            // SAFETY: `detect` has seen the processor's features
            #[cfg(target_arch = "x86_64")]
            Machine::Avx2(units) => unsafe { fly_avx2(scene, actions, blocks, out, units) },
            Machine::Baseline(units) => fly(scene, actions, blocks, out, units),
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn fly_avx2(
    scene: &Scene,
    actions: Actions,
    blocks: &mut [Block],
    out: &mut [Worth],
    units: &mut Units<Lanes<WIDTH, true>>,
) {
    fly(scene, actions, blocks, out, units);
}

#[inline(always)]
fn fly<const FUSED: bool>(
    scene: &Scene,
    actions: Actions,
    blocks: &mut [Block],
    out: &mut [Worth],
    units: &mut Units<Lanes<WIDTH, FUSED>>,
) {
    for (block, out) in blocks.iter_mut().zip(out) {
        *out = rollout(scene, actions, block, units);
    }
}

/// The worth of one block: actuators, model and reward in the order of the simulator.
///
/// The integrator's memory starts empty: the first step of [`Integrator::Jsbsim`] is then Euler's.
/// Effects on the deflections start at rest where the surfaces are: over the five steps a plan under
/// a lag or a delay so believes in more of the present deflection than really acts.
///
/// [`Integrator::Jsbsim`]: crate::model::Integrator::Jsbsim
#[inline(always)]
#[expect(clippy::needless_range_loop, reason = "the last pass of the loop has no actions")]
fn rollout<const FUSED: bool>(
    scene: &Scene,
    actions: Actions,
    block: &mut Block,
    units: &mut Units<Lanes<WIDTH, FUSED>>,
) -> Worth {
    let Scene { model, task, seen, target, .. } = scene;
    let figures = &model.airframe.actuators;
    let lane = Lanes::<WIDTH, FUSED>::from_f64;
    let mut state: State<Lanes<WIDTH, FUSED>> = seen.state.map(lane);
    let z = &seen.actuators;
    let observed = ActuatorState {
        aileron: lane(z.aileron),
        aileron_rate: lane(z.aileron_rate),
        elevator: lane(z.elevator),
        elevator_rate: lane(z.elevator_rate),
        throttle: lane(z.throttle),
    };
    let previous = seen.previous.map(|c| command_of(c, lane));
    let target = target.map(lane);
    let mut actuators = Actuators::from_observed(&observed, &previous, figures);
    let mut memory = Memory::default();
    // what acted before the tick is not observed: the surfaces are taken to have been where they are
    let mut inputs = (!model.acts_at_once()).then(|| InputMemory::at_rest(&actuators.controls()));
    let mut sum = Lanes::zero();
    let mut weight = 1.0;
    let [mut worth, mut doubt] = [Lanes::<WIDTH, FUSED>::zero(); 2];
    for step in 0..=HORIZON {
        let asked = match step {
            HORIZON => scene.alpha.is_some(),
            _ => actions == Actions::Policy,
        };
        let mut advised = [Lanes::zero(); 3];
        let mut view = [Lanes::zero(); OBSERVATIONS];
        if let (true, Some(agent)) = (asked, scene.agent) {
            view = observe(&state, &actuators.observed(figures), &target);
            advised = agent.actor.act(units, &view);
        }
        if step == HORIZON {
            worth = sum;
            if let (Some(alpha), Some(agent)) = (scene.alpha, scene.agent) {
                let first = agent.critics[0].value(units, &view, &advised);
                let second = agent.critics[1].value(units, &view, &advised);
                // a number that is lost stays lost
                let least = first + (second - first).min(Lanes::zero());
                worth += least.scale(alpha * weight);
                doubt = (first - second).abs().scale(alpha * weight);
            }
            break;
        }
        let mut chosen = [Lanes::zero(); 3];
        // plain loops: an iterator that is not inlined leaves the vector instructions
        let given = &mut block[step];
        for i in 0..3 {
            chosen[i] = Lanes(given[i]);
            if actions == Actions::Policy {
                chosen[i] = (chosen[i] + advised[i]).clamp(-1.0, 1.0);
                given[i] = chosen[i].0;
            }
        }
        let mut controls = actuators.controls();
        if let Some(inputs) = &mut inputs {
            controls = model.act(&controls, inputs);
        }
        state = model.step_inlined(&state, &controls, seen.altitude, &mut memory);
        actuators.step(&command(chosen), figures);
        sum += task.reward(&state, &target).scale(weight);
        weight *= task.discount;
    }
    Worth { returns: worth.0, doubt: doubt.0 }
}

/// A command with every component read as another kind of number.
#[inline(always)]
fn command_of<R>(
    c: crate::physics::Command,
    number: impl Fn(f64) -> R,
) -> crate::physics::Command<R> {
    crate::physics::Command {
        aileron: number(c.aileron),
        elevator: number(c.elevator),
        throttle: number(c.throttle),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physics::{Command, Time};
    use std::path::Path;

    /// The same candidates are worth the same in every instruction set.
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
        let scene = Scene {
            model: &model,
            task: &Task::PAPER,
            seen: &seen,
            target: &target,
            agent: None,
            alpha: None,
        };
        let wave = |k: usize| std::array::from_fn(|i| ((k * 16 + i) as f32 * 0.37).sin());
        let mut blocks: [Block; 1] =
            [std::array::from_fn(|h| std::array::from_fn(|c| wave(3 * h + c)))];
        let mut run = |mut machine: Machine| {
            let mut out = [Worth::NONE];
            machine.fly(&scene, Actions::Given, &mut blocks, &mut out);
            out[0].returns
        };
        let baseline = run(Machine::baseline());
        let widest = run(Machine::detect());
        for (a, b) in widest.iter().zip(baseline) {
            // single precision through five steps, rewards summing up to 5
            assert!((a - b).abs() < 1e-5, "{a} {b}");
        }
    }
}
