//! Experiment design: finds the manoeuvre that best discriminates two effects. An effect is a group of terms that a model may
//! lack, such as stall. Each manoeuvre of a menu is simulated with the model plus one effect and with the model plus the
//! other. [`Separation::apart`] measures how well the two effects are then distinguished.

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use crate::instruments::{Group, Instruments};
use crate::missing::{Craft, Missing, MissingKind};
use crate::{Environment, Imagined};
use greylag_control::{Controller, Observation, Target};
use greylag_logs::Sampling;
use greylag_manoeuvres::menu::{self, MENU, Manoeuvre};
use greylag_manoeuvres::{PITCH_MAX_DEG, ROLL_MAX_DEG, Schedule, Scheduled};
use greylag_model::{GreyBox, JoinError};
use greylag_physics::catalogue;
use greylag_physics::inputs::InputMemory;
use greylag_physics::rigid_body;
use greylag_physics::{Controls, State};
use greylag_sysid::flight_path::ActuatorClock;
use greylag_sysid::flight_path::reconstruction::{Instant, Reconstruction, Segment};
use greylag_sysid::progress::{Cancelled, Progress, report};
use greylag_sysid::separation::{Separation, separation};
use greylag_sysid::weak_form::prepared::{ClockError, Prepared};

/// Smallest [`Separation::apart`] at which two effects count as discriminated.
pub const ENOUGH: f64 = 10.0;
/// Flight time that a plan must not reach, s.
pub const LONGEST_S: f64 = 600.0;
/// Smallest number of flown manoeuvres: one on each of two opposite headings.
const LEAST: f64 = 2.0;
/// Step of the simulation, s.
const STEP_S: f64 = 0.01;

