//! CEM-MPC, section III-D of \[GSFM26\], with the policy's proposals and the critics' values that make
//! it the hybrid controller of section IV-C.

mod rollout;

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::control::lqi::Lqi;
use crate::control::policy::Agent;
use crate::control::task::Task;
use crate::control::{Controller, Observation, Target};
use crate::model::{GreyBox, Memory};
use crate::num::stream;
use crate::physics::Command;
use crate::physics::actuators::Actuators;
use rollout::{Actions, Block, HORIZON, Machine, Scene, WIDTH, Worth};

/// Size of the search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Candidates per iteration N, a multiple of 16.
    pub population: usize,
    /// Candidates kept K.
    pub elites: usize,
    /// Iterations I.
    pub iterations: usize,
    /// Standard deviation of the first iteration, in units of the action.
    pub spread: f64,
    /// Candidates of the first iteration that the policy proposes, a multiple of 16; the first of them
    /// without noise.
    pub proposals: usize,
    /// Standard deviation of the noise on the others, and where it is cut off.
    pub noise: [f64; 2],
    /// Weight α of the critics' value of the end, eq. (26).
    pub alpha: Option<f64>,
}

impl Settings {
    /// CEM-MPC alone. H = 5 is the paper's; N, K, I are not given there: 1024 rollouts a step in all.
    pub const PAPER: Settings = Settings {
        population: 256,
        elites: 16,
        iterations: 4,
        spread: 1.0,
        proposals: 0,
        noise: [0.2, 0.5],
        alpha: None,
    };
    /// CEM + π.
    pub const POLICY: Settings = Settings { proposals: 32, ..Settings::PAPER };
    /// CEM + Q.
    pub const CRITICS: Settings = Settings { alpha: Some(1.0), ..Settings::PAPER };
    /// The hybrid controller.
    pub const HYBRID: Settings = Settings { alpha: Some(1.0), ..Settings::POLICY };
}

/// What a search may lean on.
#[derive(Clone, Debug, Default)]
pub struct Aids {
    /// The policy that proposes, with its critics.
    pub agent: Option<Agent>,
    /// The controller whose plan is flown where the search finds none that is surely better.
    pub base: Option<Lqi>,
}

/// An action in the paper's units: aileron, elevator and throttle in −1..1 (eq. 29).
type Action = [f64; 3];

/// Actions over the horizon.
type Plan = [Action; HORIZON];

/// The planner. All its memory is taken when it is built; a plan costs the same every time.
#[derive(Clone, Debug)]
pub struct Cem {
    name: &'static str,
    model: GreyBox,
    settings: Settings,
    aids: Aids,
    machine: Machine,
    blocks: Vec<Block>,
    worth: Vec<Worth>,
    order: Vec<(f32, u32)>,
    seed: u64,
    tick: u64,
}

impl Cem {
    /// A planner through `model` under the name `name`.
    ///
    /// # Panics
    /// If the settings ask for a policy or its critics and `aids` has none.
    pub fn new(name: &'static str, model: &GreyBox, settings: Settings, aids: Aids) -> Cem {
        let leans = settings.proposals > 0 || settings.alpha.is_some();
        assert!(!leans || aids.agent.is_some(), "a search that leans on a policy is given one");
        let count = settings.population.div_ceil(WIDTH);
        Cem {
            name,
            model: model.clone(),
            settings,
            aids,
            machine: Machine::detect(),
            blocks: vec![[[[0.0; WIDTH]; 3]; HORIZON]; count],
            worth: vec![Worth::NONE; count],
            order: Vec::with_capacity(count * WIDTH),
            seed: 0,
            tick: 0,
        }
    }

    /// Draws the candidates of an iteration into the blocks from `first` on.
    fn sample(&mut self, rng: &mut impl Rng, first: usize, mean: &Plan, spread: &Plan) {
        for block in &mut self.blocks[first..] {
            for ((actions, mean), spread) in block.iter_mut().zip(mean).zip(spread) {
                for ((lanes, m), s) in actions.iter_mut().zip(mean).zip(spread) {
                    for x in lanes {
                        let normal: f64 = StandardNormal.sample(rng);
                        *x = (m + s * normal).clamp(-1.0, 1.0) as f32;
                    }
                }
            }
        }
    }

    /// Draws the noise on the policy's proposals into the first blocks; the first lane has none.
    fn sample_noise(&mut self, rng: &mut impl Rng, blocks: usize) {
        let [deviation, most] = self.settings.noise;
        for (b, block) in self.blocks[..blocks].iter_mut().enumerate() {
            for lanes in block.iter_mut().flatten() {
                for (i, x) in lanes.iter_mut().enumerate() {
                    let normal: f64 = StandardNormal.sample(rng);
                    let noise = (deviation * normal).clamp(-most, most);
                    *x = if b + i == 0 { 0.0 } else { noise as f32 };
                }
            }
        }
    }

    /// Flies the blocks from `first` up to `end`.
    fn fly(
        &mut self,
        seen: &Observation,
        target: &Target,
        actions: Actions,
        [first, end]: [usize; 2],
    ) {
        let scene = Scene {
            model: &self.model,
            task: &Task::PAPER,
            seen,
            target,
            agent: self.aids.agent.as_ref(),
            alpha: self.settings.alpha,
        };
        let (blocks, worth) = (&mut self.blocks[first..end], &mut self.worth[first..end]);
        self.machine.fly(&scene, actions, blocks, worth);
    }

