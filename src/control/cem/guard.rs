//! Conditions for planning: the model's recent one-step predictions were good enough, and its residual is not
//! extrapolating.

use super::rollout::{Actions, HORIZON, WIDTH};
use super::{Cem, Settings, flown};
use crate::disturbance::{Disturbance, TIME_CONSTANT_S};
use crate::{Observation, Target};
use greylag_physics::Command;

/// The observer of the model's prediction errors, if the settings ask for one.
pub(super) fn predictions(settings: &Settings) -> Option<Disturbance> {
    settings.disturbance.or(settings.trust.map(|_| TIME_CONSTANT_S)).map(Disturbance::new)
}

impl Cem {
    /// The estimated disturbance, where the settings include it in the plans.
    pub(super) fn disturbance(&self) -> Option<&Disturbance> {
        self.predictions.as_ref().filter(|_| self.settings.disturbance.is_some())
    }

    /// Whether the model may be planned with: its predictions over the last half second were good enough, gusts
    /// aside, and its residual is within its training data.
    pub(super) fn is_trusted(&self, seen: &Observation) -> bool {
        let predicted = match (self.settings.trust, &self.predictions) {
            (Some(most), Some(predictions)) => !predictions.is_wrong(most),
            _ => true,
        };
        let known = match (self.settings.known, &self.model.residual) {
            (Some(most), Some(residual)) => {
                residual.distance(&seen.state, &seen.actuators.controls()) <= most
            }
            _ => true,
        };
        predicted && known
    }

    /// The policy's own command, without a search.
    pub(super) fn unsearched(&mut self, seen: &Observation, target: &Target) -> Command {
        (self.last, self.planned_for) = (None, None);
        // the first lane has no noise: it is the policy's own plan
        self.blocks[0] = [[[0.0; WIDTH]; 3]; HORIZON];
        self.fly(seen, target, Actions::Policy, [0, 1]);
        flown(&self.candidate(0).plan[0])
    }
}
