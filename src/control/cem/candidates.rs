//! Data for the display of the planner's last search: the attitudes along a sample of the candidate plans, simulated with
//! the model. The base controller is the LQI that flies where no plan is better; a planner may have none.

use super::rollout::{HORIZON, WIDTH, slewed};
use super::{Cem, Plan, flown};
use crate::Observation;
use crate::insight::{Insight, Path};
use greylag_model::STEP;
use greylag_physics::Command;
use greylag_physics::actuators::Actuators;

/// Number of candidates kept for the display, evenly spaced over all candidates.
const SHOWN: usize = 48;

impl Cem {
    /// Returns the simulated paths of a sample of the candidates and of the chosen plan. `seen` is the observation from which
    /// they were planned. The function integrates several thousand steps and allocates memory, so it is not for use in flight.
    pub(super) fn last_insight(&self, seen: &Observation) -> Insight {
        let all = self.blocks.len() * WIDTH;
        let every = all.div_ceil(SHOWN).max(1);
        let plans = (0..all).step_by(every).map(|index| self.candidate(index).plan);
        Insight {
            candidates: plans.map(|plan| self.path(seen, Some(&plan))).collect(),
            chosen: self.path(seen, self.last.as_ref()),
            searched: self.last.is_some(),
            phases: self.spent.phases(),
        }
    }

    /// Roll and pitch (rad) at every step along `plan`. The base controller, if there is one, flies the steps after the end of
    /// the plan, and all steps if `plan` is `None`.
    fn path(&self, seen: &Observation, plan: Option<&Plan>) -> Path {
        let model = &self.model;
        let figures = &model.airframe.actuators;
        let ahead = self.base.as_ref().map(|base| &base.ahead);
        let mut actuators = Actuators::from_observed(&seen.actuators, &seen.previous, figures);
        let mut state = seen.state;
        let mut previous = seen.previous;
        let mut memory = self.disturbance().map(|d| d.memory()).unwrap_or_default();
        let rate = self.disturbance().map(|d| d.rate());
        let mut inputs = model.at_rest(&actuators.controls());
        let mut reference = ahead.map_or([0.0; 2], |ahead| ahead.reference());
        let steps = ahead.map_or(HORIZON, |ahead| ahead.steps());
        let mut path = vec![[state.roll, state.pitch]];
        for step in 0..steps {
            let planned = plan.filter(|_| step < HORIZON).map(|plan| flown(&plan[step]));
            if step == HORIZON && plan.is_some() {
                reference = [state.roll, state.pitch];
            }
            let behind = ahead.map(|ahead| {
                let z = actuators.observed(figures);
                ahead.command(step, &mut reference, &state, &z, &previous)
            });
            let command = match (planned, behind) {
                (Some(c), Some(base)) => {
                    Command { throttle: base.throttle, rudder: base.rudder, ..c }
                }
                (Some(c), None) | (None, Some(c)) => c,
                (None, None) => break,
            };
            let command = match ahead {
                Some(_) => slewed(command, &previous[0], &model.airframe),
                None => command,
            };
            let controls = model.act(&actuators.controls(), &mut inputs);
            state = model.step(&state, &controls, seen.altitude, &mut memory);
            if let Some(rate) = &rate {
                state = state.advance(rate, STEP);
            }
            actuators.step(&command, figures);
            previous = [command, previous[0]];
            path.push([state.roll, state.pitch]);
        }
        path
    }
}
