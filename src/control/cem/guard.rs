//! Conditions under which the CEM planner (cross-entropy method) may use the model. Its recent one-step predictions must be
//! accurate enough. Its residual, a learned correction of the physical model, must be near its training data.

use super::rollout::{Actions, HORIZON, WIDTH};
use super::{Cem, Settings, flown};
use crate::disturbance::{Disturbance, TIME_CONSTANT_S};
use crate::{Observation, Target};
use greylag_physics::Command;

/// The observer that estimates the disturbance and the model's prediction error. `None` if no setting needs it.
pub(super) fn predictions(settings: &Settings) -> Option<Disturbance> {
    settings.disturbance.or(settings.trust.map(|_| TIME_CONSTANT_S)).map(Disturbance::new)
}

impl Cem {
    /// The observer, if the plans are to include its disturbance estimate, else `None`.
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

    /// The command of the policy, without a search for a better one.
    pub(super) fn unsearched(&mut self, seen: &Observation, target: &Target) -> Command {
        (self.last, self.planned_for) = (None, None);
        // lane 0 of the SIMD block has no noise and holds the policy's own plan
        self.blocks[0] = [[[0.0; WIDTH]; 3]; HORIZON];
        self.fly(seen, target, Actions::Policy, [0, 1]);
        flown(&self.candidate(0).plan[0])
    }
}
