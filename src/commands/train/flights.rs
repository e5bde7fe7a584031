//! The flights to learn from: recorded logs, and the rounds of `greylag collect`.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use crate::commands::intake::Reading;
use crate::learn::dynamics::resample::{SLOWEST_S, resampled};
use crate::learn::dynamics::windows::Track;
use crate::logs::csv::{self, Tolerance};
use crate::model::{GreyBox, STEP};
use crate::sysid::flight_path::ActuatorClock;
use crate::sysid::flight_path::reconstruction::Reconstruction;

/// One track in so many is held out, where there are that many.
const HELD_OUT: usize = 10;

/// Where flights come from.
#[derive(clap::Args)]
pub struct FlightArguments {
    /// Flight logs: CSV, PX4 ULog, ArduPilot .bin or MAVLink .tlog, distinguished by content.
    #[arg(long = "log", num_args = 1..)]
    logs: Vec<PathBuf>,
    #[command(flatten)]
    reading: Reading,
    /// Folders that `greylag collect` wrote; every round below them is read, its states as they are.
    #[arg(long = "collect", num_args = 1..)]
    folders: Vec<PathBuf>,
}

/// What there is to learn from.
pub struct Flights {
    /// Tracks to learn from.
    pub learn: Vec<Track>,
    /// Tracks to judge by; some of the others where there are few.
    pub judge: Vec<Track>,
    /// What the reader must know.
    pub notes: Vec<String>,
}

impl FlightArguments {
    /// Reads the flights as `model` sees them.
    ///
    /// # Errors
    /// If nothing is given, or something cannot be read.
    pub fn read(&self, model: &GreyBox) -> Result<Flights> {
        let mut notes = Vec::new();
        let mut tracks = Vec::new();
        for folder in &self.folders {
            tracks.extend(collected(folder, model)?);
        }
        if !self.logs.is_empty() {
            let intake = self.reading.take_in(&self.logs, model, ActuatorClock::Estimated)?;
            notes.extend(intake.notes);
            for flight in &intake.flights {
                notes.extend(slow(flight)?);
                tracks.extend(flight.segments.iter().map(|segment| {
                    let rows = segment.instants.iter().map(|i| (i.state, i.controls, i.altitude));
                    let rows = resampled(&rows.collect::<Vec<_>>(), flight.step_s);
                    Track::new(model, rows.into_iter())
                }));
            }
        }
        if tracks.is_empty() {
            bail!("there is nothing to learn from: give --log or --collect");
        }
        if tracks.len() < HELD_OUT {
            notes.push(
                "Too few flights to hold any out: the scores are of flights learned from.".into(),
            );
            return Ok(Flights { judge: tracks.clone(), learn: tracks, notes });
        }
        let (mut learn, mut judge) = (Vec::new(), Vec::new());
        for (k, track) in tracks.into_iter().enumerate() {
            if k % HELD_OUT == HELD_OUT - 1 { judge.push(track) } else { learn.push(track) }
        }
        Ok(Flights { learn, judge, notes })
    }
}

/// What must be known of a flight that was sampled more slowly than the model steps.
///
/// # Errors
/// If it was sampled too slowly.
fn slow(flight: &Reconstruction) -> Result<Option<String>> {
    let (name, step_s) = (&flight.name, flight.step_s);
    if step_s > 1.001 * SLOWEST_S {
        bail!(
            "cannot learn from {name}: it has a sample every {step_s:.3} s, and learning takes 10 a second or \
             more; log attitude and rates faster"
        );
    }
    let note = format!(
        "{name} has {:.0} samples a second; the states between them are interpolated: faster motions than \
         a fifth of that are not learned",
        1.0 / step_s
    );
    Ok((step_s > 1.001 * STEP).then_some(note))
}

/// The episodes below a folder of `greylag collect`, in the order of their names.
fn collected(folder: &Path, model: &GreyBox) -> Result<Vec<Track>> {
    let list = |folder: &Path| -> Result<Vec<PathBuf>> {
        let entries = std::fs::read_dir(folder).with_context(|| {
            format!("cannot read {}; name a folder of `greylag collect`", folder.display())
        })?;
        let mut paths = entries.map(|e| Ok(e?.path())).collect::<std::io::Result<Vec<_>>>()?;
        paths.sort();
        Ok(paths)
    };
    let mut tracks = Vec::new();
    for round in list(folder)?.iter().filter(|p| p.is_dir()) {
        for path in list(round)?.iter().filter(|p| p.extension().is_some_and(|e| e == "csv")) {
            let flight = csv::load(path, Tolerance::Strict)?.flight;
            tracks.push(Track::of(model, &flight));
        }
    }
    if tracks.is_empty() {
        bail!("{} has no episode; `greylag collect --out` writes them", folder.display());
    }
    Ok(tracks)
}
