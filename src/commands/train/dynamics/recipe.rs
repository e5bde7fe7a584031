//! All settings (the recipe) of the training of a dynamics model, from the options of the command.

use super::{Arguments, Joint};
use crate::learn::{Criterion, Recipe, Start, trainable};
use crate::model::{GreyBox, STEP};

/// Number of model steps in a training rollout (a simulation from a measured state) if a log's sample time exceeds the model's
/// time step. Such logs are interpolated between their samples, and training on short rollouts would fit the interpolation.
const SLOW_STEPS: usize = 200;

impl Arguments {
    pub(super) fn recipe(&self, prior: &GreyBox, slowest_s: f64) -> Recipe {
        let wide = |name: &String| {
            let found = prior.coefficients().iter().find(|c| c.name == *name);
            found.is_none_or(|c| c.width() > 0.0)
        };
        let narrow = self.flights.is_logs_alone() && !self.from_scratch;
        let names = match self.trainable.as_slice() {
            [all] if all == "all" => {
                trainable(prior).into_iter().filter(|name| !narrow || wide(name)).collect()
            }
            names => names.to_vec(),
        };
        let start = match self.start.as_str() {
            "as-given" => Start::AsGiven,
            _ => Start::EquationError,
        };
        Recipe {
            hidden: self.hidden.clone(),
            steps: match self.steps.as_slice() {
                [] if slowest_s > 1.001 * STEP => vec![SLOW_STEPS],
                [] => Recipe::default().steps,
                steps => steps.to_vec(),
            },
            batch: self.batch,
            updates: self.updates,
            rate: self.rate,
            prior_rate: self.prior_rate.unwrap_or(match (start, self.joint) {
                (Start::AsGiven, Joint::Gradient) => 3e-3,
                _ => 0.0,
            }),
            start,
            joint: self.joint.into(),
            lambda: self.lambda,
            tau: self.tau,
            criterion: if self.loss == "plain" { Criterion::Plain } else { Criterion::Scaled },
            floor: match self.floor {
                None if self.loss == "plain" => None,
                None => Recipe::default().floor,
                Some(floor) => Some(floor).filter(|f| *f != f64::INFINITY),
            },
            trainable: names,
            seed: self.seed,
            ..Recipe::default()
        }
    }
}
