//! Evaluation of a controller by flights to many targets (commanded attitudes), on all cores, summarised by groups of targets.
//! The settled error of a flight is the mean of the RMS errors of roll and pitch over its last fifth; it is 180° if the aircraft
//! was lost.

use std::time::Duration;

#[cfg(feature = "sitl")]
use greylag_sitl::plant::PlantOptions;
use rand::RngExt;
use rayon::prelude::*;
use serde::Serialize;

#[cfg(feature = "sitl")]
use crate::Simulator;
use crate::episode::{DIVERGED_DEG, Leg, STEPS};
use crate::summary::{Spreads, Thinned, spreads};
use crate::targets::Row;
use crate::{Environment, Episode, Group, Imagined, Outcome, Trouble};
use greylag_control::quality::{Limits, Quality};
use greylag_control::{Controller, Target};
use greylag_model::GreyBox;
use greylag_num::statistics::{interquartile_mean, mean, quantile};
use greylag_num::{bootstrap, stream};

/// Seed of the bootstrap. It is fixed, so the same scores give the same intervals.
const SEED: u64 = 95;

/// Scores of a controller on the targets.
#[derive(Clone, Debug, Serialize)]
pub struct Evaluation {
    /// Name of the controller.
    pub controller: String,
    /// Name of the model from which the controller was designed or with which it plans.
    pub model: String,
    /// Scores by group. The group `all` contains the easy targets and those in the hard corners, if both were flown: the 240
    /// targets of the paper's Table II.
    pub groups: Vec<Score>,
    /// Computing time per step.
    pub ms_per_step: Cost,
    /// Envelope limits that the quality measures use; `None` if the quality was not measured.
    pub limits: Option<Limits>,
    /// Every flight with its quality measures, in the order of the targets; empty if the quality was not measured.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub flights: Vec<Scored>,
}

/// One flight of an evaluation.
#[derive(Clone, Debug, Serialize)]
pub struct Scored {
    /// Group of the target.
    pub targets: String,
    /// Roll and pitch (degrees) that were commanded before the target. `None` if the flight starts at the start of an episode.
    pub from_deg: Option<[f64; 2]>,
    /// Target roll and pitch in degrees.
    pub to_deg: [f64; 2],
    /// Settled attitude error, degrees.
    pub settled_deg: f64,
    /// Quality measures of the flight.
    pub quality: Quality,
}

/// Score of one group of targets.
#[derive(Clone, Debug, Serialize)]
pub struct Score {
    /// Name of the group.
    pub targets: String,
    /// Number of targets flown.
    pub count: usize,
    /// Mean settled error, degrees.
    pub mean_deg: f64,
    /// 95 % bootstrap interval of the mean, degrees. The bootstrap draws targets.
    pub mean_ci95_deg: [f64; 2],
    /// Median settled error, degrees.
    pub median_deg: f64,
    /// 95 % bootstrap interval of the median, degrees.
    pub median_ci95_deg: [f64; 2],
    /// Interquartile mean of the settled error, degrees.
    pub iqm_deg: f64,
    /// 95 % bootstrap interval of the interquartile mean, degrees.
    pub iqm_ci95_deg: [f64; 2],
    /// Smallest settled error, degrees.
    pub min_deg: f64,
    /// Largest settled error, degrees.
    pub max_deg: f64,
    /// Median over the flights of the time after which the attitude stays within 1° of the target, s.
    pub settling_s: f64,
    /// Fraction of targets with more than 10° of settled error.
    pub divergence_rate: f64,
    /// 95 % bootstrap interval of the divergence rate.
    pub divergence_ci95: [f64; 2],
    /// Fraction of the flights that stay within the limits of load factor and angle of attack; NaN if the quality was not
    /// measured. Transients are allowed, see [`TRANSIENT`](greylag_control::quality::TRANSIENT).
    pub kept_rate: f64,
    /// Fraction of the flights that overshoot roll and pitch by at most 1° or 3 % of the step, whichever is larger.
    pub little_overshoot_rate: f64,
    /// Summary of each quality measure over the flights, by the id of the measure; empty if the quality was not measured.
    pub measures: Spreads,
}

/// Quantiles of the controller's computing time per step, ms.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Cost {
    /// Median of the times.
    pub p50: f64,
    /// 99th percentile of the times.
    pub p99: f64,
    /// 99.9th percentile of the times.
    pub p999: f64,
}

/// Function that makes a controller for a thread.
pub type Make<'a> = &'a (dyn Fn() -> Box<dyn Controller> + Sync);

