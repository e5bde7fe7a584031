//! Many episodes on all cores, summed up by group of targets.

use std::time::Duration;

#[cfg(feature = "sitl")]
use greylag_sitl::plant::PlantOptions;
use rand::RngExt;
use rayon::prelude::*;
use serde::Serialize;

#[cfg(feature = "sitl")]
use crate::Simulator;
use crate::episode::DIVERGED_DEG;
use crate::targets::Row;
use crate::{Environment, Episode, Group, Imagined, Outcome, Trouble};
use greylag_control::{Controller, Target};
use greylag_model::GreyBox;
use greylag_num::statistics::{interquartile_mean, mean, quantile};
use greylag_num::{bootstrap, stream};

/// Seed of the intervals' resamples: the same scores have the same intervals.
const SEED: u64 = 95;

/// What a controller reached on the targets.
#[derive(Clone, Debug, Serialize)]
pub struct Evaluation {
    /// The controller's name.
    pub controller: String,
    /// The model it was designed from or plans with.
    pub model: String,
    /// Scores by group; `all`, where both were flown, is easy with the hard corners: the 240 of the
    /// paper's Table II.
    pub groups: Vec<Score>,
    /// Time per step.
    pub ms_per_step: Cost,
}

/// The score of one group of targets.
#[derive(Clone, Debug, Serialize)]
pub struct Score {
    /// The group's name.
    pub targets: String,
    /// Number of targets.
    pub count: usize,
    /// Mean settled error, degrees.
    pub mean_deg: f64,
    /// Its 95 % interval over the targets, as of the others (bootstrap).
    pub mean_ci95_deg: [f64; 2],
    /// Median settled error, degrees.
    pub median_deg: f64,
    /// Its 95 % interval.
    pub median_ci95_deg: [f64; 2],
    /// Interquartile mean of the settled error, degrees.
    pub iqm_deg: f64,
    /// Its 95 % interval.
    pub iqm_ci95_deg: [f64; 2],
    /// Smallest settled error, degrees.
    pub min_deg: f64,
    /// Largest settled error, degrees.
    pub max_deg: f64,
    /// Median of the time after which the attitude stays within 1° of the target, s.
    pub settling_s: f64,
    /// Share of targets with more than 10° of settled error.
    pub divergence_rate: f64,
    /// Its 95 % interval.
    pub divergence_ci95: [f64; 2],
}

/// Quantiles of the time a controller needs for one step, ms.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Cost {
    /// Median.
    pub p50: f64,
    /// 99th percentile.
    pub p99: f64,
    /// 99.9th percentile.
    pub p999: f64,
}

/// Makes a controller for a core.
pub type Make<'a> = &'a (dyn Fn() -> Box<dyn Controller> + Sync);

/// Flies `rows` in JSBSim with clones of a controller, on all cores; `done` is called after each.
/// Every row has random numbers of its own, whatever core it is flown on and whatever is flown
/// beside it.
///
/// # Errors
/// If the plant cannot be built or reset.
#[cfg(feature = "sitl")]
pub fn evaluate(
    plant: &PlantOptions,
    make: Make,
    rows: &[Row],
    seed: u32,
    done: &(dyn Fn() + Sync),
) -> Result<Vec<Outcome>, Trouble> {
    // what cannot be flown is said before anything is
    Simulator::new(plant)?;
    let world = || Simulator::new(plant);
    fly(&world, make, rows, Conditions { airspeed: plant.start.airspeed_mps, seed }, done)
}

/// Flies `rows` in `model` in JSBSim's place, as [`evaluate`] does: nothing but the model decides the score.
///
/// # Errors
/// Not for a controller that can be built: an aircraft that is lost is an outcome.
pub fn imagine(
    model: &GreyBox,
    make: Make,
    rows: &[Row],
    seed: u32,
) -> Result<Vec<Outcome>, Trouble> {
    let world = || Ok(Imagined::new(model.clone()));
    fly(
        &world,
        make,
        rows,
        Conditions { airspeed: model.airframe.reference.airspeed, seed },
        &|| (),
    )
}

/// What a controller reached in models drawn from one.
#[derive(Clone, Debug, Serialize)]
pub struct Robustness {
    /// The score over all draws together.
    pub all: Evaluation,
    /// Of each draw: mean settled error, degrees, and the number of targets that diverged (settled error over
    /// [`DIVERGED_DEG`]).
    pub draws: Vec<(f64, usize)>,
}

