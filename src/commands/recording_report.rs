//! Reads the recording of a flight and makes its report. The settled error of a target attitude is the mean of the RMS
//! errors of roll and pitch in the last fifth of the time for which the target was commanded.

use std::path::Path;

use anyhow::{Context, Result};

use crate::commands::files;
use crate::control::Target;
use crate::control::quality::Limits;
use crate::flight::replay::replay_watched;
use crate::flight::runtime::Companion;
use crate::link::vehicle::Vehicle;
use crate::logs::csv::{self, Tolerance};
use crate::logs::{Flight, Sample, quoted};
use crate::model::GreyBox;
use crate::report::{
    Cycle, Difficulty, EnvelopeFlown, Event, EventKind, FlightReport, LoopTiming, Segment, Sight,
    SurfaceTravel,
};
use crate::sim::Group;
use crate::sim::episode::{attitude_error_deg, settled_error_deg};
use crate::sysid::compare::{self, Comparison};
use crate::sysid::flight_path;

/// Largest settled error that counts as tracked, degrees: half of what section V-E of \[GSFM26\] (see `src/lib.rs`) calls
/// "near-perfect tracking".
pub const TOLERANCE_DEG: f64 = 0.5;

/// Inputs of the report besides the recording.
pub struct Reporter<'a> {
    /// Title of the page.
    pub title: String,
    /// Name of the controller.
    pub controller: &'a str,
    /// The model that the controller is designed from.
    pub model: &'a GreyBox,
    /// Path of the model's file.
    pub model_file: &'a Path,
    /// Seed of all random numbers; `None` if it is unknown.
    pub seed: Option<u64>,
    /// The parts of the flight with a constant target attitude.
    pub segments: Vec<Segment>,
    /// Texts that the companion sent, with their times, s.
    pub texts: Vec<(f64, String)>,
    /// The planner's candidate plans shortly after each new target.
    pub sights: Vec<Sight>,
}

impl Reporter<'_> {
    /// Makes the report on `flight`, with the loop timing of the recording in `folder`.
    pub fn report<'f>(&self, folder: &Path, flight: &'f Flight) -> Result<FlightReport<'f>> {
        let travels = self.model.airframe.actuators.travels();
        Ok(FlightReport {
            title: self.title.clone(),
            flight,
            controller: self.controller.into(),
            model: self.model.name.clone(),
            seed: self.seed,
            command_line: files::command_line(),
            versions: vec![("greylag".into(), env!("CARGO_PKG_VERSION").into())],
            segments: self.segments.clone(),
            tolerance_rad: TOLERANCE_DEG.to_radians(),
            envelope: Some(EnvelopeFlown {
                limits: Limits::of(&self.model.airframe),
                flying_from_mps: self.model.airframe.envelope.flying_from_mps(),
            }),
            travel: SurfaceTravel {
                aileron_rad: travels.aileron.largest(),
                elevator_rad: travels.elevator.largest(),
            },
            timing: Some(timing(&folder.join("flight.csv"))?),
            events: self.texts.iter().map(event).collect(),
            comparison: self.compared(flight),
            sights: self.sights.clone(),
            next: format!(
                "greylag compare --model {} --log {}",
                quoted(self.model_file),
                quoted(&folder.join("flight.csv"))
            ),
        })
    }
}

impl Reporter<'_> {
    /// Prediction errors of the model on `flight`; `None` if the flight cannot be compared.
    fn compared(&self, flight: &Flight) -> Option<Comparison> {
        let options = flight_path::Options {
            gravity: self.model.atmosphere.gravity,
            ..flight_path::Options::new("flight.csv", self.model.airframe.actuators)
        };
        let report = |why: &dyn std::fmt::Display| {
            eprintln!("the report has no comparison of model and flight: {why}");
        };
        let path = flight_path::reconstruct(flight, &options).map_err(|e| report(&e)).ok()?;
        let models = std::slice::from_ref(self.model);
        compare::compare(
            models,
            &[path],
            &compare::Options::default(),
            &crate::sysid::progress::ignore_progress,
        )
        .map_err(|e| report(&e))
        .ok()
    }
}

/// Number of control cycles from a new target to the cycle whose candidate plans are reported. By then the plan has begun
/// to move the aircraft.
const REPORTED_AFTER: usize = 20;

/// Replays the recording in `folder`, and returns the planner's candidate plans `REPORTED_AFTER` control cycles after each
/// new target. Prints how many commands equal the recorded ones bit by bit.
pub fn sights(folder: &Path, companion: Companion, vehicle: Vehicle) -> Result<Vec<Sight>> {
    println!("replaying the recording, to show what the planner saw");
    let mut all = Vec::new();
    let (mut target, mut ticks) = ([f64::NAN; 2], 0);
    let outcome = replay_watched(folder, companion, vehicle, &mut |time, request, controller| {
        let now = [request.target.roll, request.target.pitch];
        (target, ticks) = if now == target { (now, ticks + 1) } else { (now, 0) };
        if ticks == REPORTED_AFTER
            && let Some(insight) = controller.insight(&request.observation)
        {
            all.push(Sight { time_s: time.as_secs_f64(), target, insight });
        }
    })?;
    let (ticks, different) = (outcome.ticks, outcome.different);
    println!("replayed: {} of {ticks} commands equal to the bit", ticks - different);
    Ok(all)
}