/// Flies to the targets `rows` in JSBSim, on all cores. Each thread has its own controller of `make`. `done` is called after
/// each flight. Every row has its own random stream, independent of the core and of the other rows.
///
/// # Errors
///
/// If the simulated aircraft cannot be built or reset.
#[cfg(feature = "sitl")]
pub fn evaluate(
    plant: &PlantOptions,
    make: Make,
    rows: &[Row],
    seed: u32,
    done: &(dyn Fn() + Sync),
) -> Result<Vec<Outcome>, Trouble> {
    // an aircraft that cannot be built is reported here, before the first flight
    Simulator::new(plant)?;
    let world = || Simulator::new(plant);
    fly(&world, make, &courses(rows, plant.start.airspeed_mps), seed, done)
}

/// Flies `courses` in JSBSim, as [`evaluate`] flies targets.
///
/// # Errors
///
/// The same as [`evaluate`].
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

/// Flies to the targets `rows` in a simulation of `model` instead of JSBSim, as [`evaluate`] does.
///
/// # Errors
///
/// At present there is no error. The loss of an aircraft is a result and not an error.
pub fn imagine(
    model: &GreyBox,
    make: Make,
    rows: &[Row],
    seed: u32,
) -> Result<Vec<Outcome>, Trouble> {
    imagine_courses(model, make, &courses(rows, model.airframe.reference.airspeed), seed)
}

/// Flies `courses` in a simulation of `model`, as [`imagine`] flies targets.
///
/// # Errors
///
/// The same as [`imagine`].
pub fn imagine_courses(
    model: &GreyBox,
    make: Make,
    courses: &[Course],
    seed: u32,
) -> Result<Vec<Outcome>, Trouble> {
    fly(&|| Ok(Imagined::new(model.clone())), make, courses, seed, &|| ())
}

/// Scores of a controller over random draws of a model.
#[derive(Clone, Debug, Serialize)]
pub struct Robustness {
    /// The score over all draws.
    pub all: Evaluation,
    /// For each draw: mean settled error, degrees, and number of targets with a settled error over [`DIVERGED_DEG`].
    pub draws: Vec<(f64, usize)>,
}

impl Robustness {
    /// Monte Carlo simulation of the uncertainty of `model`: flies `courses` in the random models 0 to `draws` − 1 of the seed
    /// `seed`, see [`GreyBox::drawn`]. `controller` and `name` are the names of the controller and of the model. `done` is
    /// called after each draw.
    ///
    /// # Errors
    ///
    /// The same as [`imagine`].
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
            // only sums are kept, because the tracks of thousands of draws would not fit into memory
            all.take(courses, &flown, Some(&limits));
            done();
        }
        Ok(Robustness { all: all.evaluation([controller, name], Some(limits)), draws: each })
    }
}

/// One flight of an evaluation. It consists of one or two legs; a leg is a target with a duration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Course {
    /// Index of the course in its set, from 0. The index selects the random stream.
    pub number: u32,
    /// Group of the target; `None` for steps between attitudes.
    pub group: Option<Group>,
    /// Leg that is flown before the scored one; `None` if the scored leg begins at the start of an episode.
    pub first: Option<Leg>,
    /// The leg that is scored.
    pub leg: Leg,
}

impl Course {
    /// Name of the group in tables and JSON; `steps` without a group.
    pub fn targets(&self) -> &'static str {
        self.group.map_or("steps", Group::name)
    }
}

/// Courses from the start of an episode to the targets `rows`, as in the paper, with the commanded airspeed `airspeed` (m/s).
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

/// Accumulates the results of flights without their tracks.
#[derive(Default)]
struct Sums {
    flights: Vec<Flown>,
    cost: Thinned,
}

/// Results of one flight that enter the scores.
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
            outcome.cost.iter().for_each(|d: &Duration| self.cost.push(d.as_secs_f64() * 1e3));
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
        // the group "all" is Table II of the paper and requires both of its groups
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
                p50: quantile(self.cost.values(), 0.5),
                p99: quantile(self.cost.values(), 0.99),
                p999: quantile(self.cost.values(), 0.999),
            },
            limits,
            flights: self.flights.into_iter().filter_map(|f| f.scored).collect(),
        }
    }
}

impl Evaluation {
    /// Summarises `outcomes`, the results of flights to `rows`, without quality measures.
    pub fn new(controller: &str, model: &str, rows: &[Row], outcomes: &[Outcome]) -> Evaluation {
        let mut sums = Sums::default();
        sums.take(&courses(rows, f64::NAN), outcomes, None);
        sums.evaluation([controller, model], None)
    }

    /// Summarises `outcomes`, the results of `courses`, with the quality measures for `limits`. `names` are those of controller
    /// and model.
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

    /// The score of the group with this name.
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
