//! CEM-MPC planner (section III-D of \[GSFM26\], see `src/lib.rs`): each tick (10 ms) it samples candidate plans, simulates them
//! with the model and ranks them by their return. With a policy's proposals and critics' values it is the hybrid controller of
//! section IV-C.

mod candidates;
mod changes;
mod guard;
mod population;
mod rollout;
mod settings;
mod surrogate;

use std::time::{Duration, Instant};

use crate::disturbance::{self, Disturbance};
use crate::ilqr::Ilqr;
use crate::insight::Insight;
use crate::lqi::{Ahead, Lqi};
use crate::policy::Agent;
use crate::{Controller, Observation, Overruled, Target};
pub use changes::{Change, ChangeError};
use greylag_model::{GreyBox, STEP};
use greylag_num::stream;
use greylag_physics::actuators::Actuators;
use greylag_physics::{Command, Time};
use rollout::{Actions, Block, HORIZON, Machine, WIDTH, Worth};
pub use settings::{Instructions, Settings, Start, Update, Value};
use surrogate::Surrogate;

/// Number of candidates whose terminal states the critics evaluate with [`Value::Fitted`]. A linear function fitted to these
/// values then replaces the critics.
const SURVEYED: usize = 128;

/// Number of the last iteration's best candidates that the critics then evaluate again.
const RESCORED: usize = 64;

/// Sideslip that lowers the reward by 1 per step, rad. The term applies only if the base controller uses a rudder. The paper's
/// reward (eq. 30) has no sideslip term. Without this term a roll faster than the rudder can coordinate would cost nothing.
const SIDESLIP: f64 = 0.3;

/// Policy, base controller and iLQR planner, which a search may use.
#[derive(Clone, Debug, Default)]
pub struct Aids {
    /// The policy that proposes candidates, with its critics.
    pub agent: Option<Agent>,
    /// The controller that flies unless the search finds a plan whose return is higher by `Settings::margin`.
    pub base: Option<Lqi>,
    /// The planner whose plan is added to the candidates.
    pub ilqr: Option<Ilqr>,
}

/// An action in the paper's units (eq. 29): aileron, elevator and throttle, each −1..1.
type Action = [f64; 3];

/// Actions of one candidate at every step of the horizon.
type Plan = [Action; HORIZON];

/// A plan with its estimated return `worth` and the critics' disagreement `doubt` on its terminal value.
#[derive(Clone, Copy, Debug)]
struct Valued {
    plan: Plan,
    worth: f32,
    doubt: f32,
}

/// The CEM-MPC planner. All memory is allocated when the planner is built. The work per plan is constant.
#[derive(Clone, Debug)]
pub struct Cem {
    name: &'static str,
    model: GreyBox,
    settings: Settings,
    agent: Option<Agent>,
    base: Option<Base>,
    /// [`SIDESLIP`] if the base controller uses a rudder. Otherwise `None`.
    sideslip: Option<f64>,
    ilqr: Option<Ilqr>,
    /// Observer of the model's one-step prediction errors.
    predictions: Option<Disturbance>,
    machine: Machine,
    /// Rollout memory of the second core.
    second: Option<Machine>,
    blocks: Vec<Block>,
    worth: Vec<Worth>,
    order: Vec<(f32, u32)>,
    /// Plan of the last tick. `None` if the search's plan was not flown. `age` is the number of ticks since the plan was made.
    last: Option<Plan>,
    age: usize,
    /// With [`Settings::delay`]: the predicted observation of the next tick and the target, from which its command is planned.
    /// `planned_for` is the time for which `last` was planned.
    next: Option<(Observation, Target)>,
    planned_for: Option<Time>,
    kept: Vec<Plan>,
    surrogate: Option<Surrogate>,
    spent: Spent,
    seed: u64,
    tick: u64,
}

/// Computation time of the phases of a tick.
#[derive(Clone, Copy, Debug, Default)]
struct Spent {
    prepare: Duration,
    draw: Duration,
    fly: Duration,
    refit: Duration,
}

impl Spent {
    fn phases(&self) -> Vec<(&'static str, Duration)> {
        let Spent { prepare, draw, fly, refit } = *self;
        vec![("prepare", prepare), ("draw", draw), ("fly", fly), ("refit", refit)]
    }
}

/// The base controller with its control law over the horizon.
#[derive(Clone, Debug)]
struct Base {
    lqi: Lqi,
    ahead: Ahead,
}

