//! CEM-MPC, section III-D of \[GSFM26\], with the policy's proposals and the critics' values that make
//! it the hybrid controller of section IV-C.

mod disturbance;
mod rollout;

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::control::lqi::{Ahead, Lqi};
use crate::control::policy::Agent;
use crate::control::task::Task;
use crate::control::{Controller, Observation, Target};
use crate::model::GreyBox;
use crate::num::stream;
use crate::physics::Command;
use disturbance::Disturbance;
use rollout::{Actions, Block, HORIZON, Machine, Scene, WIDTH, Worth};

/// How the candidates of an iteration make the next distribution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Update {
    /// Mean and deviation of the K best: the cross-entropy method.
    Elites(usize),
    /// Mean and deviation of all, weighted with exp(return / λ): MPPI (Williams et al., 2017), λ in units
    /// of the return.
    Weighted(f64),
}

/// Size of the search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Candidates per iteration N, a multiple of 16.
    pub population: usize,
    /// What becomes of them.
    pub update: Update,
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
    /// Steps in all that a plan is flown in the model, the base flying from the sixth on; without a
    /// base there are five.
    pub steps: usize,
    /// What a plan must be worth beside the base's to be flown, in units of the return.
    pub margin: f64,
    /// Time constant (s) with which what the model leaves unexplained is estimated; `None`: it is not.
    pub disturbance: Option<f64>,
}

impl Settings {
    /// CEM-MPC alone. H = 5 is the paper's; N, K, I are not given there: 1024 rollouts a step in all.
    pub const PAPER: Settings = Settings {
        population: 256,
        update: Update::Elites(16),
        iterations: 4,
        spread: 1.0,
        proposals: 0,
        noise: [0.2, 0.5],
        alpha: None,
        steps: HORIZON,
        margin: 0.0,
        disturbance: None,
    };
    /// CEM + π.
    pub const POLICY: Settings = Settings { proposals: 32, ..Settings::PAPER };
    /// CEM + Q.
    pub const CRITICS: Settings = Settings { alpha: Some(1.0), ..Settings::PAPER };
    /// The hybrid controller.
    pub const HYBRID: Settings = Settings { alpha: Some(1.0), ..Settings::POLICY };
    /// MPPI over the same rollouts.
    pub const MPPI: Settings = Settings { update: Update::Weighted(0.01), ..Settings::PAPER };
    /// The hybrid controller over an LQI, which flies on behind each plan: that is what the end is
    /// worth, in place of critics. Offset-free.
    ///
    /// The margin is 0.12° of attitude error over all steps: less is the search's noise, and a plan that is
    /// flown for it takes the LQI's integrals out of the loop (at 0.002 hard targets settle at 0.04°, at
    /// 0.05 at 0.001°).
    pub const OVER_LQI: Settings = Settings {
        population: 128,
        update: Update::Elites(12),
        iterations: 3,
        spread: 0.3,
        proposals: 16,
        noise: [0.1, 0.3],
        alpha: None,
        steps: 80,
        margin: 5e-2,
        disturbance: Some(0.3),
    };
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

/// A plan with its worth.
#[derive(Clone, Copy, Debug)]
struct Valued {
    plan: Plan,
    worth: f32,
    doubt: f32,
}

/// The planner. All its memory is taken when it is built; a plan costs the same every time.
#[derive(Clone, Debug)]
pub struct Cem {
    name: &'static str,
    model: GreyBox,
    settings: Settings,
    agent: Option<Agent>,
    base: Option<Base>,
    disturbance: Option<Disturbance>,
    machine: Machine,
    blocks: Vec<Block>,
    worth: Vec<Worth>,
    order: Vec<(f32, u32)>,
    /// The plan of the last tick, if it was the search's.
    last: Option<Plan>,
    seed: u64,
    tick: u64,
}

/// The controller that flies where the search finds nothing better, and what it would do next.
#[derive(Clone, Debug)]
struct Base {
    lqi: Lqi,
    ahead: Ahead,
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
        let steps = settings.steps.max(HORIZON);
        Cem {
            name,
            model: model.clone(),
            settings,
            agent: aids.agent,
            base: aids.base.map(|lqi| Base { lqi, ahead: Ahead::new(steps) }),
            disturbance: settings.disturbance.map(Disturbance::new),
            machine: Machine::detect(),
            blocks: vec![[[[0.0; WIDTH]; 3]; HORIZON]; count],
            worth: vec![Worth::NONE; count],
            order: Vec::with_capacity(count * WIDTH),
            last: None,
            seed: 0,
            tick: 0,
        }
    }

