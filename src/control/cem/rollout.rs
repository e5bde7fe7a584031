//! Rollouts of many candidates at once, with the widest vector instructions of the processor.

use super::settings::Instructions;
use super::surrogate::Surrogate;
use crate::lqi::Ahead;
use crate::policy::{ACTIONS, Agent, OBSERVATIONS, command, observe};
use crate::task::Task;
use crate::{Observation, Target};
use greylag_model::{GreyBox, Memory, STEP};
use greylag_num::dense::Units;
#[cfg(target_arch = "x86_64")]
use greylag_num::{Avx2, Lanes, Pair};
use greylag_num::{BASE_FUSED, Base, Packed, ROW, Real};
use greylag_physics::actuators::Actuators;
use greylag_physics::inputs::InputMemory;
use greylag_physics::{ActuatorState, Airframe, Command, State};

/// Number of candidates in a block, one per lane.
pub(super) const WIDTH: usize = ROW;

/// Planning horizon H of \[GSFM26\], steps.
pub(super) const HORIZON: usize = 5;

/// The actions (aileron, elevator, throttle of eq. 29) of `WIDTH` candidates over the horizon.
pub(super) type Block = [[[f32; WIDTH]; 3]; HORIZON];

/// Inputs of a rollout that all candidates of a tick share.
#[derive(Clone, Copy)]
pub(super) struct Scene<'a> {
    pub model: &'a GreyBox,
    pub task: &'a Task,
    pub seen: &'a Observation,
    pub target: &'a Target,
    /// The policy that proposes actions. Its critics evaluate the terminal state.
    pub agent: Option<&'a Agent>,
    /// Weight α of the critics' terminal value, eq. (26). `None` omits the terminal value.
    pub alpha: Option<f64>,
    /// Terminal value function that replaces the critics.
    pub surrogate: Option<Surrogate>,
    /// Memory of the model's integrator: the last acceleration.
    pub memory: Memory,
    /// Constant disturbance added to the model's state rate, per second.
    pub disturbance: State,
    /// Law of the base controller. It flies the steps after the plan and commands throttle and rudder during the plan too.
    pub ahead: Option<&'a Ahead>,
    /// Number of steps of a rollout with a policy and no base controller. With neither, a rollout has five steps.
    pub steps: usize,
    /// Sideslip that lowers the reward by 1 per step, rad. `None` omits the sideslip term.
    pub sideslip: Option<f64>,
}

/// The source of a block's actions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Actions {
    /// The block holds the actions.
    Given,
    /// The policy. The rollout replaces the block's offsets from the policy's actions by the resulting actions.
    Policy,
    /// The base controller. The rollout replaces the block's offsets from its actions by the resulting actions.
    Base,
}

/// Result of the rollout of a block's candidates: returns and terminal values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Worth {
    /// Discounted returns, eq. (13), or eq. (26) with critics.
    pub returns: [f32; WIDTH],
    /// Disagreement of the two critics on the terminal value, with the same discount and weight as that value.
    pub doubt: [f32; WIDTH],
    /// Observation at the terminal state, if the critics or the surrogate evaluate this state.
    pub end: [[f32; WIDTH]; OBSERVATIONS],
    /// Value of the terminal state: the smaller of the two critics' values, or the surrogate's.
    pub value: [f32; WIDTH],
}

impl Worth {
    pub const NONE: Worth = Worth {
        returns: [0.0; WIDTH],
        doubt: [0.0; WIDTH],
        end: [[0.0; WIDTH]; OBSERVATIONS],
        value: [0.0; WIDTH],
    };
}

/// The vector instruction set that rollouts are compiled for, with scratch memory for the networks.
///
/// Fused multiply-add is used where the processor has it. The last bits therefore differ between instruction sets.
#[derive(Clone, Debug)]
pub(super) enum Machine {
    #[cfg(target_arch = "x86_64")]
    Avx512(Units<Wide>),
    #[cfg(target_arch = "x86_64")]
    Avx2(Units<Avx2<true>>),
    Baseline(Units<Base<BASE_FUSED>>),
}

/// Lanes of two blocks, which are evaluated together. Each network weight is then loaded once for both.
#[cfg(target_arch = "x86_64")]
type Wide = Lanes<32, true, Pair<std::arch::x86_64::__m512>>;

impl Machine {
    /// The requested instruction set, or the widest narrower one that this processor supports.
    pub fn new(wanted: Instructions) -> Machine {
        match wanted {
            #[cfg(target_arch = "x86_64")]
            Instructions::Widest if is_x86_feature_detected!("avx512f") => {
                // SAFETY: the processor has the feature
                Machine::Avx512(unsafe { room_avx512() })
            }
            #[cfg(target_arch = "x86_64")]
            Instructions::Widest | Instructions::Avx2
                if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") =>
            {
                // SAFETY: the processor has the features
                Machine::Avx2(unsafe { room_avx2() })
            }
            _ => Machine::Baseline(Units::new(Base::zero())),
        }
    }