impl Cem {
    /// A planner that predicts with `model` and is registered under `name`.
    ///
    /// # Panics
    /// If the settings ask for a policy or its critics and `aids` has none.
    pub fn new(name: &'static str, model: &GreyBox, settings: Settings, aids: Aids) -> Cem {
        assert!(
            !settings.needs_policy() || aids.agent.is_some(),
            "a search that leans on a policy is given one"
        );
        let count = settings.population.div_ceil(WIDTH);
        let steps = settings.steps.max(HORIZON);
        let machine = Machine::new(settings.instructions);
        Cem {
            name,
            model: model.clone(),
            settings,
            agent: aids.agent,
            sideslip: (aids.base.is_some() && model.has_rudder()).then_some(SIDESLIP),
            base: aids.base.map(|lqi| Base { lqi, ahead: Ahead::new(steps, &model.airframe) }),
            ilqr: aids.ilqr,
            predictions: guard::predictions(&settings),
            second: (settings.cores > 1).then(|| machine.clone()),
            machine,
            blocks: vec![[[[0.0; WIDTH]; 3]; HORIZON]; count],
            worth: vec![Worth::NONE; count],
            order: Vec::with_capacity(count * WIDTH),
            last: None,
            age: 0,
            next: None,
            planned_for: None,
            kept: Vec::with_capacity(WIDTH.max(RESCORED)),
            surrogate: None,
            spent: Spent::default(),
            seed: 0,
            tick: 0,
        }
    }

    /// Runs the iterations of a tick and returns the mean of the last distribution. `None` if too few returns are finite.
    fn search(&mut self, seen: &Observation, target: &Target) -> Option<Plan> {
        let mut rng = stream::stream(self.seed, &[self.tick]);
        self.tick += 1;
        let all = self.blocks.len();
        let fitted = self.settings.value == Value::Fitted && self.settings.alpha.is_some();
        self.surrogate = None;
        // an earlier search that failed may have left its best candidates
        self.kept.clear();
        let mut first = self.settings.proposals.div_ceil(WIDTH).min(all);
        self.sample_noise(&mut rng, [0, first]);
        self.fly(seen, target, Actions::Policy, [0, first]);
        let mut mean = match (self.settings.start, &self.last) {
            (Start::Policy, _) => self.candidate(0).plan,
            (Start::Last, Some(last)) => shifted(last),
            _ => [[0.0; 3]; HORIZON],
        };
        let mut spread = [[self.settings.spread; 3]; HORIZON];
        for _ in 0..self.settings.iterations {
            self.sample(&mut rng, first, &mean, &spread);
            for k in 0..self.kept.len() {
                let plan = self.kept[k];
                self.put(0, k, &plan);
            }
            if fitted && self.surrogate.is_none() {
                let surveyed = SURVEYED.div_ceil(WIDTH).clamp(first, all);
                self.fly(seen, target, Actions::Given, [first, surveyed]);
                self.surrogate = Surrogate::fit(&self.worth[..surveyed]);
                first = surveyed;
            }
            self.fly(seen, target, Actions::Given, [first, all]);
            (mean, spread, _) = self.refit(all)?;
            self.keep(self.settings.kept);
            first = 0;
        }
        if self.surrogate.take().is_some() {
            self.keep(RESCORED);
            for k in 0..self.kept.len() {
                let plan = self.kept[k];
                self.put(k / WIDTH, k % WIDTH, &plan);
            }
            let end = self.kept.len() / WIDTH;
            self.fly(seen, target, Actions::Given, [0, end]);
            (mean, _, _) = self.refit(end)?;
        }
        self.kept.clear();
        Some(mean)
    }

