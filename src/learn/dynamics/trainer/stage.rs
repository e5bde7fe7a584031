//! Data of a training stage, in which all rollouts have the same length.
//!
//! A rollout is a simulation from a recorded state. A window is the section of a recorded flight that a rollout is compared
//! with. The prior is the model without its network.

use rand::seq::SliceRandom;
use rayon::prelude::*;

use super::reports::TrainError;
use crate::dynamics::engine::{Arithmetic, Engine};
use crate::dynamics::loss::Objective;
use crate::dynamics::recipe::{Criterion, Recipe};
use crate::dynamics::rollout::Subject;
use crate::dynamics::score::off_after;
use crate::dynamics::windows::{Track, Window, windows};
use greylag_model::GreyBox;
use greylag_num::stream;

/// Largest number of windows from which the prior's loss, L_prior of eq. (23) of \[GSFM26\] (T. Guerin et al., 2026, see
/// `src/lib.rs`), is computed.
const PRIOR_WINDOWS: usize = 4096;
const SHUFFLE: u64 = 2;

/// State of a training stage with rollouts of `steps` steps.
pub(super) struct Stage {
    pub(super) steps: usize,
    /// Divisor of the prediction loss: the prior's loss L_prior, or 1 with [`Criterion::Plain`].
    pub(super) prior_error: f64,
    pub(super) all: Vec<Window>,
    /// Number of the epoch for which `order` was shuffled, from 0.
    pass: u64,
    order: Vec<Window>,
}

impl Stage {
    /// Collects all windows of `steps` steps in `tracks`, weights them and computes the loss of `bare`, the model without its
    /// network.
    pub(super) fn new(
        bare: &Subject,
        recipe: &Recipe,
        tracks: &[Track],
        steps: usize,
    ) -> Result<Stage, TrainError> {
        let mut all = windows(tracks, steps);
        if all.is_empty() {
            return Err(TrainError::Data(steps + 2));
        }
        if let Some(floor) = recipe.floor {
            weigh(&mut all, &bare.prior, tracks, steps, floor);
        }
        let some: Vec<Window> =
            all.iter().step_by(all.len().div_ceil(PRIOR_WINDOWS)).copied().collect();
        let arithmetic = Arithmetic::Lanes;
        let mut engine = Engine::new(bare, some.len(), steps, arithmetic);
        let objective = Objective {
            scale: recipe.criterion.scale(&bare.prior),
            penalty: recipe.criterion.penalty(),
            unit: 1.0,
            lambda: 1.0,
        };
        let loss = engine.loss(bare, &objective, tracks, &some, steps);
        if loss.lost * 2 > some.len() {
            return Err(TrainError::Prior(bare.prior.name.clone()));
        }
        let prior_error = match recipe.criterion {
            // a prior without error would make the divisor zero
            Criterion::Scaled => loss.prediction.max(1e-12),
            Criterion::Plain => 1.0,
        };
        Ok(Stage { steps, prior_error, all, pass: u64::MAX, order: Vec::new() })
    }

    /// The windows of update number `update`. Each epoch shuffles the windows anew.
    pub(super) fn minibatch(&mut self, recipe: &Recipe, update: u64) -> &[Window] {
        let batch = recipe.batch.min(self.all.len());
        let passes = (self.all.len() / batch) as u64;
        let (pass, place) = (update / passes, (update % passes) as usize);
        if pass != self.pass {
            self.pass = pass;
            self.order.clone_from(&self.all);
            let mut rng = stream::stream(recipe.seed, &[SHUFFLE, self.steps as u64, pass]);
            self.order.shuffle(&mut rng);
        }
        &self.order[place * batch..][..batch]
    }
}

/// Weights the windows `all` by the prior's errors, as [`Recipe::floor`] defines, and scales the weights to a mean of 1.
fn weigh(all: &mut [Window], model: &GreyBox, tracks: &[Track], steps: usize, floor: f64) {
    let mut weights: Vec<f64> =
        all.par_iter().map(|w| off_after(model, tracks, w, steps).powi(2)).collect();
    let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len() as f64;
    // a prior without error would make the divisor zero
    let unit = mean(&weights).max(f64::MIN_POSITIVE);
    weights.iter_mut().for_each(|w| *w = 1.0 / (*w / unit + floor * floor));
    let unit = mean(&weights);
    all.iter_mut().zip(weights).for_each(|(window, w)| window.weight = w / unit);
}
