//! Many episodes on all cores, summed up by group of targets.

use std::time::Duration;

#[cfg(feature = "sitl")]
use greylag_sitl::plant::PlantOptions;
use rand::RngExt;
use rayon::prelude::*;
use serde::Serialize;

#[cfg(feature = "sitl")]
use crate::Simulator;
use crate::episode::{DIVERGED_DEG, Leg, STEPS};
use crate::summary::{Spreads, spreads};
use crate::targets::Row;
use crate::{Environment, Episode, Group, Imagined, Outcome, Trouble};
use greylag_control::quality::{Limits, Quality};
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
    /// The limits that the flights are measured against; `None` where they were not measured.
    pub limits: Option<Limits>,
    /// Every flight with its measures, in the order of the targets; empty where they were not measured.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub flights: Vec<Scored>,
}

/// One flight of an evaluation.
#[derive(Clone, Debug, Serialize)]
pub struct Scored {
    /// The group that it is of.
    pub targets: String,
    /// Where from, roll and pitch in degrees; `None` for the start of an episode.
    pub from_deg: Option<[f64; 2]>,
    /// Where to, roll and pitch in degrees.
    pub to_deg: [f64; 2],
    /// Settled error, degrees.
    pub settled_deg: f64,
    /// What happened on the way.
    pub quality: Quality,
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
    /// Share of the flights that kept to load factor and angle of attack but for a transient, see
    /// [`TRANSIENT`](greylag_control::quality::TRANSIENT); NaN where it was not measured.
    pub kept_rate: f64,
    /// Share of the flights that overshoot roll and pitch by at most 1° or 3 % of the step, whichever is more.
    pub little_overshoot_rate: f64,
    /// Each measure over the flights, by its id; empty where none was taken.
    pub measures: Spreads,
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
    fly(&world, make, &courses(rows, plant.start.airspeed_mps), seed, done)
}

/// Flies `courses` in JSBSim, as [`evaluate`] flies targets.
///
/// # Errors
/// As for [`evaluate`].
#[cfg(feature = "sitl")]
pub fn evaluate_courses(
    plant: &PlantOptions,
    make: Make,
    courses: &[Course],
    seed: u32,
    done: &(dyn Fn() + Sync),
) -> Result<Vec<Outcome>, Trouble> {
    Simulator::new(plant)?;
    fly(&|| Simulator::new(plant), make, courses, seed, done)
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
    imagine_courses(model, make, &courses(rows, model.airframe.reference.airspeed), seed)
}

/// Flies `courses` in `model`, as [`imagine`] flies targets.
///
/// # Errors
/// As for [`imagine`].
pub fn imagine_courses(
    model: &GreyBox,
    make: Make,
    courses: &[Course],
    seed: u32,
) -> Result<Vec<Outcome>, Trouble> {
    fly(&|| Ok(Imagined::new(model.clone())), make, courses, seed, &|| ())
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
    /// Flies `courses` in draws 0 to `draws` − 1 of `model` with the seed `seed`, see [`GreyBox::drawn`]: Monte Carlo over
    /// what is not known of the model. `done` is called after each draw.
    ///
    /// # Errors
    /// As for [`imagine`].
    pub fn of(
        [controller, name]: [&str; 2],
        make: Make,
        model: &GreyBox,
        courses: &[Course],
        [seed, draws]: [u32; 2],
        done: &dyn Fn(),
    ) -> Result<Robustness, Trouble> {
        let limits = Limits::of(&model.airframe);
        let (mut all, mut each) = (Sums::default(), Vec::new());
        for k in 0..draws {
            let drawn = model.drawn(seed.into(), k.into());
            let flown = imagine_courses(&drawn, make, courses, seed)?;
            let settled: Vec<f64> = flown.iter().map(|o| o.settled_deg).collect();
            let lost = settled.iter().filter(|deg| **deg > DIVERGED_DEG).count();
            each.push((mean(&settled), lost));
            // a draw's tracks go with it: thousands of draws do not fit into memory
            all.take(courses, &flown, Some(&limits));
            done();
        }
        Ok(Robustness { all: all.evaluation([controller, name], Some(limits)), draws: each })
    }
}

/// Where a flight goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Course {
    /// Its place in its set, from 0: what its random numbers are drawn for.
    pub number: u32,
    /// The set that it is of; `None` for steps between attitudes.
    pub group: Option<Group>,
    /// Flown before what is scored; `None` for flights that begin at the start of an episode.
    pub first: Option<Leg>,
    /// What is scored.
    pub leg: Leg,
}

impl Course {
    /// The name of its group in tables and JSON.
    pub fn targets(&self) -> &'static str {
        self.group.map_or("steps", Group::name)
    }
}

/// The targets of a file as the paper flies them, wanting an airspeed (m/s).
pub fn courses(rows: &[Row], airspeed: f64) -> Vec<Course> {
    let course = |row: &Row| {
        let [roll, pitch] = [row.roll_deg, row.pitch_deg].map(f64::to_radians);
        let leg = Leg { target: Target { roll, pitch, airspeed }, steps: STEPS };
        Course { number: row.number, group: Some(row.group), first: None, leg }
    };
    rows.iter().map(course).collect()
}

