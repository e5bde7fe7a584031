//! Training of the dynamics model, section IV-A of \[GSFM26\].

use rand::seq::SliceRandom;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::learn::adam::Adam;
use crate::learn::checkpoint::{Checkpoint, CheckpointError};
use crate::learn::dynamics::basis::{self, Basis, TrainableError};
use crate::learn::dynamics::engine::{Arithmetic, Engine};
use crate::learn::dynamics::equation_error::{self, Weighting};
use crate::learn::dynamics::loss::{Loss, Objective};
use crate::learn::dynamics::network::Passes;
use crate::learn::dynamics::projection;
use crate::learn::dynamics::recipe::{Criterion, Joint, Recipe, Start};
use crate::learn::dynamics::rollout::{PriorSlopes, Subject};
use crate::learn::dynamics::score::off_after;
use crate::learn::dynamics::windows::{Track, Window, regular, windows};
use crate::model::residual::{INPUTS, OUTPUTS, ResidualError, Scales, fingerprint, hash};
use crate::model::{GreyBox, Residual};
use crate::num::dense::DenseError;
use crate::num::{Dense, stream};

/// Windows over which the bare prior's error is taken, L_prior of eq. (23).
const PRIOR_WINDOWS: usize = 4096;

/// Samples that the envelope of the data is made from, at most.
const ENVELOPE_SAMPLES: usize = 40_000;

/// Updates in a row that may come to nothing before the training is given up.
const PATIENCE: u64 = 20;

/// Updates between two projections, and the part of all updates after which there are no more: the residual then
/// learns to leave out what has moved.
const PROJECT_EVERY: u64 = 500;
const PROJECT_UNTIL: f64 = 0.75;

/// Purposes of the random streams.
const START: u64 = 1;
const SHUFFLE: u64 = 2;

/// Why a training cannot begin or go on.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    /// The recipe makes no sense.
    #[error("the training's options: {0}")]
    Recipe(&'static str),
    /// A coefficient cannot be trained.
    #[error(transparent)]
    Trainable(#[from] TrainableError),
    /// The network cannot be made.
    #[error(transparent)]
    Network(#[from] DenseError),
    /// Prior and network do not fit.
    #[error(transparent)]
    Residual(#[from] ResidualError),
    /// There is too little data.
    #[error(
        "the flights have no stretch of {0} samples without a gap, which one rollout takes; give longer logs, or shorter rollouts"
    )]
    Data(usize),
    /// The bare prior cannot follow the flights at all.
    #[error(
        "model {0} leaves the numbers on most rollouts before anything is learned: it is no model of this aircraft, or the logs are of another"
    )]
    Prior(String),
    /// The loss has left the numbers.
    #[error(
        "the loss left the numbers at update {update}; what was learned before is kept in the last checkpoint: go on from it with a smaller learning rate"
    )]
    Diverged {
        /// The update.
        update: u64,
    },
    /// A checkpoint does not fit.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
}

/// How an update, or several, went.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Progress {
    /// Updates made.
    pub update: u64,
    /// Rollouts' length.
    pub steps: usize,
    /// Mean over the updates since the last report.
    pub loss: Loss,
    /// L_pred/L_prior, eq. (23), likewise.
    pub normalised: f64,
    /// λ.
    pub lambda: f64,
}

/// How a training stood at a moment, as its report shows it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Moment {
    /// Updates made.
    pub update: u64,
    /// L_pred/L_prior, eq. (23).
    pub normalised: f64,
    /// ‖F_a‖/‖F_p‖.
    pub ratio: f64,
    /// λ.
    pub lambda: f64,
    /// The trained coefficients, in the order of [`Trainer::coefficients`].
    pub coefficients: Vec<f64>,
}

/// A coefficient of the prior that was trained.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Learned {
    /// Full name.
    pub name: String,
    /// Value at the start.
    pub start: f64,
    /// Value now.
    pub value: f64,
    /// The true value, where it is known.
    pub truth: Option<f64>,
}

/// A training in progress.
pub struct Trainer {
    recipe: Recipe,
    tracks: Vec<Track>,
    data: String,
    prior: GreyBox,
    /// The prior with its coefficients as the training starts from.
    begun: GreyBox,
    basis: Basis,
    subject: Subject,
    engine: Engine,
    /// η, the prior's coordinates.
    coordinates: Vec<f64>,
    adam: Adam,
    lambda: f64,
    update: u64,
    /// Rollouts of the present length, in the order of the present pass over the data.
    stage: Stage,
}