/// No manoeuvre can be designed.
#[derive(Debug, thiserror::Error)]
pub enum DesignError {
    /// An effect cannot be added to the model.
    #[error(transparent)]
    Join(#[from] JoinError),
    /// The plausible size of an effect is unknown.
    #[error("how large {id} may be is not known; give its values (--values {id}=…)")]
    Amplitude {
        /// Id of the effect.
        id: String,
    },
    /// The two effects are the same.
    #[error("{id} cannot be distinguished from itself; name two effects")]
    Same {
        /// Id of the effect.
        id: String,
    },
    /// The simulated flights cannot be compared.
    #[error("comparing imagined flights: {0}")]
    Compare(#[from] ClockError),
    /// The progress callback cancelled the task.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// One of the two candidate effects, with its coefficients.
#[derive(Clone, Debug)]
pub struct Suspect {
    /// Id of the effect.
    pub id: String,
    /// Values of the effect's coefficients, in the effect's order. An empty list stands for values that make the effect clearly
    /// visible in a flight.
    pub values: Vec<f64>,
}

/// Predicted ability of a manoeuvre of the menu to discriminate the two effects.
#[derive(Clone, Debug)]
pub struct Prospect {
    /// Name of the manoeuvre.
    pub name: &'static str,
    /// Length of the manoeuvre, s.
    pub duration_s: f64,
    /// Separation of the effects in a flight of the aircraft with the first effect, and in a flight with the second effect.
    /// `None` if the aircraft exceeds the roll or pitch that a schedule allows.
    pub separations: [Option<Separation>; 2],
}

impl Prospect {
    /// The smaller [`Separation::apart`] of the two flights; `None` if one is missing.
    pub fn apart(&self) -> Option<f64> {
        let [a, b] = self.separations;
        Some(a?.apart.min(b?.apart))
    }

    /// Flight time in which repetitions of this manoeuvre reach [`ENOUGH`], s; `None` if a separation is missing.
    pub fn seconds(&self) -> Option<f64> {
        self.apart().map(|apart| self.duration_s * ENOUGH / apart)
    }
}

/// Computes how well each manoeuvre of the menu discriminates the effects `suspects`, which `model` lacks. The manoeuvre
/// that needs the shortest flight time is first.
///
/// `controller` flies the manoeuvres. The separations are computed for the sensor noise of a small autopilot. `progress`
/// is called with the fraction of the manoeuvres that have been simulated.
///
/// # Errors
///
/// If both effects are the same, if an effect is unknown or already in the model, if its amplitude is unknown, or if
/// `progress` cancels the task.
pub fn prospects(
    model: &GreyBox,
    controller: &dyn Controller,
    suspects: &[Suspect; 2],
    progress: &Progress,
) -> Result<Vec<Prospect>, DesignError> {
    if suspects[0].id == suspects[1].id {
        return Err(DesignError::Same { id: suspects[0].id.clone() });
    }
    let truths = [truth(model, &suspects[0])?, truth(model, &suspects[1])?];
    let ways = [alternatives(model, &suspects[0])?, alternatives(model, &suspects[1])?];
    report(progress, "imagining each manoeuvre", 0.0)?;
    let flown = AtomicUsize::new(0);
    let prospect = |manoeuvre: &Manoeuvre| -> Result<Prospect, DesignError> {
        let cruise = model.airframe.envelope.airspeed_cruise_mps;
        let schedule = manoeuvre.schedule().at_cruise(cruise);
        let separation_of = |k: usize| -> Result<Option<Separation>, DesignError> {
            let flight = imagine(&truths[k], controller, &schedule)?;
            Ok(flight.map(|f| separation(model, &truths[k], &ways[1 - k], &f)))
        };
        let separations = [separation_of(0)?, separation_of(1)?];
        let done = flown.fetch_add(1, Ordering::Relaxed) + 1;
        report(progress, "imagining each manoeuvre", done as f64 / MENU.len() as f64)?;
        Ok(Prospect { name: manoeuvre.name, duration_s: schedule.duration(), separations })
    };
    let mut all = MENU.par_iter().map(prospect).collect::<Result<Vec<_>, _>>()?;
    let seconds = |p: &Prospect| p.seconds().unwrap_or(f64::INFINITY);
    all.sort_by(|a, b| seconds(a).total_cmp(&seconds(b)));
    Ok(all)
}

/// A manoeuvre that discriminates two effects, repeated as often as necessary.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The manoeuvre that is repeated.
    pub manoeuvre: &'static Manoeuvre,
    /// Flight time in which the manoeuvre reaches [`ENOUGH`], s.
    pub seconds: f64,
    /// Number of repetitions, on alternating headings.
    pub times: usize,
    /// The schedule with all repetitions.
    pub schedule: Schedule,
}

/// Plans the fastest of `prospects`, which must be sorted as by [`prospects`], at the cruise airspeed `cruise_mps`
/// (m/s). `None` if no manoeuvre reaches [`ENOUGH`] within [`LONGEST_S`].
pub fn plan(prospects: &[Prospect], cruise_mps: f64) -> Option<Plan> {
    let best = prospects.first()?;
    let seconds = best.seconds().filter(|seconds| *seconds < LONGEST_S)?;
    let manoeuvre = menu::named(best.name)?;
    let times = (seconds / best.duration_s).ceil().max(LEAST) as usize;
    let schedule = repeated(manoeuvre, times).at_cruise(cruise_mps);
    Some(Plan { manoeuvre, seconds, times, schedule })
}

/// Repeats a manoeuvre on alternating opposite headings. On a single heading, the wind cannot be distinguished from a
/// scale error of the airspeed.
fn repeated(manoeuvre: &Manoeuvre, times: usize) -> Schedule {
    let again = |all: Schedule, _| all.then(menu::TURN.schedule()).then(manoeuvre.schedule());
    (1..times).fold(manoeuvre.schedule(), again)
}

/// The model `model` with the effect added.
fn truth(model: &GreyBox, suspect: &Suspect) -> Result<GreyBox, DesignError> {
    let mut with = model.clone();
    with.join(&suspect.id, &values(model, suspect)?)?;
    Ok(with)
}

/// Values of the effect's coefficients. They are the given values if there are any, else clearly visible values. If these are
/// unknown, they are the middle one of the sets of starting values in the catalogue.
fn values(model: &GreyBox, suspect: &Suspect) -> Result<Vec<f64>, DesignError> {
    if !suspect.values.is_empty() {
        return Ok(suspect.values.clone());
    }
    let id = suspect.id.as_str();
    let Some(about) = catalogue::describe(id) else {
        // joining the effect reports the error
        return Ok(model.clone().join(id, &[]).map(|()| Vec::new())?);
    };
    let craft = Craft::lacking(model);
    let clear = craft.kind(id).map(|MissingKind { clear: [low, high], .. }| 0.5 * (low + high));
    let clear = clear.and_then(|amplitude| Missing::new(&craft, id, amplitude).ok());
    if let Some(missing) = clear.filter(|missing| !missing.values.is_empty()) {
        return Ok(missing.values);
    }
    let starts = about.entry.map_or(&[][..], |entry| entry.starts);
    let middle = starts.get(starts.len() / 2).map(|middle| middle.to_vec());
    middle.ok_or_else(|| DesignError::Amplitude { id: id.into() })
}

/// Models by which [`separation`] fits the effect of `suspect`. There is one list for the effect's own values and one for each
/// set of starting values in the catalogue. Within a list, each model is `model` with only one nonzero linear coefficient of
/// the effect. An effect with fewer than two linear coefficients has a single model in a list, with the whole effect.
///
/// # Errors
///
/// If the effect is unknown or already in the model, or if its size is unknown.
pub fn alternatives(model: &GreyBox, suspect: &Suspect) -> Result<Vec<Vec<GreyBox>>, DesignError> {
    let own = values(model, suspect)?;
    let about = catalogue::describe(&suspect.id);
    let starts = about.and_then(|about| about.entry).map_or(&[][..], |entry| entry.starts);
    let linear = about.map_or(0, |about| about.coefficients.len() - about.shape);
    let joined = |values: &[f64]| -> Result<GreyBox, DesignError> {
        let mut with = model.clone();
        with.join(&suspect.id, values)?;
        Ok(with)
    };
    let one = |values: &[f64]| -> Result<Vec<GreyBox>, DesignError> {
        if linear < 2 {
            return Ok(vec![joined(values)?]);
        }
        let alone = |k: usize| {
            let keep = |(i, v): (usize, &f64)| if i == k || i >= linear { *v } else { 0.0 };
            joined(&values.iter().enumerate().map(keep).collect::<Vec<_>>())
        };
        (0..linear).filter(|k| values[*k] != 0.0).map(alone).collect()
    };
    let all = std::iter::once(own.as_slice()).chain(starts.iter().copied());
    all.map(one).collect()
}

/// The flight along `schedule`, simulated with the model `truth`. `None` if it exceeds the roll or pitch that a schedule
/// allows, if the simulation fails, or if it is too short for an evaluation.
fn imagine(
    truth: &GreyBox,
    controller: &dyn Controller,
    schedule: &Schedule,
) -> Result<Option<Prepared>, ClockError> {
    let mut world = Imagined::new(truth.clone());
    let mut pilot = Scheduled::new(controller.boxed_clone(), schedule.clone());
    pilot.reset(0);
    let Ok(mut seen) = world.reset() else { return Ok(None) };
    let nobody = Target { roll: 0.0, pitch: 0.0, airspeed: f64::NAN };
    let mut instants = Vec::new();
    let mut memory = truth.at_rest(&Controls::default());
    for _ in 0..(schedule.duration() / STEP_S).round() as usize {
        let State { roll, pitch, .. } = seen.state;
        if roll.to_degrees().abs() > ROLL_MAX_DEG || pitch.to_degrees().abs() > PITCH_MAX_DEG {
            return Ok(None);
        }
        instants.push(instant(truth, &seen, &mut memory));
        let command = pilot.command(&seen, &nobody);
        seen = match world.step(command) {
            Ok(seen) => seen,
            Err(_) => return Ok(None),
        };
    }
    let noise = Instruments::NOISY.noise;
    let sd = |group: Group| noise[group as usize];
    let (attitude, gyro, vane) = (sd(Group::Attitude), sd(Group::Gyros), sd(Group::Vanes));
    let noise = [attitude, attitude, sd(Group::Airspeed), gyro, gyro, gyro, vane, vane];
    let force_noise = [sd(Group::Accelerometers); 3];
    let flight = Reconstruction {
        name: schedule.name.clone(),
        step_s: STEP_S,
        sampling: Sampling::Held,
        clock: ActuatorClock::AsRecorded,
        segments: vec![Segment { instants }],
        nuisances: Vec::new(),
        installation: Vec::new(),
        noise,
        left: noise,
        force_noise,
        gust_step: 0.0,
        rudder: None,
        notes: Vec::new(),
    };
    let mut prepared = Prepared::new(&flight, 0.0)?;
    // the simulated flight has no noise, but the separation accounts for sensor noise
    (prepared.noise, prepared.force_noise) = (noise, force_noise);
    Ok((!prepared.windows.is_empty()).then_some(prepared))
}

/// A log sample without noise. Its specific force is computed by the model `truth`.
fn instant(truth: &GreyBox, seen: &Observation, memory: &mut InputMemory) -> Instant {
    let controls = seen.actuators.controls();
    let air = truth.air(&seen.state, seen.altitude);
    let acting = truth.act(&controls, memory);
    let wrench = truth.wrench(&seen.state, &acting, &air);
    let force = rigid_body::body_force(&wrench, &air, truth.axes);
    Instant {
        time_s: seen.time.as_secs_f64(),
        state: seen.state,
        yaw: f64::NAN,
        controls,
        command: None,
        specific_force: force.map(|f| f / truth.body.mass),
        altitude: seen.altitude,
        density: f64::NAN,
    }
}