    /// Mean and standard deviation of the elites' actions; `None` if too few candidates stay finite.
    fn refit(&mut self) -> Option<(Plan, Plan)> {
        self.order.clear();
        for (b, worth) in self.worth.iter().enumerate() {
            for (i, &value) in worth.returns.iter().enumerate() {
                // a candidate that leaves the numbers is the worst there is
                let value = if value.is_finite() { value } else { f32::NEG_INFINITY };
                self.order.push((value, (b * WIDTH + i) as u32));
            }
        }
        let elites = self.settings.elites.clamp(1, self.order.len());
        // ties go to the lower index, so the order is the same everywhere
        self.order
            .select_nth_unstable_by(elites - 1, |a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let chosen = &mut self.order[..elites];
        if chosen.iter().any(|(value, _)| *value == f32::NEG_INFINITY) {
            return None;
        }
        chosen.sort_unstable_by_key(|&(_, index)| index);
        let mut mean = [[0.0; 3]; HORIZON];
        let mut square = [[0.0; 3]; HORIZON];
        for &(_, index) in chosen.iter() {
            let (block, lane) = (index as usize / WIDTH, index as usize % WIDTH);
            for h in 0..HORIZON {
                for c in 0..3 {
                    let a = f64::from(self.blocks[block][h][c][lane]);
                    mean[h][c] += a / elites as f64;
                    square[h][c] += a * a / elites as f64;
                }
            }
        }
        let deviation =
            |h: usize, c: usize| (square[h][c] - mean[h][c] * mean[h][c]).max(0.0).sqrt();
        let spread = std::array::from_fn(|h| std::array::from_fn(|c| deviation(h, c)));
        Some((mean, spread))
    }

    /// The plan that the search ends with.
    fn search(&mut self, seen: &Observation, target: &Target) -> Option<Plan> {
        let mut rng = stream::stream(self.seed, &[self.tick]);
        self.tick += 1;
        let mut mean = [[0.0; 3]; HORIZON];
        let mut spread = [[self.settings.spread; 3]; HORIZON];
        let all = self.blocks.len();
        for iteration in 0..self.settings.iterations {
            let mut first = 0;
            if iteration == 0 {
                first = self.settings.proposals.div_ceil(WIDTH).min(all);
                self.sample_noise(&mut rng, first);
                self.fly(seen, target, Actions::Policy, [0, first]);
            }
            self.sample(&mut rng, first, &mean, &spread);
            self.fly(seen, target, Actions::Given, [first, all]);
            (mean, spread) = self.refit()?;
        }
        Some(mean)
    }

    /// Whether `plan` is better than the base's by more than the critics' doubt of either.
    fn surely_better(
        &mut self,
        seen: &Observation,
        target: &Target,
        plan: &Plan,
        base: &Plan,
    ) -> bool {
        for (h, actions) in self.blocks[0].iter_mut().enumerate() {
            for (c, lanes) in actions.iter_mut().enumerate() {
                lanes.fill(base[h][c] as f32);
                lanes[0] = plan[h][c] as f32;
            }
        }
        self.fly(seen, target, Actions::Given, [0, 1]);
        let Worth { returns, doubt } = self.worth[0];
        // a comparison with what is no number is false: the base flies
        returns[0] - returns[1] > doubt[0].max(doubt[1])
    }
}

/// The base's plan, flown through the model.
fn planned(model: &GreyBox, base: &mut Lqi, seen: &Observation, target: &Target) -> Plan {
    let figures = &model.airframe.actuators;
    let mut ahead = *seen;
    let mut actuators = Actuators::from_observed(&seen.actuators, &seen.previous, figures);
    let mut memory = Memory::default();
    let mut plan = [[0.0; 3]; HORIZON];
    // what the base remembers moves on by one tick only
    let mut later: Option<Lqi> = None;
    for action in &mut plan {
        let command = match &mut later {
            Some(later) => later.command(&ahead, target),
            None => {
                let command = base.command(&ahead, target);
                later = Some(base.clone());
                command
            }
        };
        *action = [command.aileron, command.elevator, 2.0 * command.throttle - 1.0];
        let state = model.step(&ahead.state, &actuators.controls(), seen.altitude, &mut memory);
        actuators.step(&command, figures);
        ahead = Observation {
            state,
            actuators: actuators.observed(figures),
            previous: [command, ahead.previous[0]],
            ..ahead
        };
    }
    plan
}

impl Controller for Cem {
    fn name(&self) -> &'static str {
        self.name
    }

    fn boxed_clone(&self) -> Box<dyn Controller> {
        Box::new(self.clone())
    }

    fn reset(&mut self, seed: u64) {
        (self.seed, self.tick) = (seed, 0);
        if let Some(base) = &mut self.aids.base {
            base.reset(seed);
        }
    }

    fn command(&mut self, seen: &Observation, target: &Target) -> Command {
        let base = self.aids.base.as_mut().map(|base| planned(&self.model, base, seen, target));
        let found = self.search(seen, target);
        let plan = match (found, base) {
            (Some(plan), Some(base)) => {
                if self.surely_better(seen, target, &plan, &base) {
                    plan
                } else {
                    base
                }
            }
            (Some(plan), None) | (None, Some(plan)) => plan,
            // said by a command that is no number: whoever flies has a fallback
            (None, None) => [[f64::NAN; 3]; HORIZON],
        };
        let [aileron, elevator, thrust] = plan[0];
        Command { aileron, elevator, throttle: (thrust + 1.0) / 2.0 }.clamped()
    }
}
