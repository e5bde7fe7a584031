//! Training for `greylag train policy --algorithm analytic`.
//!
//! It trains an actor and then two critics. The actor is the network of the policy and maps an observation to a command. A
//! critic is a network that estimates the discounted sum of future rewards (the return).

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use anyhow::{Context, Result};

use super::policy::reached;
use crate::commands::interruption::Interruption;
use crate::control::policy::{Actor, Critic, Evaluated};
use crate::learn::policy::learning_curve::{CURVE, CurveFile, CurvePoint};
use crate::learn::{AnalyticRecipe, AnalyticTrainer, Valuation, ValuationRecipe};
use crate::model::GreyBox;
use crate::sim::imagined::Imagination;

/// Number of updates of the actor between two evaluations.
const LINE: u64 = 50;
/// Number of updates of the critics between two printed lines.
const CRITICS: u64 = 1000;

/// Trains an actor by gradient ascent on the reward of flights in `model`, starting from the actor `from` if one is given.
///
/// `judge` evaluates an actor. Its results are written into `folder` as the learning curve. The returned actor is that of the
/// last update and not the best of the curve, because the learning rate has fallen to a hundredth by then. Returns `None` if
/// interrupted. An interrupted training cannot be resumed, because it takes only minutes.
///
/// # Errors
/// If a parameter of the actor is no longer finite, the evaluation fails or the curve cannot be written.
pub fn climb(
    recipe: &AnalyticRecipe,
    from: Option<&Actor>,
    model: &GreyBox,
    folder: &Path,
    judge: &dyn Fn(Arc<Actor>) -> Result<Evaluated>,
    stop: &Interruption,
) -> Result<Option<Arc<Actor>>> {
    let path = folder.join(CURVE);
    let context = || format!("cannot write {}", path.display());
    let mut curve =
        CurveFile::open(&path, 0).with_context(|| format!("cannot open {}", path.display()))?;
    let mut trainer = AnalyticTrainer::new(recipe.clone(), model.clone())?;
    if let Some(actor) = from {
        trainer = trainer.starting_from(actor)?;
    }
    let (start, mut reward) = (Instant::now(), 0.0);
    for update in 1..=recipe.updates {
        let progress = trainer
            .update()
            .with_context(|| format!("the actor was lost after {update} updates; lower --climb"))?;
        reward += progress.reward;
        if !update.is_multiple_of(LINE) && update != recipe.updates {
            continue;
        }
        let actor = Arc::new(trainer.actor()?);
        let seconds = start.elapsed().as_secs_f64();
        let steps = update * (recipe.window * recipe.instances) as u64;
        let point = CurvePoint {
            steps,
            updates: update,
            seconds,
            loss: f64::NAN,
            reward: reward / ((update - 1) % LINE + 1) as f64,
            episodes: steps / recipe.episode as u64,
            lost: progress.lost,
            ..reached(judge(actor)?)
        };
        curve.add(point).with_context(context)?;
        let left = seconds / update as f64 * (recipe.updates - update) as f64;
        println!(
            "{:>8} {}  {:.0} min left",
            recipe.seed,
            point.line().replace("NaN", "–"),
            left / 60.0
        );
        reward = 0.0;
        if stop.is_set() && update < recipe.updates {
            return Ok(None);
        }
    }
    Ok(Some(Arc::new(trainer.actor()?)))
}

/// Fits two critics to the returns of `actor` in the environment `world`. Returns `None` if interrupted.
///
/// # Errors
/// If the loss is no longer finite or the environment fails.
pub fn value(
    recipe: ValuationRecipe,
    actor: &Actor,
    world: Imagination,
    stop: &Interruption,
) -> Result<Option<[Critic; 2]>> {
    let (seed, updates) = (recipe.seed, recipe.updates);
    println!("{:>8} critics: updates,seconds,relative error", "seed");
    let mut valuation = Valuation::new(recipe, world, actor.clone())?;
    let start = Instant::now();
    loop {
        let progress = valuation.run(CRITICS)?;
        let seconds = start.elapsed().as_secs_f64();
        println!("{seed:>8} {},{seconds:.0},{:.3}", progress.updates, progress.error);
        if progress.updates == updates {
            return Ok(Some(valuation.critics()?));
        }
        if stop.is_set() {
            return Ok(None);
        }
    }
}
