//! Many aircraft simulated at once by a model in SIMD lanes, for the training of policies (section IV-B of \[GSFM26\], T.
//! Guerin et al., 2026, see `src/lib.rs`).

use std::sync::Arc;

use crate::targets::Stratified;
use greylag_control::Target;
use greylag_control::policy::{ACTIONS, OBSERVATIONS, command, observe};
use greylag_control::task::Task;
pub use greylag_model::block::Block;
use greylag_model::{GreyBox, Memory};
use greylag_num::{ROW, Real};
use greylag_physics::actuators::Actuators;
use greylag_physics::inputs::InputMemory;
use greylag_physics::{Airframe, Controls, State};

/// Number of aircraft in a block, one per SIMD lane.
pub const WIDTH: usize = ROW;

/// Number of steps of an episode, 10 ms each. Episodes in JSBSim have the same number.
pub const STEPS: u32 = 1000;

/// Largest |θ| of a model's validity, rad.
const PITCH: f64 = 1.48;
/// Largest |α| and |β|, rad.
const INCIDENCE: f64 = 1.0;
/// Largest |p|, |q| and |r|, rad/s.
const RATE: f64 = 25.0;
/// Smallest and largest airspeed as fractions of the smallest and the largest airspeed of the aircraft's envelope: 4 and
/// 60 m/s for the X8, with which the shipped policies were trained.
const AIRSPEED: [f64; 2] = [4.0 / 13.0, 4.0 / 3.0];

/// Validity limits of an aircraft's model. An episode ends when a state exceeds them.
#[derive(Clone, Copy, Debug)]
pub struct Validity {
    airspeed: [f64; 2],
}

/// State of an aircraft's episode after a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// The episode continues.
    No,
    /// The episode was truncated by the time limit. The critics' value of the next state replaces the missing rewards.
    Time,
    /// Terminated: a validity limit was exceeded.
    Lost,
}

/// Result of one step of a block, before episodes that have ended are reset.
#[derive(Clone, Copy, Debug)]
pub struct Stepped {
    /// Observation after the step.
    pub observed: [Block; OBSERVATIONS],
    /// Reward of eq. (30) of \[GSFM26\].
    pub reward: Block,
    /// State of each aircraft's episode.
    pub ended: [Ended; WIDTH],
}

/// Many aircraft simulated by a model at once. Each has its own target, actuator filters and episode.
/// [`Imagined`](crate::environment::Imagined) simulates a single aircraft for a controller.
///
/// The state includes the complete memories of the actuator filters. The air density is constant, because it would change by
/// less than 1 % in an episode.
#[derive(Clone, Debug)]
pub struct Imagination {
    model: Arc<GreyBox>,
    validity: Validity,
    task: Task,
    instances: usize,
    batches: Vec<Batch>,
    neutral: Batch,
    targets: Stratified,
    lost: u64,
}

/// One block of aircraft.
#[derive(Clone, Debug)]
struct Batch {
    state: State<Block>,
    actuators: Actuators<Block>,
    memory: Memory<Block>,
    inputs: Option<InputMemory<Block>>,
    target: Target<Block>,
    step: [u32; WIDTH],
}

impl Imagination {
    /// `instances` aircraft of `model` in level flight at the start of an episode. `targets` supplies the target of each
    /// episode.
    pub fn new(model: Arc<GreyBox>, instances: usize, targets: Stratified) -> Imagination {
        let lane = Block::from_f64;
        let (state, rest) = (model.airframe.start(), Controls::default());
        let mut memory = Memory::default();
        // the integration scheme starts with the acceleration of the initial state
        model.step(&state, &rest, model.airframe.reference.altitude, &mut memory);
        let zero = lane(0.0);
        let rest =
            Controls { aileron: zero, elevator: zero, throttle: zero, rudder: zero, lagged: None };
        let neutral = Batch {
            state: state.map(lane),
            actuators: Actuators::at_rest(&rest).fitted(&model.airframe.actuators),
            memory: memory.map(lane),
            inputs: (!model.acts_at_once()).then(|| model.at_rest(&rest)),
            target: Target { roll: 0.0, pitch: 0.0, airspeed: state.airspeed }.map(lane),
            step: [0; WIDTH],
        };
        let count = instances.div_ceil(WIDTH);
        let mut imagination = Imagination {
            validity: Validity::of(&model.airframe),
            model,
            task: Task::PAPER,
            instances,
            batches: vec![neutral.clone(); count],
            neutral,
            targets,
            lost: 0,
        };
        imagination.restart(imagination.targets.count());
        imagination
    }

    /// Starts new episodes. Their targets are those of the random sequence after the first `targets`.
    pub fn restart(&mut self, targets: u64) {
        self.targets.go_on_after(targets);
        for k in 0..self.batches.len() {
            self.batches[k] = self.neutral.clone();
            for lane in 0..WIDTH {
                self.aim(k, lane);
            }
        }
    }

    /// Assigns the next target to an aircraft.
    fn aim(&mut self, batch: usize, lane: usize) {
        if batch * WIDTH + lane < self.instances {
            let Target { roll, pitch, airspeed } = self.targets.next_target();
            let target = &mut self.batches[batch].target;
            (target.roll.0[lane], target.pitch.0[lane]) = (roll as f32, pitch as f32);
            target.airspeed.0[lane] = airspeed as f32;
        }
    }

    /// Number of aircraft.
    pub fn instances(&self) -> usize {
        self.instances
    }

    /// Number of blocks. Lanes of the last block beyond the number of aircraft are unused.
    pub fn blocks(&self) -> usize {
        self.batches.len()
    }

