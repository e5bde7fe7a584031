//! Training of a dynamics model, section IV-A of \[GSFM26\] (T. Guerin et al., 2026, see `src/lib.rs`).
//!
//! The model is a prior, a physical model with coefficients, plus a residual, a neural network. A rollout simulates the
//! model from a recorded state and is compared with the recorded flight. [`Recipe`] has the settings.

mod reports;
mod stage;

pub use reports::Learned;
pub use reports::Moment;
pub use reports::Progress;
pub use reports::TrainError;

use crate::adam::Adam;
use crate::checkpoint::Checkpoint;
use crate::dynamics::basis::{self, Basis};
use crate::dynamics::engine::{Arithmetic, Engine};
use crate::dynamics::equation_error::{self, Weighting};
use crate::dynamics::loss::{Loss, Objective};
use crate::dynamics::network::Passes;
use crate::dynamics::projection;
use crate::dynamics::recipe::{Joint, Recipe, Start};
use crate::dynamics::rollout::{PriorSlopes, Subject};
use crate::dynamics::windows::{Track, regular};
use greylag_model::residual::{INPUTS, OUTPUTS, Scales, fingerprint, hash};
use greylag_model::{GreyBox, Residual};
use greylag_num::{Dense, stream};
use stage::Stage;

/// Largest number of samples that describe the range of the training data. The trained residual reports how far an input is
/// from this range.
const ENVELOPE_SAMPLES: usize = 40_000;

/// Largest number of consecutive failed updates. One more ends the training with [`TrainError::Diverged`].
const PATIENCE: u64 = 20;

/// Number of updates between two projections. A projection moves the part of the residual that the prior can represent into
/// the prior's coefficients.
const PROJECT_EVERY: u64 = 500;
/// Fraction of all updates up to which projections are made. After that the residual adapts to the final coefficients.
const PROJECT_UNTIL: f64 = 0.75;

/// Id of the random stream for the initial weights of the network.
const START: u64 = 1;

/// A training in progress.
pub struct Trainer {
    recipe: Recipe,
    tracks: Vec<Track>,
    data: String,
    prior: GreyBox,
    /// The prior with its initial coefficients.
    begun: GreyBox,
    basis: Basis,
    subject: Subject,
    engine: Engine,
    /// Coordinates η of the prior's coefficients, see [`Basis`].
    coordinates: Vec<f64>,
    adam: Adam,
    lambda: f64,
    update: u64,
    /// Number of failed updates since the last good one.
    failed: u64,
    /// Sections of the flights for rollouts of the present length.
    stage: Stage,
}

impl Trainer {
    /// A training of `prior` on `tracks` before its first update.
    ///
    /// # Errors
    ///
    /// If the recipe is invalid, a coefficient cannot be trained, the flights are too short, or the prior diverges on
    /// most rollouts.
    pub fn new(recipe: Recipe, prior: &GreyBox, tracks: Vec<Track>) -> Result<Trainer, TrainError> {
        if let Some(fault) = recipe.fault() {
            return Err(TrainError::Recipe(fault));
        }
        basis::check(prior)?;
        let mut prior = prior.clone();
        prior.residual = None;
        let basis = Basis::new(&prior, &recipe.trainable, &tracks)?;
        let sizes: Vec<usize> =
            [INPUTS].into_iter().chain(recipe.hidden.iter().copied()).chain([OUTPUTS]).collect();
        let network = Dense::silent(&sizes, &mut stream::stream(recipe.seed, &[START]))?;
        // invalid layer sizes are found here instead of after the training
        Residual::new(network.clone(), &prior.airframe, prior.scale())?;
        let mut subject = Subject {
            scales: Scales::new(&prior.airframe, prior.scale()),
            prior: prior.clone(),
            network: Passes::new(network),
            prior_slopes: if basis.is_empty() { PriorSlopes::None } else { PriorSlopes::All },
        };
        let coordinates = match recipe.start {
            Start::AsGiven => vec![0.0; basis.len()],
            Start::EquationError => equation_error::coordinates(&prior, &basis, &tracks),
        };
        let longest = recipe.steps.iter().copied().max().unwrap_or(1);
        let arithmetic = Arithmetic::Lanes;
        let engine = Engine::new(&subject, recipe.batch, longest, arithmetic);
        let count = subject.network.network().parameters().len();
        // The prediction loss is divided by the loss of the prior with these initial coefficients. The loss of the prior
        // as given may be much larger. With it as the divisor, the prediction loss would be negligible beside the penalty.
        basis.apply(&mut subject.prior, &coordinates);
        let begun = subject.prior.clone();
        let stage = Stage::new(&subject, &recipe, &tracks, recipe.steps_at(0))?;
        Ok(Trainer {
            data: crate::dynamics::windows::hash(&tracks),
            adam: Adam::new(count + basis.len()),
            coordinates,
            lambda: recipe.lambda,
            update: 0,
            failed: 0,
            recipe,
            tracks,
            prior,
            begun,
            basis,
            subject,
            engine,
            stage,
        })
    }

