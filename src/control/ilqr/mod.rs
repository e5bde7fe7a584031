//! iLQR: a planner that optimises aileron and elevator over the next half second with exact derivatives of the model.
//!
//! The method is differential dynamic programming without second derivatives of the model (Todorov and Li, ACC 2005; Tassa,
//! Mansard and Todorov, ICRA 2014, for limited commands). Each tick (control cycle of 10 ms) improves the plan of the last
//! tick by one iteration, as in the real-time iteration of Diehl et al. (2002). The LQI provides throttle and rudder and
//! limits the target attitude. The prediction includes the disturbance estimate. The steady-state error is therefore zero.

mod cost;
mod course;
mod forecast;
mod problem;
mod settings;
mod solve;
mod transition;

use crate::authority::Authority;
use crate::disturbance::{Disturbance, TIME_CONSTANT_S, TRUST};
use crate::envelope::Bounds;
use crate::insight::{Insight, Path};
use crate::lqi::{Ahead, Lqi};
use crate::policy::{Actor, Agent};
use crate::{Controller, Observation, Overruled, Target};
use greylag_model::GreyBox;
use greylag_num::dense::Units;
use greylag_physics::Command;
use std::sync::Arc;

use course::{Approach, Course};
use forecast::Forecast;
use problem::{Problem, Trajectory};
pub use settings::{Barrier, Settings, Start, Towards};
use solve::Solver;

/// Horizon in steps of 10 ms.
const STEPS: usize = 50;

/// Number of ticks for which the LQI flies after a wrong prediction. This time is longer than the averaging time of the
/// prediction check. Otherwise, a model that is wrong intermittently would be used between its wrong predictions.
const WAIT: usize = 500;

/// Number of ticks between two simulations of the LQI's commands, which are a possible starting point of the plan. Without
/// these simulations, 18 instead of 10 % of the attitude steps with 40 ms of delay overshoot. A simulation at every tick
/// would take one sixth of the controller's computing time.
const EVERY: usize = 5;

/// Aileron and elevator commands as fractions of the largest deflection.
type Surfaces = [f64; 2];

/// The iLQR planner. It allocates only when it is built.
#[derive(Clone, Debug)]
pub struct Ilqr {
    name: &'static str,
    settings: Settings,
    bounds: Option<Bounds>,
    actor: Option<Arc<Actor>>,
    units: Units<f32>,
    model: GreyBox,
    lqi: Lqi,
    ahead: Ahead,
    disturbance: Disturbance,
    approach: Option<Approach>,
    course: Course,
    forecast: Forecast,
    /// Number of further ticks for which the LQI flies.
    waiting: usize,
    desk: Desk,
}

impl Ilqr {
    /// A planner with `model`. The commands of `lqi` are a starting point of the plans. If there is no plan, `lqi` flies.
    pub fn new(model: &GreyBox, lqi: Lqi) -> Ilqr {
        Ilqr::with("ilqr", model, lqi, None, Settings::PLAIN)
    }

    /// A planner with `settings` and the controller name `name`. With `Start::Policy`, the commands of `agent`'s policy are
    /// a further starting point.
    pub fn with(
        name: &'static str,
        model: &GreyBox,
        lqi: Lqi,
        agent: Option<&Agent>,
        settings: Settings,
    ) -> Ilqr {
        let bounds = Bounds::of(&model.airframe);
        Ilqr {
            name,
            settings,
            bounds: settings.envelope.map(|barrier| bounds.within(barrier.part)),
            actor: agent.filter(|_| settings.start == Start::Policy).map(|a| a.actor.clone()),
            units: Units::new(0.0),
            model: model.clone(),
            lqi,
            ahead: Ahead::new(STEPS, &model.airframe),
            disturbance: Disturbance::new(TIME_CONSTANT_S),
            approach: approach(model, settings.towards),
            course: Course::new(),
            forecast: Forecast::new(),
            waiting: 0,
            desk: Desk {
                solver: Solver::new(),
                plan: None,
                target: None,
                until_lqi: 0,
                flown: Trajectory::new(),
            },
        }
    }

    /// Runs a tick and returns the aileron and elevator commands of the first `N` steps (at most 50) of its plan. `None` if
    /// every plan has an infinite or undefined cost, and while the LQI flies after a wrong prediction.
    pub(crate) fn plan<const N: usize>(
        &mut self,
        seen: &Observation,
        target: &Target,
    ) -> Option<[Surfaces; N]> {
        self.command(seen, target);
        self.desk.plan.map(|plan| std::array::from_fn(|step| plan[step]))
    }
}

/// Limits and gains of the path on which the aircraft approaches a target. `None` if the plan follows the target itself.
/// Also `None` if the model cannot be trimmed at cruise or positive aileron does not roll it to the right.
fn approach(model: &GreyBox, towards: Towards) -> Option<Approach> {
    match towards {
        Towards::Target => None,
        Towards::Path => Some(Approach::of(model, Authority::roll_rate(model)?)),
    }
}

/// Data that are kept between ticks for the warm start: solver, last plan and its trajectory.
#[derive(Clone, Debug)]
struct Desk {
    solver: Solver,
    /// The last tick's plan.
    plan: Option<[Surfaces; STEPS]>,
    /// The last tick's target.
    target: Option<Target>,
    /// Number of ticks until the LQI's commands are simulated again as a starting point.
    until_lqi: usize,
    flown: Trajectory,
}