impl Robustness {
    /// Flies `rows` in draws 0 to `draws` − 1 of `model` with the seed `seed`, see [`GreyBox::drawn`]: Monte Carlo over
    /// what is not known of the model. `done` is called after each draw.
    ///
    /// # Errors
    /// As for [`imagine`].
    pub fn of(
        [controller, name]: [&str; 2],
        make: Make,
        model: &GreyBox,
        rows: &[Row],
        [seed, draws]: [u32; 2],
        done: &dyn Fn(),
    ) -> Result<Robustness, Trouble> {
        let (mut outcomes, mut each) = (Vec::new(), Vec::new());
        for k in 0..draws {
            let flown = imagine(&model.drawn(seed.into(), k.into()), make, rows, seed)?;
            let settled: Vec<f64> = flown.iter().map(|o| o.settled_deg).collect();
            let lost = settled.iter().filter(|deg| **deg > DIVERGED_DEG).count();
            each.push((mean(&settled), lost));
            outcomes.extend(flown);
            done();
        }
        let repeated: Vec<Row> = (0..draws).flat_map(|_| rows.iter().copied()).collect();
        let all = Evaluation::new(controller, name, &repeated, &outcomes);
        Ok(Robustness { all, draws: each })
    }
}

/// What all flights have in common: the airspeed wanted (m/s) and the seed.
#[derive(Clone, Copy)]
struct Conditions {
    airspeed: f64,
    seed: u32,
}

fn fly<E: Environment>(
    world: &(dyn Fn() -> Result<E, Trouble> + Sync),
    make: Make,
    rows: &[Row],
    conditions: Conditions,
    done: &(dyn Fn() + Sync),
) -> Result<Vec<Outcome>, Trouble> {
    rows.par_iter()
        .map_init(
            || world().map(|environment| (environment, make())),
            |worker, row| {
                let (environment, controller) =
                    worker.as_mut().map_err(|e| Trouble::Worker(e.to_string()))?;
                let target = Target {
                    roll: row.roll_deg.to_radians(),
                    pitch: row.pitch_deg.to_radians(),
                    airspeed: conditions.airspeed,
                };
                let seed: u64 =
                    stream::stream(conditions.seed.into(), &[row.number.into()]).random();
                environment.reseed(seed as u32);
                let controller = controller.as_mut();
                let outcome = Episode { environment, controller, seed }.fly(&target, |_, _| ())?;
                done();
                Ok(outcome)
            },
        )
        .collect()
}

impl Evaluation {
    /// Sums up `outcomes` of `rows`.
    pub fn new(controller: &str, model: &str, rows: &[Row], outcomes: &[Outcome]) -> Evaluation {
        let of = |wanted: &dyn Fn(Group) -> bool| -> Vec<&Outcome> {
            let pairs = rows.iter().zip(outcomes).filter(|(row, _)| wanted(row.group));
            pairs.map(|(_, outcome)| outcome).collect()
        };
        let mut groups: Vec<Score> = Group::ALL
            .into_iter()
            .map(|group| Score::new(group.name(), &of(&|g| g == group)))
            .collect();
        groups.retain(|score| score.count > 0);
        // "all" are the targets of Table II; a part of them is not
        if [Group::Easy, Group::HardCorners].iter().all(|g| rows.iter().any(|r| r.group == *g)) {
            groups.push(Score::new("all", &of(&|g| g != Group::HardOutside)));
        }
        let cost: Vec<f64> = outcomes
            .iter()
            .flat_map(|o| &o.cost)
            .map(|d: &Duration| d.as_secs_f64() * 1e3)
            .collect();
        Evaluation {
            controller: controller.into(),
            model: model.into(),
            groups,
            ms_per_step: Cost {
                p50: quantile(&cost, 0.5),
                p99: quantile(&cost, 0.99),
                p999: quantile(&cost, 0.999),
            },
        }
    }

    /// The score of the group of that name.
    pub fn score(&self, targets: &str) -> Option<&Score> {
        self.groups.iter().find(|score| score.targets == targets)
    }
}

impl Score {
    fn new(targets: &str, outcomes: &[&Outcome]) -> Score {
        let errors: &[f64] = &outcomes.iter().map(|o| o.settled_deg).collect::<Vec<_>>();
        let settling: Vec<f64> = outcomes.iter().map(|o| o.settling_s).collect();
        let diverged = |errors: &[f64]| {
            errors.iter().filter(|e| **e > DIVERGED_DEG).count() as f64 / errors.len() as f64
        };
        let median = |errors: &[f64]| quantile(errors, 0.5);
        let ci95 = |statistic: &dyn Fn(&[f64]) -> f64| bootstrap::interval(errors, SEED, statistic);
        Score {
            targets: targets.into(),
            count: errors.len(),
            mean_deg: mean(errors),
            mean_ci95_deg: ci95(&mean),
            median_deg: median(errors),
            median_ci95_deg: ci95(&median),
            iqm_deg: interquartile_mean(errors),
            iqm_ci95_deg: ci95(&interquartile_mean),
            min_deg: quantile(errors, 0.0),
            max_deg: quantile(errors, 1.0),
            settling_s: quantile(&settling, 0.5),
            divergence_rate: diverged(errors),
            divergence_ci95: ci95(&diverged),
        }
    }
}