    /// Resumes from `checkpoint` of the same training. The result equals that of an uninterrupted training to the bit.
    ///
    /// # Errors
    ///
    /// If the checkpoint belongs to another recipe, prior or data.
    pub fn resume(&mut self, checkpoint: Checkpoint) -> Result<(), TrainError> {
        checkpoint.fits(&self.identity(), self.adam.mean.len(), self.coordinates.len())?;
        self.subject.network.update(|p| p.copy_from_slice(&checkpoint.network));
        self.coordinates = checkpoint.coordinates;
        self.basis.apply(&mut self.subject.prior, &self.coordinates);
        self.adam = checkpoint.adam;
        self.lambda = checkpoint.lambda;
        self.update = checkpoint.update;
        Ok(())
    }

    /// The present state of the training.
    pub fn checkpoint(&self) -> Checkpoint {
        Checkpoint {
            identity: self.identity(),
            network: self.subject.network.network().parameters().to_vec(),
            coordinates: self.coordinates.clone(),
            adam: self.adam.clone(),
            lambda: self.lambda,
            update: self.update,
        }
    }

    /// Hash of the recipe, the prior, its airframe and the data, which determine the result.
    fn identity(&self) -> String {
        let recipe = serde_json::to_string(&self.recipe).unwrap_or_default();
        let prior = format!(
            "{:?} {:?} {:?} {:?}",
            self.prior.coefficients(),
            self.prior.bare_body(),
            self.prior.integrator,
            self.prior.axes
        );
        let airframe = fingerprint(&self.prior.airframe);
        // a prior without tables and effect files adds nothing here, so its identity is that of earlier program versions
        let tables: String =
            self.prior.tables().map(|(id, table)| format!(" {id} {table:?}")).collect();
        let grid = self.prior.thrust_grid().map(|grid| format!(" {grid:?}")).unwrap_or_default();
        let air = self.prior.atmosphere;
        let written: String = self.prior.written().map(|own| format!(" {}", own.text)).collect();
        let data = &self.data;
        hash(
            format!("{recipe} {prior} {airframe} {air:?} {data}{tables}{grid}{written}").as_bytes(),
        )
    }

    /// Number of updates made.
    pub fn update(&self) -> u64 {
        self.update
    }

    /// Whether all updates are made.
    pub fn is_done(&self) -> bool {
        self.update >= self.recipe.updates
    }

    /// SHA-256 of the flights, hexadecimal.
    pub fn data(&self) -> &str {
        &self.data
    }

    /// Settings of the training.
    pub fn recipe(&self) -> &Recipe {
        &self.recipe
    }

    /// Names of the coefficients that the data cannot determine, or cannot separate from other coefficients.
    pub fn unseen(&self) -> &[String] {
        &self.basis.unseen
    }

    /// The trained coefficients, with their true values if `truth` is given and has them.
    pub fn coefficients(&self, truth: Option<&GreyBox>) -> Vec<Learned> {
        let (before, now) = (basis::values(&self.prior), basis::values(&self.subject.prior));
        let learned = |p: &usize| {
            let known = self.prior.coefficients().get(*p);
            let name = known.map_or(basis::JXZ.to_owned(), |c| c.name.clone());
            let truth = truth.and_then(|t| basis::value(t, &name));
            Learned { name, start: before[*p], value: now[*p], truth }
        };
        self.basis.places.iter().map(learned).collect()
    }

    /// State of the training after `progress`.
    pub fn moment(&self, progress: &Progress) -> Moment {
        Moment {
            update: progress.update,
            normalised: progress.normalised,
            ratio: progress.loss.learned / progress.loss.prior,
            lambda: progress.lambda,
            coefficients: self.coefficients(None).iter().map(|c| c.value).collect(),
        }
    }

    /// The present model.
    ///
    /// # Errors
    ///
    /// No error occurs for a network of this trainer.
    pub fn model(&self) -> Result<GreyBox, TrainError> {
        let mut model = self.subject.prior.clone();
        let network = self.subject.network.network().clone();
        let residual = Residual::new(network, &model.airframe, model.scale())?;
        let samples = self.tracks.iter().flat_map(|t| t.states.iter().zip(&t.controls));
        let flown = samples.filter(|(state, _)| regular(state));
        let total: usize = self.tracks.iter().map(|t| t.states.len()).sum();
        let every = total.div_ceil(ENVELOPE_SAMPLES).max(1);
        model.residual = Some(residual.trained_on(flown.step_by(every)));
        Ok(model)
    }

