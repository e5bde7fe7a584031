//! Rollouts of many candidates at once, in the widest vectors that the processor has.

use crate::control::lqi::Ahead;
use crate::control::policy::{ACTIONS, Agent, command, observe};
use crate::control::task::Task;
use crate::control::{Observation, Target};
use crate::model::{GreyBox, Memory, STEP};
use crate::num::dense::Units;
use crate::num::{Lanes, Real};
use crate::physics::actuators::Actuators;
use crate::physics::inputs::InputMemory;
use crate::physics::{ActuatorState, Airframe, Command, State};

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
    /// What the integrator remembers.
    pub memory: Memory,
    /// What the state's rate has beside the model's.
    pub disturbance: State,
    /// The base that flies on behind a plan, and its throttle all along.
    pub ahead: Option<&'a Ahead>,
}

/// Who chooses the actions of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Actions {
    /// The block holds them.
    Given,
    /// The policy does; the block holds what is added to its actions, and has the sums afterwards.
    Policy,
    /// The base does; likewise.
    Base,
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

/// One block of imagined aircraft on their way.
struct Flight<const FUSED: bool> {
    state: State<Lanes<WIDTH, FUSED>>,
    actuators: Actuators<Lanes<WIDTH, FUSED>>,
    previous: [Command<Lanes<WIDTH, FUSED>>; 2],
    memory: Memory<Lanes<WIDTH, FUSED>>,
    inputs: Option<InputMemory<Lanes<WIDTH, FUSED>>>,
    target: Target<Lanes<WIDTH, FUSED>>,
    disturbance: State<Lanes<WIDTH, FUSED>>,
    sum: Lanes<WIDTH, FUSED>,
    weight: f64,
}

impl<const FUSED: bool> Flight<FUSED> {
    /// Effects on the deflections start at rest where the surfaces are: over the five steps a plan under
    /// a lag or a delay so believes in more of the present deflection than really acts.
    #[inline(always)]
    fn new(scene: &Scene) -> Self {
        let lane = Lanes::<WIDTH, FUSED>::from_f64;
        let Scene { model, seen, target, .. } = scene;
        let z = &seen.actuators;
        let observed = ActuatorState {
            aileron: lane(z.aileron),
            aileron_rate: lane(z.aileron_rate),
            elevator: lane(z.elevator),
            elevator_rate: lane(z.elevator_rate),
            throttle: lane(z.throttle),
        };
        let previous = seen.previous.map(|c| command_of(c, lane));
        let actuators = Actuators::from_observed(&observed, &previous, &model.airframe.actuators);
        let controls = actuators.controls();
        Flight {
            state: seen.state.map(lane),
            actuators,
            previous,
            memory: scene.memory.map(lane),
            // what acted before the tick is not observed
            inputs: (!model.acts_at_once()).then(|| InputMemory::at_rest(&controls)),
            target: target.map(lane),
            disturbance: scene.disturbance.map(lane),
            sum: Lanes::zero(),
            weight: 1.0,
        }
    }

    /// A step in the order of the simulator, and its reward.
    #[inline(always)]
    fn advance(&mut self, scene: &Scene, command: Command<Lanes<WIDTH, FUSED>>) {
        let Scene { model, task, seen, .. } = scene;
        let mut controls = self.actuators.controls();
        if let Some(inputs) = &mut self.inputs {
            controls = model.act(&controls, inputs);
        }
        self.state = model.step_inlined(&self.state, &controls, seen.altitude, &mut self.memory);
        self.state = self.state.advance(&self.disturbance, STEP);
        self.actuators.step(&command, &model.airframe.actuators);
        self.previous = [command, self.previous[0]];
        self.sum += task.reward(&self.state, &self.target).scale(self.weight);
        self.weight *= task.discount;
    }

    #[inline(always)]
    fn observed(&self, scene: &Scene) -> ActuatorState<Lanes<WIDTH, FUSED>> {
        self.actuators.observed(&scene.model.airframe.actuators)
    }
}

