//! The training of one policy: its loop, its learning curve, its files.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use anyhow::{Context, Result, anyhow};
use serde::Serialize;

use super::ground::Ground;
use crate::commands::files::{self, Overwrite};
use crate::commands::interruption::Interruption;
use crate::commands::train::analytic;
use crate::control::policy::{Actor, Agent, Critic, Evaluated, Origin};
use crate::learn::policy::learning_curve::{CURVE, CurveFile, CurvePoint};
use crate::learn::{
    AnalyticRecipe, PolicyProgress, PolicyRecipe, PolicyStanding, PolicyTrainer, ValuationRecipe,
    write_whole,
};
use crate::model::GreyBox;
use crate::model::residual::hash;
use crate::sim::imagined::Imagination;
use crate::sim::world::World;

/// File from which a training is resumed.
const CHECKPOINT: &str = "checkpoint.safetensors";
/// Largest fraction of lost episodes without a warning. An episode is lost when the state leaves the limits of validity.
const MANY: f64 = 0.2;

/// Record of a training, written into the folder of its learning curve.
#[derive(Serialize)]
struct Document<'a> {
    schema: &'static str,
    program: &'static str,
    command_line: String,
    method: &'a Method<'a>,
    best: &'a Origin,
}

/// Training method of a policy with its settings.
#[derive(Serialize)]
#[serde(rename_all = "snake_case")]
enum Method<'a> {
    Td3(&'a PolicyRecipe),
    Analytic { climb: &'a AnalyticRecipe, valuation: &'a ValuationRecipe },
}

/// The training of one policy.
pub(super) struct Run<'a> {
    pub(super) folder: PathBuf,
    pub(super) seed: u64,
    pub(super) evaluate: u64,
    pub(super) ground: &'a Ground,
    pub(super) stop: &'a Interruption,
}

impl Run<'_> {
    /// Trains an actor by the analytic policy gradient, then fits critics to it. Returns `false` if interrupted.
    pub(super) fn climb(
        &self,
        recipe: &AnalyticRecipe,
        from: Option<&Actor>,
        valuation: ValuationRecipe,
        model: &GreyBox,
        world: Imagination,
    ) -> Result<bool> {
        let judge = |actor| self.ground.evaluate(actor);
        let Some(actor) = analytic::climb(recipe, from, model, &self.folder, &judge, self.stop)?
        else {
            return Ok(false);
        };
        let method = Method::Analytic { climb: recipe, valuation: &valuation.clone() };
        let Some(critics) = analytic::value(valuation, &actor, world, self.stop)? else {
            return Ok(false);
        };
        let steps = recipe.updates * (recipe.window * recipe.instances) as u64;
        let evaluated = self.ground.evaluate(actor.clone())?;
        self.save(&method, actor, critics.into(), steps, evaluated)?;
        println!("{:>8} policy in {}", self.seed, self.folder.display());
        Ok(true)
    }

    pub(super) fn train<W: World>(&self, recipe: PolicyRecipe, world: W) -> Result<bool> {
        // The number of steps is not part of the identity, so that a checkpoint can be continued with more steps.
        let of = PolicyRecipe { steps: 0, ..recipe.clone() };
        let of = (of, &self.ground.origin.model_sha256);
        let what = serde_json::to_string(&of)?;
        let mut trainer = PolicyTrainer::new(recipe, world, hash(what.as_bytes()))?;
        let kept = self.folder.join(CHECKPOINT);
        if kept.exists() {
            let standing = PolicyStanding::load(&kept)?;
            trainer
                .resume(standing)
                .with_context(|| format!("going on from {}", kept.display()))?;
            eprintln!("seed {}: going on after {} steps", self.seed, trainer.steps());
        }
        let path = self.folder.join(CURVE);
        let context = || format!("cannot write {}", path.display());
        let mut curve = CurveFile::open(&path, trainer.steps())
            .with_context(|| format!("cannot open {}", path.display()))?;
        let (mut best, before) = (curve.best(), curve.seconds());
        let start = Instant::now();
        let (first, goal) = (trainer.steps(), trainer.recipe().steps);
        while trainer.steps() < goal {
            let progress = trainer.run(self.evaluate).with_context(|| match kept.exists() {
                true => format!("seed {}: the last good state is in {}", self.seed, kept.display()),
                false => format!("seed {}: no checkpoint was written yet", self.seed),
            })?;
            let seconds = start.elapsed().as_secs_f64();
            let evaluated = self.ground.evaluate(trainer.actor())?;
            let made = (progress.steps - first) as f64;
            let left = seconds / made * goal.saturating_sub(progress.steps) as f64;
            let point = CurvePoint {
                steps: progress.steps,
                updates: progress.updates,
                seconds: before + seconds,
                loss: progress.loss,
                reward: progress.reward,
                episodes: progress.episodes,
                lost: progress.lost,
                ..reached(evaluated)
            };
            curve.add(point).with_context(context)?;
            println!("{:>8} {}  {:.0} min left", self.seed, point.line(), left / 60.0);
            warn(self.seed, &progress);
            if point.badness() <= best {
                best = point.badness();
                let method = Method::Td3(trainer.recipe());
                let (actor, critics) = (trainer.actor(), trainer.critics()?);
                self.save(&method, actor, critics, progress.steps, evaluated)?;
            }
            if trainer.at_checkpoint() {
                trainer.standing().save(&kept)?;
            }
            if self.stop.is_set() && trainer.steps() < goal {
                return Ok(false);
            }
        }
        println!("{:>8} policy in {}", self.seed, self.folder.display());
        Ok(true)
    }

    /// Writes the policy's files and the record of its training. Replaces those of earlier policies of this run.
    fn save(
        &self,
        method: &Method,
        actor: Arc<Actor>,
        critics: Arc<[Critic; 2]>,
        steps: u64,
        evaluated: Evaluated,
    ) -> Result<()> {
        let evaluation = Some(evaluated);
        let origin = Origin { seed: self.seed, steps, evaluation, ..self.ground.origin.clone() };
        let agent = Agent { actor, critics: Some(critics), origin };
        for (name, bytes) in agent.to_files().map_err(|e| anyhow!("the policy's files: {e}"))? {
            let path = self.folder.join(name);
            write_whole(&path, &bytes)
                .with_context(|| format!("cannot write {}", path.display()))?;
        }
        let document = Document {
            schema: "greylag.policy-training/1",
            program: concat!("greylag ", env!("CARGO_PKG_VERSION")),
            command_line: files::command_line(),
            method,
            best: &agent.origin,
        };
        let json = self.folder.join("training.json");
        files::write(&json, &(serde_json::to_string_pretty(&document)? + "\n"), Overwrite::Force)
    }
}

/// Warns if the fraction of lost episodes exceeds [`MANY`].
fn warn(seed: u64, progress: &PolicyProgress) {
    let part = progress.lost as f64 / progress.episodes.max(1) as f64;
    if progress.updates > 0 && part > MANY {
        eprintln!(
            "seed {seed}: {:.0} % of the episodes so far left the envelope of a state that can be \
             believed (attitude, incidence, rates, airspeed); if that goes on, the model lacks flights \
             near there: collect some and learn it again",
            100.0 * part
        );
    }
}

/// A point of the learning curve with the results of the evaluation `e`. All other values are zero.
pub fn reached(e: Evaluated) -> CurvePoint {
    let Evaluated { easy_deg, hard_deg, divergence_rate, .. } = e;
    CurvePoint { easy_deg, hard_deg, divergence_rate, ..CurvePoint::default() }
}