    /// Searches around the base controller's plan. Returns the best plan only if its return exceeds the base controller's by more
    /// than a threshold: `Settings::margin` plus the larger of the critics' disagreements about the two plans.
    fn search_around_base(
        &mut self,
        seen: &Observation,
        target: &Target,
        advised: Option<Plan>,
    ) -> Option<Plan> {
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
            if first == proposed && first < all {
                for (lane, plan) in [self.last.as_ref().map(shifted), advised].iter().enumerate() {
                    plan.iter().for_each(|plan| self.put(first, lane, plan));
                }
            }
            self.fly(seen, target, Actions::Given, [first, all]);
            let found;
            (mean, spread, found) = self.refit(all)?;
            if found.worth > best.worth {
                best = found;
            }
            first = 0;
        }
        // the mean of the distribution has less sampling noise than the best candidate
        self.put(0, 0, &mean);
        self.fly(seen, target, Actions::Given, [0, 1]);
        let middle = self.candidate(0);
        let chosen = if middle.worth >= best.worth { middle } else { best };
        let doubt = chosen.doubt.max(base.doubt) + self.settings.margin as f32;
        // a comparison with NaN is false: the base flies
        (chosen.worth - base.worth > doubt).then_some(chosen.plan)
    }

    /// The command planned at the previous tick for the present time, or a new command if there is no plan for this time.
    fn planned_before(&mut self, seen: &Observation, target: &Target) -> Command {
        let off = |time: Time| (time.as_secs_f64() - seen.time.as_secs_f64()).abs();
        if !self.planned_for.is_some_and(|time| off(time) < STEP / 2.0) {
            self.last = self.search(seen, target);
        }
        let Some(plan) = &self.last else { return LOST };
        let command = flown(&plan[0]);
        self.next = Some((self.after(seen, command), *target));
        command
    }

    /// The observation that the model predicts one tick after `seen` if `command` is flown.
    fn after(&self, seen: &Observation, command: Command) -> Observation {
        let figures = &self.model.airframe.actuators;
        let mut actuators = Actuators::from_observed(&seen.actuators, &seen.previous, figures);
        let mut inputs = self.model.at_rest(&actuators.controls());
        let controls = self.model.act(&actuators.controls(), &mut inputs);
        let mut memory = self.disturbance().map(Disturbance::memory).unwrap_or_default();
        let rate = self.disturbance().map_or(disturbance::NONE, Disturbance::rate);
        let state = self.model.step(&seen.state, &controls, seen.altitude, &mut memory);
        actuators.step(&command, figures);
        Observation {
            time: seen.time.plus(Duration::from_secs_f64(STEP)),
            state: state.advance(&rate, STEP),
            actuators: actuators.observed(figures),
            previous: [command, seen.previous[0]],
            ..*seen
        }
    }

    /// The base controller's command, or the command of the best plan if its return is sufficiently higher.
    fn over_base(&mut self, mut base: Base, seen: &Observation, target: &Target) -> Command {
        let begun = Instant::now();
        base.lqi.look_ahead(seen, target, &mut base.ahead);
        self.spent.prepare += begun.elapsed();
        let before = base.lqi.clone();
        let alone = base.lqi.command(seen, target);
        self.base = Some(base);
        // the base controller's throttle replaces the plan's
        let action = |[aileron, elevator]: [f64; 2]| [aileron, elevator, 0.0];
        if !self.is_trusted(seen) {
            self.last = None;
            return alone;
        }
        let advised = self.ilqr.as_mut().and_then(|ilqr| ilqr.plan(seen, target));
        self.last = self.search_around_base(seen, target, advised.map(|plan| plan.map(action)));
        match (self.last, &mut self.base) {
            (Some(plan), Some(base)) => {
                base.lqi.hand_over(&before, seen);
                Command { throttle: alone.throttle, rudder: alone.rudder, ..flown(&plan[0]) }
            }
            _ => alone,
        }
    }
}

/// Shifts a plan by one tick. Its last action is repeated.
fn shifted(plan: &Plan) -> Plan {
    std::array::from_fn(|h| plan[(h + 1).min(HORIZON - 1)])
}

/// The command of a planner without a plan. Its NaN makes the caller fly its fallback controller.
const LOST: Command =
    Command { aileron: f64::NAN, elevator: f64::NAN, throttle: f64::NAN, rudder: 0.0 };

/// The command that corresponds to an action. The rudder is neutral.
fn flown([aileron, elevator, thrust]: &Action) -> Command {
    let [aileron, elevator, thrust] = [*aileron, *elevator, *thrust];
    Command { aileron, elevator, throttle: (thrust + 1.0) / 2.0, rudder: 0.0 }.clamped()
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
        (self.last, self.age) = (None, 0);
        (self.next, self.planned_for) = (None, None);
        self.predictions = guard::predictions(&self.settings);
        if let Some(base) = &mut self.base {
            base.lqi.reset(seed);
        }
        if let Some(ilqr) = &mut self.ilqr {
            ilqr.reset(seed);
        }
    }

    fn overruled(&mut self, by: &Overruled) {
        // planning restarts from each observation, but the base controller's integrators must follow the flown command
        if let (None, Some(base)) = (&self.last, &mut self.base) {
            base.lqi.overruled(by);
        }
    }

    fn prepare(&mut self) {
        if let Some((seen, target)) = self.next.take() {
            self.spent = Spent::default();
            self.last = self.search(&seen, &target);
            self.planned_for = Some(seen.time);
        }
    }

    fn insight(&self, seen: &Observation) -> Option<Insight> {
        Some(self.last_insight(seen))
    }

    fn command(&mut self, seen: &Observation, target: &Target) -> Command {
        self.prepare();
        if self.base.is_some() || !self.settings.delay {
            self.spent = Spent::default();
        }
        let begun = Instant::now();
        if let Some(predictions) = &mut self.predictions {
            predictions.update(&self.model, seen);
        }
        self.spent.prepare = begun.elapsed();
        if let Some(base) = self.base.take() {
            return self.over_base(base, seen, target);
        }
        if self.agent.is_some() && !self.is_trusted(seen) {
            return self.unsearched(seen, target);
        }
        if self.settings.delay {
            return self.planned_before(seen, target);
        }
        self.age += 1;
        if self.last.is_none() || self.age >= self.settings.chunk {
            (self.last, self.age) = (self.search(seen, target), 0);
        }
        // NaN signals a failure: the caller then flies its fallback controller
        self.last.map_or(LOST, |plan| flown(&plan[self.age]))
    }
}

#[cfg(test)]
mod tests;