/// The worth of one block: a plan of five steps, and what follows it.
#[inline(always)]
fn rollout<const FUSED: bool>(
    scene: &Scene,
    actions: Actions,
    block: &mut Block,
    units: &mut Units<Lanes<WIDTH, FUSED>>,
) -> Worth {
    let mut flight = Flight::<FUSED>::new(scene);
    let mut reference = [Lanes::zero(); 2];
    if let Some(ahead) = scene.ahead {
        reference = [Lanes::from_f64(ahead.reference()[0]), Lanes::from_f64(ahead.reference()[1])];
    }
    let steps = match scene.ahead {
        Some(ahead) => ahead.steps(),
        None => HORIZON,
    };
    // plain loops, and one place where the model is: an iterator that is not inlined leaves the vector
    // instructions, a second copy of the model doubles what takes minutes to compile
    let mut step = 0;
    while step < steps {
        let mut chosen = [Lanes::zero(); ACTIONS];
        if step < HORIZON {
            let given = &block[step];
            chosen = [Lanes(given[0]), Lanes(given[1]), Lanes(given[2])];
        } else if step == HORIZON && actions != Actions::Base {
            reference = [flight.state.roll, flight.state.pitch];
        }
        if let (true, Actions::Policy, Some(agent)) = (step < HORIZON, actions, scene.agent) {
            let view = observe(&flight.state, &flight.observed(scene), &flight.target);
            let advised = agent.actor.act(units, &view);
            let mut i = 0;
            while i < ACTIONS {
                chosen[i] = (chosen[i] + advised[i]).clamp(-1.0, 1.0);
                i += 1;
            }
        }
        let mut command = command(chosen);
        if let Some(ahead) = scene.ahead {
            let z = flight.observed(scene);
            let base = ahead.command(step, &mut reference, &flight.state, &z, &flight.previous);
            if actions == Actions::Base || step >= HORIZON {
                command.aileron = (command.aileron + base.aileron).clamp(-1.0, 1.0);
                command.elevator = (command.elevator + base.elevator).clamp(-1.0, 1.0);
            }
            // the base flies the throttle: what is planned is attitude
            command.throttle = base.throttle;
            command = slewed(command, &flight.previous[0], &scene.model.airframe);
        }
        if step < HORIZON {
            let given = &mut block[step];
            given[0] = command.aileron.0;
            given[1] = command.elevator.0;
            given[2] = (command.throttle.scale(2.0) - Lanes::splat(1.0)).0;
        }
        flight.advance(scene, command);
        step += 1;
    }
    let mut doubt = Lanes::<WIDTH, FUSED>::zero();
    if let (Some(alpha), Some(agent)) = (scene.alpha, scene.agent) {
        let view = observe(&flight.state, &flight.observed(scene), &flight.target);
        let advised = agent.actor.act(units, &view);
        let first = agent.critics[0].value(units, &view, &advised);
        let second = agent.critics[1].value(units, &view, &advised);
        // a number that is lost stays lost
        let least = first + (second - first).min(Lanes::zero());
        flight.sum += least.scale(alpha * flight.weight);
        doubt = (first - second).abs().scale(alpha * flight.weight);
    }
    Worth { returns: flight.sum.0, doubt: doubt.0 }
}

/// `command` with its surfaces as far from the `last` one as the airframe's slew limit lets them go in a step: whoever
/// flies a plan keeps to it, and a plan that does not know it oscillates once the channels are late as well.
#[inline(always)]
pub(super) fn slewed<R: Real>(
    command: Command<R>,
    last: &Command<R>,
    airframe: &Airframe,
) -> Command<R> {
    let reach = R::from_f64(airframe.envelope.surface_slew_per_s * STEP);
    let within = |x: R, from: R| x.max(from - reach).min(from + reach);
    Command {
        aileron: within(command.aileron, last.aileron),
        elevator: within(command.elevator, last.elevator),
        ..command
    }
}

/// A command with every component read as another kind of number.
#[inline(always)]
fn command_of<R>(c: Command, number: impl Fn(f64) -> R) -> Command<R> {
    Command {
        aileron: number(c.aileron),
        elevator: number(c.elevator),
        throttle: number(c.throttle),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::disturbance;
    use crate::physics::Time;
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
            memory: Memory::default(),
            disturbance: disturbance::NONE,
            ahead: None,
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
