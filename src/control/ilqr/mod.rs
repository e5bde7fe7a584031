//! iLQR: the plan over half a second that the model's exact derivatives lead to.
//!
//! Differential dynamic programming without second derivatives of the model (Todorov and Li, ACC 2005;
//! Tassa, Mansard and Todorov, ICRA 2014, for limited commands), one iteration a tick from the last plan,
//! which is the real-time iteration of Diehl et al. (2002). Throttle and the attitude that the airspeed
//! allows are the LQI's, and what the model leaves unexplained is taken into it: no steady error.

mod cost;
mod problem;
mod settings;
mod solve;

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

use problem::{Problem, Trajectory};
pub use settings::{Barrier, Settings, Start};
use solve::Solver;

/// Steps planned ahead.
const STEPS: usize = 50;

/// Aileron and elevator in units of the largest deflection.
type Surfaces = [f64; 2];

/// The planner. It takes no memory after it is built.
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
    desk: Desk,
}

impl Ilqr {
    /// A planner through `model`, beside the LQI that it is given.
    pub fn new(model: &GreyBox, lqi: Lqi) -> Ilqr {
        Ilqr::with("ilqr", model, lqi, None, Settings::PLAIN)
    }

    /// The same with other settings under a name of its own, and with a policy where there is one.
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
            desk: Desk { solver: Solver::new(), plan: None, flown: Trajectory::new() },
        }
    }

    /// The first `N` steps (50 at most) of this tick's plan, aileron and elevator; `None` if none stays finite.
    pub(crate) fn plan<const N: usize>(
        &mut self,
        seen: &Observation,
        target: &Target,
    ) -> Option<[Surfaces; N]> {
        self.command(seen, target);
        self.desk.plan.map(|plan| std::array::from_fn(|step| plan[step]))
    }
}

/// The warm start: solver, last plan and its trajectory, kept from tick to tick.
#[derive(Clone, Debug)]
struct Desk {
    solver: Solver,
    /// The plan of the last tick.
    plan: Option<[Surfaces; STEPS]>,
    flown: Trajectory,
}

/// What a tick may start from beside the last plan.
struct Starts<'a> {
    lqi: &'a Ahead,
    actor: Option<&'a Actor>,
    units: &'a mut Units<f32>,
    target: &'a Target,
}

impl Desk {
    /// The plan of this tick; `None` if no plan stays finite.
    fn improve(&mut self, problem: &Problem, starts: Starts) -> Option<[Surfaces; STEPS]> {
        let (mut start, mut cost) = problem.follow(starts.lqi, &mut self.flown);
        if let Some(last) = &self.plan {
            let mut shifted = *last;
            shifted.rotate_left(1);
            shifted[STEPS - 1] = shifted[STEPS - 2];
            let found = problem.fly(&shifted, self.solver.spare());
            // a comparison with what is no number is false
            if found < cost || !cost.is_finite() {
                (start, cost) = (shifted, found);
                self.solver.swap(&mut self.flown);
            }
        }
        if let Some(actor) = starts.actor {
            let Starts { units, target, .. } = starts;
            let (plan, found) = problem.follow_policy(actor, units, target, self.solver.spare());
            if found < cost || !cost.is_finite() {
                (start, cost) = (plan, found);
                self.solver.swap(&mut self.flown);
            }
        }
        if !cost.is_finite() {
            return None;
        }
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
    }

    fn overruled(&mut self, by: &Overruled) {
        // a plan begins anew from what is seen; the LQI has integrals
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
        self.lqi.look_ahead(seen, target, &mut self.ahead);
        let before = self.lqi.clone();
        let alone = self.lqi.command(seen, target);
        // a model that does not predict is no model to plan with
        if self.disturbance.is_wrong(TRUST) {
            self.desk.plan = None;
            return alone;
        }
        let problem = Problem {
            model: &self.model,
            seen,
            goal: self.lqi.goal(seen, target),
            throttle: alone.throttle,
            rudder: alone.rudder,
            memory: self.disturbance.memory(),
            disturbance: self.disturbance.rate(),
            settings: &self.settings,
            bounds: self.bounds,
        };
        let starts = Starts {
            lqi: &self.ahead,
            actor: self.actor.as_deref(),
            units: &mut self.units,
            target,
        };
        self.desk.plan = self.desk.improve(&problem, starts);
        match self.desk.plan {
            Some(plan) => {
                self.lqi.hand_over(&before, seen);
                let [aileron, elevator] = plan[0];
                Command { aileron, elevator, ..alone }.clamped()
            }
            None => alone,
        }
    }
}