    /// Rolls out every block and writes the returns.
    pub fn fly(
        &mut self,
        scene: &Scene,
        actions: Actions,
        blocks: &mut [Block],
        out: &mut [Worth],
    ) {
        match self {
            // SAFETY: `new` has checked the processor's features
            #[cfg(target_arch = "x86_64")]
            Machine::Avx512(units) => unsafe { fly_avx512(scene, actions, blocks, out, units) },
            // SAFETY: as above
            #[cfg(target_arch = "x86_64")]
            Machine::Avx2(units) => unsafe { fly_avx2(scene, actions, blocks, out, units) },
            Machine::Baseline(units) => fly(scene, actions, blocks, out, units),
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f")]
fn room_avx512() -> Units<Wide> {
    Units::new(Wide::zero())
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f")]
fn fly_avx512(
    scene: &Scene,
    actions: Actions,
    blocks: &mut [Block],
    out: &mut [Worth],
    units: &mut Units<Wide>,
) {
    fly(scene, actions, blocks, out, units);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn room_avx2() -> Units<Avx2<true>> {
    Units::new(Avx2::zero())
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn fly_avx2(
    scene: &Scene,
    actions: Actions,
    blocks: &mut [Block],
    out: &mut [Worth],
    units: &mut Units<Avx2<true>>,
) {
    fly(scene, actions, blocks, out, units);
}

#[inline(always)]
fn fly<R: Packed>(
    scene: &Scene,
    actions: Actions,
    blocks: &mut [Block],
    out: &mut [Worth],
    units: &mut Units<R>,
) {
    for (blocks, out) in blocks.chunks_mut(R::ROWS).zip(out.chunks_mut(R::ROWS)) {
        rollout(scene, actions, blocks, out, units);
    }
}

/// State of the simulated aircraft of a rollout.
struct Flight<R> {
    state: State<R>,
    actuators: Actuators<R>,
    previous: [Command<R>; 2],
    memory: Memory<R>,
    inputs: Option<InputMemory<R>>,
    target: Target<R>,
    disturbance: State<R>,
    sum: R,
    weight: f64,
}

impl<R: Packed> Flight<R> {
    /// Lags and delays of the deflections start in steady state at the present deflections. Over the five steps of a plan,
    /// the effect of the present deflections is therefore overestimated.
    #[inline(always)]
    fn new(scene: &Scene) -> Self {
        let lane = R::from_f64;
        let Scene { model, seen, target, .. } = scene;
        let z = &seen.actuators;
        let observed = ActuatorState {
            aileron: lane(z.aileron),
            aileron_rate: lane(z.aileron_rate),
            elevator: lane(z.elevator),
            elevator_rate: lane(z.elevator_rate),
            throttle: lane(z.throttle),
            rudder: lane(z.rudder),
            rudder_rate: lane(z.rudder_rate),
        };
        let previous = seen.previous.map(|c| command_of(c, lane));
        let actuators = Actuators::from_observed(&observed, &previous, &model.airframe.actuators);
        let controls = actuators.controls();
        Flight {
            state: seen.state.map(lane),
            actuators,
            previous,
            memory: scene.memory.map(lane),
            inputs: (!model.acts_at_once()).then(|| model.at_rest(&controls)),
            target: target.map(lane),
            disturbance: scene.disturbance.map(lane),
            sum: R::zero(),
            weight: 1.0,
        }
    }

    /// Advances by one step in the simulator's order and adds the discounted reward to the return.
    #[inline(always)]
    fn advance(&mut self, scene: &Scene, command: Command<R>) {
        let Scene { model, task, seen, .. } = scene;
        let mut controls = self.actuators.controls();
        if let Some(inputs) = &mut self.inputs {
            controls = model.act(&controls, inputs);
        }
        self.state = model.step_inlined(&self.state, &controls, seen.altitude, &mut self.memory);
        self.state = self.state.advance(&self.disturbance, STEP);
        self.actuators.step(&command, &model.airframe.actuators);
        self.previous = [command, self.previous[0]];
        let mut reward = task.reward(&self.state, &self.target);
        if let Some(scale) = scene.sideslip {
            reward -= self.state.beta.abs().scale(1.0 / scale);
        }
        self.sum += reward.scale(self.weight);
        self.weight *= task.discount;
    }

    #[inline(always)]
    fn observed(&self, scene: &Scene) -> ActuatorState<R> {
        self.actuators.observed(&scene.model.airframe.actuators)
    }
}

/// One component of the actions of all blocks at a step. The last block is repeated to fill the vector.
#[inline(always)]
fn given<R: Packed>(blocks: &[Block], step: usize, component: usize) -> R {
    R::pack(
        #[inline(always)]
        |row| blocks[row.min(blocks.len() - 1)][step][component],
    )
}

/// Computes the returns of up to `R::ROWS` blocks. The plan flies five steps, then the base controller or the policy flies.
#[inline(always)]
fn rollout<R: Packed>(
    scene: &Scene,
    actions: Actions,
    blocks: &mut [Block],
    out: &mut [Worth],
    units: &mut Units<R>,
) {
    let mut flight = Flight::<R>::new(scene);
    let mut reference = [R::zero(); 2];
    if let Some(ahead) = scene.ahead {
        reference = [R::from_f64(ahead.reference()[0]), R::from_f64(ahead.reference()[1])];
    }
    let steps = match scene.ahead {
        Some(ahead) => ahead.steps(),
        None if scene.agent.is_some() => scene.steps,
        None => HORIZON,
    };
    // the loops are plain, because an iterator that is not inlined is compiled without the vector instructions. There is only
    // one call of the model, because a second inlined copy doubles a compile time of minutes
    let mut step = 0;
    while step < steps {
        let mut chosen = [R::zero(); ACTIONS];
        if step < HORIZON {
            chosen = [given(blocks, step, 0), given(blocks, step, 1), given(blocks, step, 2)];
        } else if step == HORIZON && actions != Actions::Base {
            reference = [flight.state.roll, flight.state.pitch];
        }
        let behind = step >= HORIZON && scene.ahead.is_none();
        let proposed = step < HORIZON && actions == Actions::Policy;
        if let (true, Some(agent)) = (behind || proposed, scene.agent) {
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
            // a plan with a base controller has only aileron and elevator
            command.throttle = base.throttle;
            command.rudder = base.rudder;
            command = slewed(command, &flight.previous[0], &scene.model.airframe);
        }
        if step < HORIZON {
            let thrust = command.throttle.scale(2.0) - R::from_f64(1.0);
            for (row, block) in blocks.iter_mut().enumerate() {
                block[step][0] = command.aileron.unpack(row);
                block[step][1] = command.elevator.unpack(row);
                block[step][2] = thrust.unpack(row);
            }
        }
        flight.advance(scene, command);
        step += 1;
    }
    let mut doubt = R::zero();
    let valued = scene.agent.and_then(|agent| Some((&agent.actor, agent.critics.as_ref()?)));
    if let (Some(alpha), Some((actor, critics))) = (scene.alpha, valued) {
        let view = observe(&flight.state, &flight.observed(scene), &flight.target);
        let value = match &scene.surrogate {
            Some(surrogate) => surrogate.value(&view),
            None => {
                let advised = actor.act(units, &view);
                let first = critics[0].value(units, &view, &advised);
                let second = critics[1].value(units, &view, &advised);
                doubt = (first - second).abs().scale(alpha * flight.weight);
                // unlike the vector minimum, this form keeps a NaN
                first + (second - first).min(R::zero())
            }
        };
        flight.sum += value.scale(alpha * flight.weight);
        for (row, out) in out.iter_mut().enumerate() {
            let mut i = 0;
            while i < OBSERVATIONS {
                out.end[i] = view[i].unpack(row);
                i += 1;
            }
            out.value = value.unpack(row);
        }
    }
    for (row, out) in out.iter_mut().enumerate() {
        out.returns = flight.sum.unpack(row);
        out.doubt = doubt.unpack(row);
    }
}

/// `command` with the change of its surfaces since the command `last` limited to the airframe's slew rate. The pilot applies the
/// same limit. A plan without this limit oscillates if the channels are also delayed.
#[inline(always)]
pub(super) fn slewed<R: Real>(
    command: Command<R>,
    last: &Command<R>,
    airframe: &Airframe,
) -> Command<R> {
    let reach = R::from_f64(airframe.envelope.surface_slew_per_s * STEP);
    let within = |x: R, from: R| x.max(from - reach).min(from + reach);
    let mut rudder = command.rudder;
    if airframe.actuators.rudder.is_some() {
        rudder = within(rudder, last.rudder);
    }
    Command {
        aileron: within(command.aileron, last.aileron),
        elevator: within(command.elevator, last.elevator),
        rudder,
        ..command
    }
}

/// A command with its components converted to another number type.
#[inline(always)]
fn command_of<R>(c: Command, number: impl Fn(f64) -> R) -> Command<R> {
    Command {
        aileron: number(c.aileron),
        elevator: number(c.elevator),
        throttle: number(c.throttle),
        rudder: number(c.rudder),
    }
}

#[cfg(test)]
mod tests;