/// Sources of this tick's starting points in addition to the last plan.
struct Starts<'a> {
    /// The LQI with its state before this tick's command.
    lqi: &'a Lqi,
    /// Memory for the LQI's control laws over the steps of the plan.
    ahead: &'a mut Ahead,
    actor: Option<&'a Actor>,
    units: &'a mut Units<f32>,
    target: &'a Target,
}

impl Desk {
    /// Returns the starting plan of lowest cost, with this cost. Its trajectory is stored in `flown`. The candidates are the
    /// last plan shifted by a step, the LQI's commands in a simulation (every [`EVERY`] ticks and for a new target) and the
    /// policy's commands in a simulation (for a new target). `None` if no candidate has a finite cost.
    fn begin(&mut self, problem: &Problem, starts: Starts) -> Option<([Surfaces; STEPS], f64)> {
        let mut best = None;
        if let Some(last) = &self.plan {
            let mut shifted = *last;
            shifted.rotate_left(1);
            shifted[STEPS - 1] = shifted[STEPS - 2];
            let cost = problem.fly(&shifted, &mut self.flown);
            best = cost.is_finite().then_some((shifted, cost));
        }
        let new = best.is_none() || self.target != Some(*starts.target);
        self.target = Some(*starts.target);
        self.until_lqi = if new { 0 } else { self.until_lqi.saturating_sub(1) };
        if self.until_lqi > 0 {
            return best;
        }
        self.until_lqi = EVERY;
        let Starts { lqi, ahead, actor, units, target } = starts;
        let mut compete = |desk: &mut Desk, (plan, cost): ([Surfaces; STEPS], f64)| {
            if cost.is_finite() && best.is_none_or(|(_, least)| cost < least) {
                best = Some((plan, cost));
                desk.solver.swap(&mut desk.flown);
            }
        };
        lqi.look_ahead(problem.seen, target, ahead);
        let found = problem.follow(ahead, self.solver.spare());
        compete(self, found);
        if let Some(actor) = actor.filter(|_| new) {
            let found = problem.follow_policy(actor, units, target, self.solver.spare());
            compete(self, found);
        }
        best
    }

    /// Runs this tick's iterations and returns the plan. `None` if no starting plan has a finite cost.
    fn improve(&mut self, problem: &Problem, starts: Starts) -> Option<[Surfaces; STEPS]> {
        let (mut start, mut cost) = self.begin(problem, starts)?;
        for _ in 0..problem.settings.iterations {
            (start, cost) = self.solver.iterate(problem, start, cost, &mut self.flown);
        }
        Some(start)
    }
}

impl Controller for Ilqr {
    fn name(&self) -> &'static str {
        self.name
    }

    fn boxed_clone(&self) -> Box<dyn Controller> {
        Box::new(self.clone())
    }

    fn reset(&mut self, seed: u64) {
        self.lqi.reset(seed);
        self.disturbance = Disturbance::new(TIME_CONSTANT_S);
        self.desk.plan = None;
        self.course.reset();
        self.forecast.forget();
        self.waiting = 0;
    }

    fn overruled(&mut self, by: &Overruled) {
        // a plan has no integrators. The LQI has integrators, and they are corrected only while its commands are flown
        if self.desk.plan.is_none() {
            self.lqi.overruled(by);
        }
    }

    fn insight(&self, _seen: &Observation) -> Option<Insight> {
        let path: Path = self.desk.flown.states().map(|s| [s.roll, s.pitch]).collect();
        Some(Insight {
            candidates: Vec::new(),
            chosen: path,
            searched: self.desk.plan.is_some(),
            phases: Vec::new(),
        })
    }

    fn command(&mut self, seen: &Observation, target: &Target) -> Command {
        self.disturbance.update(&self.model, seen);
        let before = self.lqi.clone();
        let alone = self.lqi.command(seen, target);
        // planning must not use a model whose predictions are wrong
        let missed = self.forecast.error(&seen.state, target);
        let too_far = self.settings.missed.zip(missed).is_some_and(|(most, error)| error > most);
        if self.disturbance.is_wrong(TRUST) || too_far {
            self.waiting = WAIT;
        }
        if self.waiting > 0 {
            self.waiting -= 1;
            self.desk.plan = None;
            self.course.reset();
            self.forecast.forget();
            return alone;
        }
        let goal = self.lqi.goal(seen, target);
        match (&self.approach, &self.bounds) {
            (Some(approach), Some(bounds)) => {
                self.course.towards(&seen.state, goal.attitude, bounds.load, approach);
            }
            _ => self.course.stay(goal.attitude),
        }
        let problem = Problem {
            model: &self.model,
            seen,
            goal,
            course: &self.course,
            approach: self.approach.as_ref(),
            throttle: alone.throttle,
            rudder: alone.rudder,
            memory: self.disturbance.memory(),
            disturbance: self.disturbance.rate(),
            settings: &self.settings,
            bounds: self.bounds,
        };
        let starts = Starts {
            lqi: &before,
            ahead: &mut self.ahead,
            actor: self.actor.as_deref(),
            units: &mut self.units,
            target,
        };
        self.desk.plan = self.desk.improve(&problem, starts);
        match self.desk.plan {
            Some(plan) => {
                if let Some(after) = self.desk.flown.states().nth(forecast::SPAN) {
                    self.forecast.note(after, target);
                }
                self.lqi.hand_over(&before, seen);
                let [aileron, elevator] = plan[0];
                Command { aileron, elevator, ..alone }.clamped()
            }
            None => alone,
        }
    }
}
