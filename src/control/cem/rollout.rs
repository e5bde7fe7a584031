//! Rollouts: simulations of many candidate plans at once, with the widest vector instructions of the processor. A plan has
//! actions for five steps. After them the base controller (the LQI) flies or, without one, the policy.

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

/// Number of candidates in a block, one per lane of the vector.
pub(super) const WIDTH: usize = ROW;

/// Planning horizon H of \[GSFM26\] (see `src/lib.rs`), steps.
pub(super) const HORIZON: usize = 5;

/// The actions (aileron, elevator, throttle of eq. 29) of `WIDTH` candidates over the horizon.
pub(super) type Block = [[[f32; WIDTH]; 3]; HORIZON];

/// Inputs of a rollout that all candidates of a control cycle share.
#[derive(Clone, Copy)]
pub(super) struct Scene<'a> {
    pub model: &'a GreyBox,
    pub task: &'a Task,
    pub seen: &'a Observation,
    pub target: &'a Target,
    /// The policy that proposes actions. Its critics evaluate the terminal state.
    pub agent: Option<&'a Agent>,
    /// Weight α of the terminal value, eq. (26). `None` omits the terminal value.
    pub alpha: Option<f64>,
    /// Linear function that replaces the critics' terminal value.
    pub surrogate: Option<Surrogate>,
    /// Memory of the model's integrator: the last acceleration.
    pub memory: Memory,
    /// Constant disturbance added to the model's state rate, per second.
    pub disturbance: State,
    /// Control law of the base controller, which flies the steps after the plan and always commands throttle and rudder.
    pub ahead: Option<&'a Ahead>,
    /// Number of steps of a rollout that has a policy and no base controller. A rollout with neither has five steps.
    pub steps: usize,
    /// Sideslip that lowers the reward of a step by 1, rad. `None` omits this term.
    pub sideslip: Option<f64>,
}

/// The source of a block's actions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Actions {
    /// The block holds the actions.
    Given,
    /// The policy's actions plus the offsets in the block. The rollout writes the resulting actions into the block.
    Policy,
    /// The base controller's actions plus the offsets in the block. The rollout writes the resulting actions into the block.
    Base,
}

/// Result of the rollout of a block's candidates, with one value per lane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Worth {
    /// Discounted returns, eq. (13). With a terminal value they are those of eq. (26).
    pub returns: [f32; WIDTH],
    /// Absolute difference of the critics' two terminal values, with the same discount and weight as the terminal value.
    pub doubt: [f32; WIDTH],
    /// Observation at the terminal state, if there is a terminal value.
    pub end: [[f32; WIDTH]; OBSERVATIONS],
    /// Undiscounted terminal value: the smaller of the two critics' values, or the value of the surrogate.
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

/// The vector instructions that rollouts use, with scratch memory for the networks. The last bits of the results differ
/// between instruction sets, because fused multiply-add is used where the processor has it.
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
    /// Chooses the requested instruction set. If the processor lacks it, the widest narrower one that it supports is chosen.
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

    /// Rolls out the candidates of every block and writes the results into `out`.
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
    /// Starts from the observed state. Lags and delays of the deflections' effects start in steady state at the present
    /// deflections. Over the five steps of a plan, the effect of the present deflections is therefore overestimated.
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

    /// Advances the state with the present actuator positions, then the actuators. Adds the discounted reward to the return.
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

/// One component of the actions at `step` as a vector over all candidates. The last block is repeated to fill the vector.
#[inline(always)]
fn given<R: Packed>(blocks: &[Block], step: usize, component: usize) -> R {
    R::pack(
        #[inline(always)]
        |row| blocks[row.min(blocks.len() - 1)][step][component],
    )
}

/// Computes the results of up to `R::ROWS` blocks.
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
    // no iterators, because one that is not inlined is compiled without the vector instructions. Only one call of the model,
    // because a second inlined copy doubles a compile time of minutes
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
            // with a base controller, a plan determines only aileron and elevator
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

/// Limits the changes of the surfaces from `last` to `command` to one step at the airframe's slew rate. In flight all commands
/// are limited in the same way. Plans without this limit oscillate if the channels are also delayed.
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
