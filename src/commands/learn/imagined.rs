//! Scores of the controllers that use a learned model and its policy, flown in that model.

use std::path::Path;

use anyhow::Result;
use serde::Serialize;

use super::budget::Budget;
use crate::commands::controllers;
use crate::commands::interruption::Interruption;
use crate::control::ControllerKind;
use crate::model::GreyBox;
use crate::sim::evaluation::{Evaluation, imagine};
use crate::sim::{Group, TargetFile};

/// Seed of the targets. These targets differ from the targets of `greylag evaluate` and from the targets by which a
/// training chooses its policy.
const TARGETS: u64 = 3;
/// Controllers, each with a number n: the controller flies one target in n. A planner takes milliseconds a step, and few
/// targets suffice for the LQI.
const EVERY: [(ControllerKind, u32); 3] =
    [(ControllerKind::Policy, 1), (ControllerKind::Lqi, 4), (ControllerKind::HybridLqi, 24)];

/// Score of a controller in the model.
#[derive(Clone, Debug, Serialize)]
pub struct Reached {
    /// Name of the controller.
    pub controller: String,
    /// Number of targets flown.
    pub targets: usize,
    /// Mean settled error on easy targets, degrees.
    pub easy_deg: f64,
    /// Mean settled error in the hard corners, degrees.
    pub hard_deg: f64,
    /// Fraction of the targets that diverged (settled error over 10°).
    pub divergence_rate: f64,
}

/// Flies the controllers in the model of the folder `folder`, with the policy in the folder `policy`. `None` if
/// interrupted.
///
/// # Errors
/// If the model or the policy cannot be read or is invalid. Other controllers that cannot be built are left out, for
/// example an LQI that cannot be designed.
pub fn reached(
    folder: &Path,
    policy: &Path,
    seed: u32,
    budget: Budget,
    stop: &Interruption,
) -> Result<Option<Vec<Reached>>> {
    let model = GreyBox::load(&folder.join("model.toml"))?;
    let mut all = Vec::new();
    let flown = |kind: &ControllerKind| budget.flies_planners() || !kind.searches();
    for (kind, every) in EVERY.into_iter().filter(|(kind, _)| flown(kind)) {
        if stop.is_set() {
            return Ok(None);
        }
        let controller = match controllers::controller(kind, &model, policy, &[]) {
            Ok(controller) => controller,
            Err(error) if kind == ControllerKind::Policy => return Err(error),
            Err(error) => {
                eprintln!("{kind} is not flown in the model: {error:#}");
                continue;
            }
        };
        let mut rows = TargetFile::generate(TARGETS).rows;
        rows.retain(|r| r.group != Group::HardOutside && r.number % every == 0);
        let outcomes = imagine(&model, &|| controller.boxed_clone(), &rows, seed)?;
        let scores = Evaluation::new(kind.name(), &model.name, &rows, &outcomes);
        let mean = |group: &str| scores.score(group).map_or(f64::NAN, |s| s.mean_deg);
        all.push(Reached {
            controller: kind.name().into(),
            targets: rows.len(),
            easy_deg: mean(Group::Easy.name()),
            hard_deg: mean(Group::HardCorners.name()),
            divergence_rate: scores.score("all").map_or(f64::NAN, |s| s.divergence_rate),
        });
    }
    Ok(Some(all))
}