    /// Number of episodes started, and number of episodes that ended at a validity limit.
    pub fn episodes(&self) -> [u64; 2] {
        [self.targets.count(), self.lost]
    }

    /// The present observations of a block's aircraft.
    pub fn observe(&self, block: usize) -> [Block; OBSERVATIONS] {
        let Batch { state, actuators, target, .. } = &self.batches[block];
        observe(state, &actuators.observed(&self.model.airframe.actuators), target)
    }

    /// Simulates one step of a block under `action`. Ended episodes are reset afterwards.
    pub fn step(&mut self, block: usize, action: &[Block; ACTIONS]) -> Stepped {
        let batch = &mut self.batches[block];
        let (observed, reward, outside) =
            batch.advance(&self.model, &self.validity, &self.task, action);
        let mut ended = [Ended::No; WIDTH];
        let mut anew = Block::zero();
        for (lane, (steps, how)) in batch.step.iter_mut().zip(&mut ended).enumerate() {
            *steps += 1;
            *how = match (outside.0[lane] > 0.0, *steps >= STEPS) {
                (true, _) => Ended::Lost,
                (_, true) => Ended::Time,
                _ => continue,
            };
            anew.0[lane] = 1.0;
            *steps = 0;
        }
        if ended != [Ended::No; WIDTH] {
            batch.begin(anew, &self.neutral);
            for (lane, how) in ended.iter().enumerate() {
                if *how != Ended::No {
                    let counts = block * WIDTH + lane < self.instances;
                    self.lost += u64::from(counts && *how == Ended::Lost);
                    self.aim(block, lane);
                }
            }
        }
        Stepped { observed, reward, ended }
    }
}

impl Batch {
    /// Resets the aircraft in the lanes where `chosen` is 1.
    fn begin(&mut self, chosen: Block, neutral: &Batch) {
        self.state = self.state.replaced(chosen, &neutral.state);
        self.actuators = self.actuators.replaced(chosen, &neutral.actuators);
        self.memory = self.memory.replaced(chosen, &neutral.memory);
        if let (Some(inputs), Some(rest)) = (&mut self.inputs, &neutral.inputs) {
            *inputs = inputs.replaced(chosen, rest);
        }
    }

    /// One step in the simulator's order: the state advances under the present actuators, then the actuators receive the
    /// command. Returns observation, reward, and 1 where a validity limit is exceeded.
    #[inline(always)]
    fn advance(
        &mut self,
        model: &GreyBox,
        validity: &Validity,
        task: &Task,
        action: &[Block; ACTIONS],
    ) -> ([Block; OBSERVATIONS], Block, Block) {
        let figures = &model.airframe.actuators;
        let mut controls = self.actuators.controls();
        if let Some(inputs) = &mut self.inputs {
            controls = model.act(&controls, inputs);
        }
        let altitude = model.airframe.reference.altitude;
        let next = model.step_block(&self.state, &controls, altitude, &mut self.memory);
        self.state = State { roll: wrapped(next.roll), ..next };
        let mut limited = *action;
        for x in &mut limited {
            *x = x.clamp(-1.0, 1.0);
        }
        self.actuators.step(&command(limited), figures);
        let seen = observe(&self.state, &self.actuators.observed(figures), &self.target);
        (seen, task.reward(&self.state, &self.target), validity.outside(&self.state))
    }
}

/// Wraps `roll` (rad) to −π..π. It may lie outside this range by less than one turn.
#[inline(always)]
fn wrapped(roll: Block) -> Block {
    let (half, turn) =
        (Block::from_f64(std::f64::consts::PI), Block::from_f64(std::f64::consts::TAU));
    let roll = Block::where_less(half, roll, roll - turn, roll);
    Block::where_less(roll, -half, roll + turn, roll)
}

impl Validity {
    /// Limits of the model of an aircraft with `airframe`.
    pub fn of(airframe: &Airframe) -> Validity {
        let ([slow, fast], envelope) = (AIRSPEED, &airframe.envelope);
        Validity { airspeed: [slow * envelope.airspeed_min_mps, fast * envelope.airspeed_max_mps] }
    }

    /// Smallest and largest value of each state within the limits: rad, rad/s, m/s.
    pub fn bounds(&self) -> [State; 2] {
        let ([slow, fast], roll) = (self.airspeed, std::f64::consts::PI);
        let most = [roll, PITCH, fast, RATE, RATE, RATE, INCIDENCE, INCIDENCE];
        let mut least = most.map(|x| -x);
        least[2] = slow;
        [State::from_array(least), State::from_array(most)]
    }

    /// 1 where a state is outside the limits or not finite, else 0.
    #[inline(always)]
    pub fn outside(&self, s: &State<Block>) -> Block {
        let inside = |x: Block, most: f64, others: Block| {
            // a comparison with NaN is false
            Block::where_less(x.abs(), Block::from_f64(most), others, Block::zero())
        };
        let [slow, fast] = self.airspeed;
        let middle = Block::from_f64(0.5 * (slow + fast));
        let mut all = Block::from_f64(1.0);
        all = inside(s.pitch, PITCH, all);
        all = inside(s.airspeed - middle, 0.5 * (fast - slow), all);
        all = inside(s.alpha, INCIDENCE, all);
        all = inside(s.beta, INCIDENCE, all);
        all = inside(s.p, RATE, all);
        all = inside(s.q, RATE, all);
        all = inside(s.r, RATE, all);
        all = inside(s.roll, 10.0, all);
        Block::from_f64(1.0) - all
    }
}