/// Reads the recorded flight in `folder`.
pub fn read(folder: &Path) -> Result<Flight> {
    Ok(csv::load(&folder.join("flight.csv"), Tolerance::Strict)?.flight)
}

/// The part of the flight in which this target (roll and pitch, degrees) was commanded, with its settled error.
pub fn segment(
    [roll_deg, pitch_deg]: [f64; 2],
    difficulty: Difficulty,
    flight: &Flight,
) -> Segment {
    let target = [roll_deg.to_radians(), pitch_deg.to_radians()];
    let samples: Vec<&Sample> = flight.samples.iter().filter(|s| wants(s, target)).collect();
    scored(&samples, target, difficulty)
}

/// Shortest time for which a target must be commanded to be scored, s.
const SHORTEST_S: f64 = 3.0;

/// The parts of the flight in which a target was commanded for at least 3 s, in time order.
pub fn segments(flight: &Flight) -> Vec<Segment> {
    let same = |a: &Sample, b: &Sample| wants(b, [a.roll_target_rad, a.pitch_target_rad]);
    let runs = flight.samples.chunk_by(same).filter(|run| {
        let ends = run.first().zip(run.last());
        let lasting = ends.is_some_and(|(a, b)| b.time_s - a.time_s >= SHORTEST_S);
        lasting && run[0].roll_target_rad.is_finite() && run[0].pitch_target_rad.is_finite()
    });
    let score = |run: &[Sample]| {
        let target = [run[0].roll_target_rad, run[0].pitch_target_rad];
        let [roll, pitch] = target.map(f64::to_degrees);
        let easy = Group::Easy.contains(roll, pitch);
        let difficulty = if easy { Difficulty::Easy } else { Difficulty::Hard };
        scored(&run.iter().collect::<Vec<_>>(), target, difficulty)
    };
    runs.map(score).collect()
}

/// Whether a sample has this target (roll, pitch, rad). A recorded target was sent as a quaternion in single precision,
/// which is accurate to 1e-7.
fn wants(s: &Sample, [roll, pitch]: [f64; 2]) -> bool {
    (s.roll_target_rad - roll).abs() + (s.pitch_target_rad - pitch).abs() < 1e-5
}

fn scored(samples: &[&Sample], [roll, pitch]: [f64; 2], difficulty: Difficulty) -> Segment {
    let settled = &samples[samples.len() - samples.len() / 5..];
    let target = Target { roll, pitch, airspeed: f64::NAN };
    let errors: Vec<[f64; 2]> = settled
        .iter()
        .map(|s| attitude_error_deg([s.attitude_rad[0], s.attitude_rad[1]], &target))
        .collect();
    let ends = |sample: Option<&&Sample>| sample.map_or(f64::NAN, |s| s.time_s);
    Segment {
        start_s: ends(samples.first()),
        end_s: ends(samples.last()),
        roll_target_rad: roll,
        pitch_target_rad: pitch,
        difficulty,
        settled_error_rad: settled_error_deg(&errors).to_radians(),
    }
}

fn event((time_s, text): &(f64, String)) -> Event {
    let failsafe = text.to_lowercase().contains("failsafe");
    let kind = if failsafe { EventKind::Failsafe } else { EventKind::Text };
    Event { time_s: *time_s, kind, text: text.clone() }
}

/// Cycles of the control loop, from the latency column of the recording.
fn timing(path: &Path) -> Result<LoopTiming> {
    let broken = || format!("reading the loop timing back from {}", path.display());
    // a recording that was cut off ends with an incomplete row
    let builder = ::csv::ReaderBuilder::new().flexible(true).from_path(path);
    let mut reader = builder.with_context(broken)?;
    let header = reader.headers().with_context(broken)?;
    let column = |name: &str| header.iter().position(|h| h == name).with_context(broken);
    let (time, latency) = (column("time_s")?, column("latency_us")?);
    let number = |record: &::csv::StringRecord, at: usize| record.get(at)?.parse::<f64>().ok();
    let mut cycles = Vec::new();
    for record in reader.records() {
        let record = record.with_context(broken)?;
        if let Some((time_s, duration_us)) = number(&record, time).zip(number(&record, latency)) {
            cycles.push(Cycle { time_s, duration_us });
        }
    }
    let measure = "state frame to actuator command".into();
    Ok(LoopTiming { measure, budget_us: 10_000.0, cycles })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recording_that_was_cut_off_keeps_its_cycles() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("flight.csv");
        std::fs::write(&path, "time_s,latency_us,mode\n0.01,250,1\n0.02,260,1\n0.0").unwrap();
        let cycles = timing(&path).unwrap().cycles;
        assert_eq!(cycles.iter().map(|c| c.duration_us).collect::<Vec<_>>(), [250.0, 260.0]);
    }
}
