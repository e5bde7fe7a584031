//! The environment in which a policy is trained and evaluated: a model of the aircraft, or JSBSim.

use std::sync::Arc;

use anyhow::Result;

use crate::control::Controller;
use crate::control::policy::{Actor, Evaluated, Origin, Policy};
use crate::model::GreyBox;
use crate::physics::Airframe;
use crate::sim::evaluation::{Evaluation, Make, imagine};
use crate::sim::targets::Row;
use crate::sim::{Group, Outcome, TargetFile};

/// The environment in which a policy is trained: `model`, or JSBSim if `model` is `None`.
pub(super) struct Ground {
    pub(super) model: Option<Arc<GreyBox>>,
    pub(super) origin: Origin,
    pub(super) airframe: Airframe,
}

impl Ground {
    /// Scores `actor` in the environment of its training, on a tenth of the easy and hard-corner attitudes (45° to 60° of roll
    /// with 25° to 30° of pitch) of a target file. A policy that is trained in a model is therefore chosen without flights in
    /// JSBSim.
    pub(super) fn evaluate(&self, actor: Arc<Actor>) -> Result<Evaluated> {
        let mut rows = TargetFile::generate(JUDGE_SEED).rows;
        rows.retain(|r| r.group != Group::HardOutside && r.number % 10 == r.number / 10 % 10);
        let make = || -> Box<dyn Controller> { Box::new(Policy::of(actor.clone())) };
        let outcomes = match &self.model {
            Some(model) => imagine(model, &make, &rows, 1)?,
            None => flown(&make, &rows)?,
        };
        let scores = Evaluation::new("policy", &self.origin.model, &rows, &outcomes);
        let mean = |group: &str| scores.score(group).map_or(f64::NAN, |s| s.mean_deg);
        Ok(Evaluated {
            targets: rows.len(),
            easy_deg: mean("easy"),
            hard_deg: mean("hard_corners"),
            divergence_rate: scores.score("all").map_or(f64::NAN, |s| s.divergence_rate),
        })
    }
}

/// Seed of the targets on which a training compares its policies and chooses the best one.
const JUDGE_SEED: u64 = 2;

/// Flies the controllers of `make` to the targets `rows` in JSBSim and returns the results.
#[cfg(feature = "demo")]
pub(super) fn flown(make: Make, rows: &[Row]) -> Result<Vec<Outcome>> {
    let plant = greylag_sitl::plant::PlantOptions::default();
    Ok(crate::sim::evaluation::evaluate(&plant, make, rows, 1, &|| ())?)
}

#[cfg(not(feature = "demo"))]
pub(super) fn flown(_: Make, _: &[Row]) -> Result<Vec<Outcome>> {
    anyhow::bail!("this program was built without JSBSim")
}