fn fly<E: Environment>(
    world: &(dyn Fn() -> Result<E, Trouble> + Sync),
    make: Make,
    courses: &[Course],
    seed: u32,
    done: &(dyn Fn() + Sync),
) -> Result<Vec<Outcome>, Trouble> {
    courses
        .par_iter()
        .map_init(
            || world().map(|environment| (environment, make())),
            |worker, course| {
                let (environment, controller) =
                    worker.as_mut().map_err(|e| Trouble::Worker(e.to_string()))?;
                let seed: u64 = stream::stream(seed.into(), &[course.number.into()]).random();
                environment.reseed(seed as u32);
                let controller = controller.as_mut();
                let episode = Episode { environment, controller, seed };
                let outcome = episode.fly_leg(course.first, course.leg, |_, _| ())?;
                done();
                Ok(outcome)
            },
        )
        .collect()
}

/// Flights as they come in, without their tracks.
#[derive(Default)]
struct Sums {
    flights: Vec<Flown>,
    cost: Vec<f64>,
}

/// What a score needs of a flight.
struct Flown {
    group: Option<Group>,
    settled_deg: f64,
    settling_s: f64,
    scored: Option<Scored>,
}

impl Sums {
    fn take(&mut self, courses: &[Course], outcomes: &[Outcome], limits: Option<&Limits>) {
        for (course, outcome) in courses.iter().zip(outcomes) {
            let degrees = |t: &Target| [t.roll, t.pitch].map(f64::to_degrees);
            let scored = limits.map(|limits| Scored {
                targets: course.targets().into(),
                from_deg: course.first.map(|first| degrees(&first.target)),
                to_deg: degrees(&course.leg.target),
                settled_deg: outcome.settled_deg,
                quality: outcome.track.quality(limits),
            });
            let Outcome { settled_deg, settling_s, .. } = *outcome;
            self.flights.push(Flown { group: course.group, settled_deg, settling_s, scored });
            self.cost.extend(outcome.cost.iter().map(|d: &Duration| d.as_secs_f64() * 1e3));
        }
    }

    fn evaluation(self, [controller, model]: [&str; 2], limits: Option<Limits>) -> Evaluation {
        let of = |wanted: &dyn Fn(Option<Group>) -> bool| -> Vec<&Flown> {
            self.flights.iter().filter(|f| wanted(f.group)).collect()
        };
        let mut groups: Vec<Score> = Group::ALL
            .into_iter()
            .map(|group| Score::new(group.name(), &of(&|g| g == Some(group))))
            .collect();
        // "all" are the targets of Table II; a part of them is not
        if groups[..2].iter().all(|score| score.count > 0) {
            let table = |g| matches!(g, Some(Group::Easy | Group::HardCorners));
            groups.push(Score::new("all", &of(&table)));
        }
        groups.push(Score::new("steps", &of(&|g| g.is_none())));
        groups.retain(|score| score.count > 0);
        Evaluation {
            controller: controller.into(),
            model: model.into(),
            groups,
            ms_per_step: Cost {
                p50: quantile(&self.cost, 0.5),
                p99: quantile(&self.cost, 0.99),
                p999: quantile(&self.cost, 0.999),
            },
            limits,
            flights: self.flights.into_iter().filter_map(|f| f.scored).collect(),
        }
    }
}

impl Evaluation {
    /// Sums up `outcomes` of `rows`, by the settled error alone.
    pub fn new(controller: &str, model: &str, rows: &[Row], outcomes: &[Outcome]) -> Evaluation {
        let mut sums = Sums::default();
        sums.take(&courses(rows, f64::NAN), outcomes, None);
        sums.evaluation([controller, model], None)
    }

    /// Sums up `outcomes` of `courses`, measured against `limits`.
    pub fn measured(
        names: [&str; 2],
        courses: &[Course],
        outcomes: &[Outcome],
        limits: &Limits,
    ) -> Evaluation {
        let mut sums = Sums::default();
        sums.take(courses, outcomes, Some(limits));
        sums.evaluation(names, Some(*limits))
    }

    /// The score of the group of that name.
    pub fn score(&self, targets: &str) -> Option<&Score> {
        self.groups.iter().find(|score| score.targets == targets)
    }
}

impl Score {
    fn new(targets: &str, outcomes: &[&Flown]) -> Score {
        let scored: Vec<&Quality> =
            outcomes.iter().filter_map(|f| f.scored.as_ref()).map(|s| &s.quality).collect();
        let share = |of: &dyn Fn(&Quality) -> bool| {
            scored.iter().filter(|q| of(q)).count() as f64 / scored.len() as f64
        };
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
            kept_rate: share(&|q| q.kept),
            little_overshoot_rate: share(&|q| q.overshoots_little()),
            measures: spreads(&scored),
        }
    }
}
