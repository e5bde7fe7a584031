//! Scores of controllers that fly in the learned model itself instead of the simulator. The controllers use this model, or the
//! policy (a neural network) trained in it.
//!
//! A controller flies to targets: commanded roll and pitch. Its settled error for a target is the mean of the RMS errors of
//! roll and pitch in the last fifth of the flight. Easy targets have less than 45° of roll and 25° of pitch.
//! Targets in the hard corners have 45° to 60° of roll and 25° to 30° of pitch, to either side.

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

/// Seed of the targets. It differs from the seed of the targets of `greylag evaluate`, and from the seed of the targets by which
/// a training chooses its best policy.
const TARGETS: u64 = 3;
/// The controllers that fly, each with a number n: the controller flies one target in n. Few targets suffice for the LQI. The
/// hybrid controller plans with the model at each step, which takes milliseconds. It flies the fewest targets.
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
    /// Mean settled error on targets in the hard corners, degrees.
    pub hard_deg: f64,
    /// Fraction of the targets with a settled error over 10°.
    pub divergence_rate: f64,
}

/// Flies the controllers in the model `model.toml` of `folder`, with the policy in the folder `policy`. Returns `None` if the
/// user interrupts the program. `seed` is the seed of the controllers.
///
/// # Errors
/// If the model or the policy cannot be read or is invalid. If another controller cannot be built, such as an LQI that cannot be
/// designed, it is left out and no error is returned.
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
