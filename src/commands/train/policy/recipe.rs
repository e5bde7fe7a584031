//! Converts the options of `greylag train policy` into recipes. A recipe holds all settings of a training.

use super::{Arguments, Place};
use crate::learn::{AnalyticRecipe, Hyperparameters, PolicyRecipe, ValuationRecipe};

impl Arguments {
    pub(super) fn recipe(&self, seed: u64) -> PolicyRecipe {
        PolicyRecipe {
            td3: Hyperparameters {
                actor: self.actor.clone(),
                critic: self.critic.clone(),
                discount: self.discount,
                tau: self.tau,
                actor_rate: self.rate,
                critic_rate: self.rate,
                smoothing: self.smoothing,
                exploration: self.exploration,
                batch: self.batch as usize,
                ..Hyperparameters::default()
            },
            steps: self.steps,
            warmup: self.warmup,
            replay: self.replay as usize,
            instances: if matches!(self.environment, Place::Simulator) {
                1
            } else {
                self.instances as usize
            },
            corners: self.corners,
            checkpoint: self.checkpoint,
            seed,
        }
    }

    pub(super) fn analytic(&self, seed: u64) -> AnalyticRecipe {
        AnalyticRecipe {
            actor: self.actor.clone(),
            instances: self.gradient_batch as usize,
            window: self.window as usize,
            updates: self.updates,
            rate: self.climb,
            effort: self.effort,
            rounding: self.rounding,
            corners: self.corners,
            draws: self.draws,
            seed,
            ..AnalyticRecipe::default()
        }
    }

    pub(super) fn valuation(&self, seed: u64) -> ValuationRecipe {
        ValuationRecipe {
            critic: self.critic.clone(),
            updates: self.valuation,
            instances: self.instances as usize,
            discount: self.discount,
            seed,
            ..ValuationRecipe::default()
        }
    }
}
