//! Conditions for planning with the model: its recent one-step predictions were accurate enough, and its residual does
//! not extrapolate.

use super::rollout::{Actions, HORIZON, WIDTH};
use super::{Cem, Settings, flown};
use crate::disturbance::{Disturbance, TIME_CONSTANT_S};
use crate::{Observation, Target};
use greylag_physics::Command;

/// The observer of the model's prediction errors. `None` if no setting needs it.
pub(super) fn predictions(settings: &Settings) -> Option<Disturbance> {
    settings.disturbance.or(settings.trust.map(|_| TIME_CONSTANT_S)).map(Disturbance::new)
}

impl Cem {
    /// The observer of the disturbance. `None` if the settings do not include the disturbance in the plans.
    pub(super) fn disturbance(&self) -> Option<&Disturbance> {
        self.predictions.as_ref().filter(|_| self.settings.disturbance.is_some())
    }

    /// Whether planning may use the model. The result is false in two cases: the prediction errors exceed `Settings::trust` and
    /// do not look like gusts, or the distance from the residual's training data exceeds `Settings::known`.
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
        // lane 0 has no noise and holds the policy's own plan
        self.blocks[0] = [[[0.0; WIDTH]; 3]; HORIZON];
        self.fly(seen, target, Actions::Policy, [0, 1]);
        flown(&self.candidate(0).plan[0])
    }
}