/// What holds while the rollouts have one length.
struct Stage {
    steps: usize,
    /// L_prior.
    prior_error: f64,
    all: Vec<Window>,
    /// The pass over the data for which `order` was shuffled.
    pass: u64,
    order: Vec<Window>,
}

impl Trainer {
    /// A training of `prior` on `tracks` that has not begun.
    ///
    /// # Errors
    /// If recipe, prior and data do not fit.
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
        // what the residual has to learn is what this prior leaves, which may be much less than the
        // prior as given: measured by that one, all of it would be less than the penalty
        basis.apply(&mut subject.prior, &coordinates);
        let begun = subject.prior.clone();
        let stage = Stage::new(&subject, &recipe, &tracks, recipe.steps_at(0))?;
        Ok(Trainer {
            data: crate::learn::dynamics::windows::hash(&tracks),
            adam: Adam::new(count + basis.len()),
            coordinates,
            lambda: recipe.lambda,
            update: 0,
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

    /// Goes on from `checkpoint` of the same training: what comes is the same to the bit as without
    /// the interruption.
    ///
    /// # Errors
    /// If it is of another recipe, prior or data.
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

    /// Where the training stands.
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

    /// Hash of all that decides the result.
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
        hash(format!("{recipe} {prior} {airframe} {}", self.data).as_bytes())
    }

    /// Updates made.
    pub fn update(&self) -> u64 {
        self.update
    }

    /// Whether all updates are made.
    pub fn is_done(&self) -> bool {
        self.update >= self.recipe.updates
    }

    /// SHA-256 of the data, hexadecimal.
    pub fn data(&self) -> &str {
        &self.data
    }

    /// The recipe.
    pub fn recipe(&self) -> &Recipe {
        &self.recipe
    }

    /// Coefficients that were to be trained and that the data does not see: they stay.
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

    /// How the training stands after `progress`.
    pub fn moment(&self, progress: &Progress) -> Moment {
        Moment {
            update: progress.update,
            normalised: progress.normalised,
            ratio: progress.loss.learned / progress.loss.prior,
            lambda: progress.lambda,
            coefficients: self.coefficients(None).iter().map(|c| c.value).collect(),
        }
    }

    /// The model as it is now.
    ///
    /// # Errors
    /// Not for a network that was trained here.
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

    /// Makes up to `count` updates; the means over them.
    ///
    /// # Errors
    /// If the loss leaves the numbers.
    pub fn run(&mut self, count: u64) -> Result<Progress, TrainError> {
        let mut sum = Progress::default();
        let (mut made, mut failed) = (0.0_f64, 0);
        while made < count as f64 && !self.is_done() {
            match self.one()? {
                Some((loss, normalised)) => {
                    failed = 0;
                    sum.loss.prediction += loss.prediction;
                    sum.loss.prior += loss.prior;
                    sum.loss.learned += loss.learned;
                    sum.loss.objective += loss.objective;
                    sum.loss.lost += loss.lost;
                    sum.normalised += normalised;
                }
                None => failed += 1,
            }
            if failed > PATIENCE {
                return Err(TrainError::Diverged { update: self.update });
            }
            made += 1.0;
        }
        let part = 1.0 / made.max(1.0);
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

    /// Moves what of the residual the prior can say into its coefficients, where it is time for that.
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

    /// One update; `None` if it came to nothing, its gradient being no number.
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

impl Stage {
    /// The rollouts of `steps` steps, and how far `bare`, the prior alone, is off on them.
    fn new(
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
            // a prior without any error has nothing to be measured by
            Criterion::Scaled => loss.prediction.max(1e-12),
            Criterion::Plain => 1.0,
        };
        Ok(Stage { steps, prior_error, all, pass: u64::MAX, order: Vec::new() })
    }

    /// The rollouts of an update: each pass over the data shuffles it anew.
    fn minibatch(&mut self, recipe: &Recipe, update: u64) -> &[Window] {
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

/// Weighs `all` as [`Recipe::floor`] says; the mean of the weights is 1.
fn weigh(all: &mut [Window], model: &GreyBox, tracks: &[Track], steps: usize, floor: f64) {
    let mut weights: Vec<f64> =
        all.par_iter().map(|w| off_after(model, tracks, w, steps).powi(2)).collect();
    let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len() as f64;
    // a prior without any error has nothing to be measured by
    let unit = mean(&weights).max(f64::MIN_POSITIVE);
    weights.iter_mut().for_each(|w| *w = 1.0 / (*w / unit + floor * floor));
    let unit = mean(&weights);
    all.iter_mut().zip(weights).for_each(|(window, w)| window.weight = w / unit);
}