    /// The same planner in the instructions that the target always has, to be measured beside others:
    /// vectors of four, on x86 without fused multiply-adds.
    pub fn narrow(mut self) -> Cem {
        self.machine = Machine::baseline();
        self
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

    /// Draws the noise on the proposals of the blocks from `first` up to `end`; the first lane has none.
    fn sample_noise(&mut self, rng: &mut impl Rng, [first, end]: [usize; 2]) {
        let [deviation, most] = self.settings.noise;
        for (b, block) in self.blocks[first..end].iter_mut().enumerate() {
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
            agent: self.agent.as_ref(),
            alpha: self.settings.alpha,
            memory: self.disturbance.as_ref().map(Disturbance::memory).unwrap_or_default(),
            disturbance: self.disturbance.as_ref().map_or(disturbance::NONE, Disturbance::rate),
            ahead: self.base.as_ref().map(|base| &base.ahead),
        };
        let (blocks, worth) = (&mut self.blocks[first..end], &mut self.worth[first..end]);
        self.machine.fly(&scene, actions, blocks, worth);
    }

    /// A candidate with its worth.
    fn candidate(&self, index: usize) -> Valued {
        let (block, lane) = (index / WIDTH, index % WIDTH);
        let actions = &self.blocks[block];
        let plan = std::array::from_fn(|h| std::array::from_fn(|c| actions[h][c][lane].into()));
        let Worth { returns, doubt } = self.worth[block];
        Valued { plan, worth: returns[lane], doubt: doubt[lane] }
    }

    /// Mean and standard deviation of the candidates' actions, as the update weighs them, with the best
    /// of them; `None` if too few stay finite.
    fn refit(&mut self) -> Option<(Plan, Plan, Valued)> {
        self.order.clear();
        for (b, worth) in self.worth.iter().enumerate() {
            for (i, &value) in worth.returns.iter().enumerate() {
                // a candidate that leaves the numbers is the worst there is
                let value = if value.is_finite() { value } else { f32::NEG_INFINITY };
                self.order.push((value, (b * WIDTH + i) as u32));
            }
        }
        // ties go to the lower index, so the order is the same everywhere
        let better = |a: &(f32, u32), b: &(f32, u32)| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1));
        let &best = self.order.iter().min_by(|a, b| better(a, b))?;
        let count = match self.settings.update {
            Update::Elites(count) => count.clamp(1, self.order.len()),
            Update::Weighted(_) => self.order.len(),
        };
        self.order.select_nth_unstable_by(count - 1, better);
        let weighted = matches!(self.settings.update, Update::Weighted(_));
        let chosen = &mut self.order[..count];
        let lost = |(value, _): &(f32, u32)| *value == f32::NEG_INFINITY;
        if lost(&best) || !weighted && chosen.iter().any(lost) {
            return None;
        }
        chosen.sort_unstable_by_key(|&(_, index)| index);
        let mut all = 0.0;
        let mut mean = [[0.0; 3]; HORIZON];
        let mut square = [[0.0; 3]; HORIZON];
        for &(value, index) in chosen.iter() {
            let weight = match self.settings.update {
                Update::Elites(_) => 1.0,
                Update::Weighted(scale) => (f64::from(value - best.0) / scale).exp(),
            };
            all += weight;
            let (block, lane) = (index as usize / WIDTH, index as usize % WIDTH);
            for h in 0..HORIZON {
                for c in 0..3 {
                    let a = f64::from(self.blocks[block][h][c][lane]);
                    mean[h][c] += weight * a;
                    square[h][c] += weight * a * a;
                }
            }
        }
        mean.iter_mut().chain(&mut square).flatten().for_each(|x| *x /= all);
        let deviation =
            |h: usize, c: usize| (square[h][c] - mean[h][c] * mean[h][c]).max(0.0).sqrt();
        let spread = std::array::from_fn(|h| std::array::from_fn(|c| deviation(h, c)));
        Some((mean, spread, self.candidate(best.1 as usize)))
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
                self.sample_noise(&mut rng, [0, first]);
                self.fly(seen, target, Actions::Policy, [0, first]);
            }
            self.sample(&mut rng, first, &mean, &spread);
            self.fly(seen, target, Actions::Given, [first, all]);
            (mean, spread, _) = self.refit()?;
        }
        Some(mean)
    }

    /// The best plan around the base's, if it is worth more than the base's by the margin and by what
    /// the critics doubt of either.
    fn search_around_base(&mut self, seen: &Observation, target: &Target) -> Option<Plan> {
        let mut rng = stream::stream(self.seed, &[self.tick]);
        self.tick += 1;
        let all = self.blocks.len();
        self.sample_noise(&mut rng, [0, 1]);
        self.fly(seen, target, Actions::Base, [0, 1]);
        let base = self.candidate(0);
        let proposed = (1 + self.settings.proposals.div_ceil(WIDTH)).min(all);
        self.sample_noise(&mut rng, [1, proposed]);
        self.fly(seen, target, Actions::Policy, [1, proposed]);
        let mut first = proposed;
        let mut mean = base.plan;
        let mut spread = [[self.settings.spread; 3]; HORIZON];
        let mut best = base;
        for _ in 0..self.settings.iterations {
            self.sample(&mut rng, first, &mean, &spread);
            if let (true, Some(last)) = (first == proposed && first < all, self.last) {
                self.put(first, 0, &shifted(&last));
            }
            self.fly(seen, target, Actions::Given, [first, all]);
            let found;
            (mean, spread, found) = self.refit()?;
            if found.worth > best.worth {
                best = found;
            }
            first = 0;
        }
        // the mean has less of the sampling's noise than its best member
        self.put(0, 0, &mean);
        self.fly(seen, target, Actions::Given, [0, 1]);
        let middle = self.candidate(0);
        let chosen = if middle.worth >= best.worth { middle } else { best };
        let doubt = chosen.doubt.max(base.doubt) + self.settings.margin as f32;
        // a comparison with what is no number is false: the base flies
        (chosen.worth - base.worth > doubt).then_some(chosen.plan)
    }

    /// Puts a plan into the place of a candidate.
    fn put(&mut self, block: usize, lane: usize, plan: &Plan) {
        for (actions, given) in self.blocks[block].iter_mut().zip(plan) {
            actions.iter_mut().zip(given).for_each(|(lanes, x)| lanes[lane] = *x as f32);
        }
    }

    /// The base's command, or that of a plan that is surely better.
    fn over_base(&mut self, mut base: Base, seen: &Observation, target: &Target) -> Command {
        base.lqi.look_ahead(seen, target, &mut base.ahead);
        let before = base.lqi.clone();
        let alone = base.lqi.command(seen, target);
        self.base = Some(base);
        self.last = self.search_around_base(seen, target);
        match (self.last, &mut self.base) {
            (Some(plan), Some(base)) => {
                base.lqi.hand_over(&before, seen);
                Command { throttle: alone.throttle, ..flown(&plan) }
            }
            _ => alone,
        }
    }
}

/// A plan a tick later, its last action held.
fn shifted(plan: &Plan) -> Plan {
    std::array::from_fn(|h| plan[(h + 1).min(HORIZON - 1)])
}

/// The command that a plan begins with.
fn flown(plan: &Plan) -> Command {
    let [aileron, elevator, thrust] = plan[0];
    Command { aileron, elevator, throttle: (thrust + 1.0) / 2.0 }.clamped()
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
        self.last = None;
        self.disturbance = self.settings.disturbance.map(Disturbance::new);
        if let Some(base) = &mut self.base {
            base.lqi.reset(seed);
        }
    }

    fn command(&mut self, seen: &Observation, target: &Target) -> Command {
        if let Some(disturbance) = &mut self.disturbance {
            disturbance.update(&self.model, seen);
        }
        if let Some(base) = self.base.take() {
            return self.over_base(base, seen, target);
        }
        // said by a command that is no number: whoever flies has a fallback
        flown(&self.search(seen, target).unwrap_or([[f64::NAN; 3]; HORIZON]))
    }
}