    /// Makes up to `count` updates and returns their progress: the number of updates so far and mean losses.
    ///
    /// # Errors
    ///
    /// If more than 20 consecutive updates fail, or the data is too short for a new rollout length.
    pub fn run(&mut self, count: u64) -> Result<Progress, TrainError> {
        let mut sum = Progress::default();
        let mut good = 0.0_f64;
        for _ in 0..count {
            if self.is_done() {
                break;
            }
            match self.one()? {
                Some((loss, normalised)) => {
                    self.failed = 0;
                    good += 1.0;
                    sum.loss.prediction += loss.prediction;
                    sum.loss.prior += loss.prior;
                    sum.loss.learned += loss.learned;
                    sum.loss.objective += loss.objective;
                    sum.loss.lost += loss.lost;
                    sum.normalised += normalised;
                }
                None => self.failed += 1,
            }
            if self.failed > PATIENCE {
                return Err(TrainError::Diverged { update: self.update });
            }
        }
        let part = 1.0 / good.max(1.0);
        let loss = Loss {
            prediction: sum.loss.prediction * part,
            prior: sum.loss.prior * part,
            learned: sum.loss.learned * part,
            objective: sum.loss.objective * part,
            lost: sum.loss.lost,
        };
        Ok(Progress {
            update: self.update,
            steps: self.stage.steps,
            loss,
            normalised: sum.normalised * part,
            lambda: self.lambda,
        })
    }

    /// If a projection is due, moves the part of the residual that the prior can represent into the prior's coefficients.
    fn project(&mut self) -> Result<(), TrainError> {
        let weighting = match self.recipe.joint {
            Joint::Gradient => return Ok(()),
            Joint::Projection => Weighting::Tukey,
            Joint::LeastSquares => Weighting::Alike,
        };
        let until = PROJECT_UNTIL * self.recipe.updates as f64;
        let due = self.update.is_multiple_of(PROJECT_EVERY) && self.update as f64 <= until;
        if !due || self.basis.is_empty() {
            return Ok(());
        }
        let prior = &self.subject.prior;
        let network = self.subject.network.network().clone();
        let residual = Residual::new(network, &prior.airframe, prior.scale())?;
        if let Some(step) = projection::step(prior, &residual, &self.basis, &self.tracks, weighting)
        {
            self.coordinates.iter_mut().zip(step).for_each(|(x, step)| *x += step);
            self.basis.apply(&mut self.subject.prior, &self.coordinates);
        }
        Ok(())
    }

    /// Makes one update. Returns the loss and the ratio L_pred/L_prior of the model's prediction loss to that of the prior.
    /// Returns `None` and changes no parameter if the gradient is not finite or more than half of the rollouts diverge.
    fn one(&mut self) -> Result<Option<(Loss, f64)>, TrainError> {
        let steps = self.recipe.steps_at(self.update);
        if steps != self.stage.steps {
            let mut bare = self.subject.clone();
            bare.prior = self.begun.clone();
            bare.network.update(|p| p.fill(0.0));
            self.stage = Stage::new(&bare, &self.recipe, &self.tracks, steps)?;
        }
        let unit = self.stage.prior_error;
        let chosen = self.stage.minibatch(&self.recipe, self.update);
        let objective = Objective {
            scale: self.recipe.criterion.scale(&self.prior),
            penalty: self.recipe.criterion.penalty(),
            unit,
            lambda: self.lambda,
        };
        let (loss, gradient) =
            self.engine.step(&self.subject, &objective, &self.tracks, chosen, steps);
        let pace = self.recipe.pace_at(self.update);
        let [rate, prior_rate] = [self.recipe.rate, self.recipe.prior_rate].map(|r| r * pace);
        self.update += 1;
        let slopes = self.basis.slopes(&gradient.prior);
        let mut every = gradient.network.iter().chain(&slopes);
        if loss.lost * 2 > chosen.len() || !every.all(|g| g.is_finite()) {
            return Ok(None);
        }
        let adam = &mut self.adam;
        adam.begin();
        self.subject.network.update(|parameters| {
            for (k, (p, g)) in parameters.iter_mut().zip(&gradient.network).enumerate() {
                *p += adam.move_of(k, *g, rate) as f32;
            }
        });
        let first = gradient.network.len();
        for (k, (x, g)) in self.coordinates.iter_mut().zip(&slopes).enumerate() {
            *x += adam.move_of(first + k, *g, prior_rate);
        }
        if !slopes.is_empty() {
            self.basis.apply(&mut self.subject.prior, &self.coordinates);
        }
        self.project()?;
        let normalised = loss.prediction / unit;
        self.lambda += self.recipe.tau * normalised;
        Ok(Some((loss, normalised)))
    }
}
