//! Flights for the training of a model: flight logs, and simulated episodes that `greylag collect` recorded in rounds. A track
//! is a section of a flight without gaps. Held-out data are used for validation only.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use crate::commands::intake::Reading;
use crate::learn::dynamics::resample::{SLOWEST_S, resampled};
use crate::learn::dynamics::windows::Track;
use crate::logs::csv::{self, Tolerance};
use crate::model::{GreyBox, STEP};
use crate::physics::{Controls, State};
use crate::sysid::flight_path::ActuatorClock;
use crate::sysid::flight_path::reconstruction::Reconstruction;

/// Without recent flights, every tenth track is held out, if there are ten or more.
const HELD_OUT: usize = 10;
/// Fraction at the end of a track that is held out. It applies to the tracks of recent flights. Without recent flights, it
/// applies to all tracks if there are fewer than ten.
const HELD_OUT_PART: f64 = 0.2;
/// Largest number of copies of a recent flight in the training data.
const MOST_COPIES: f64 = 50.0;

/// Options that select the flights.
#[derive(clap::Args)]
pub struct FlightArguments {
    /// Flight logs: CSV, PX4 ULog, ArduPilot .bin, MAVLink .tlog or ROS 2 bag (.mcap), distinguished by content.
    #[arg(long = "log", num_args = 1..)]
    logs: Vec<PathBuf>,
    #[command(flatten)]
    reading: Reading,
    /// Folders that `greylag collect` wrote. Every round in them is read, with the recorded states as they are.
    #[arg(long = "collect", num_args = 1..)]
    folders: Vec<PathBuf>,
    /// Logs of recent flights, which get a larger weight than the others (--recent-share). The last fifth of each is held out
    /// for validation.
    #[arg(long = "recent", value_name = "LOG", num_args = 1..)]
    recent: Vec<PathBuf>,
    /// Fraction of the training samples that come from recent flights. To reach it, recent flights are repeated, at most 50
    /// times; 1 leaves the other flights out.
    #[arg(long, value_name = "PART", default_value_t = 0.5, requires = "recent", value_parser = share)]
    recent_share: f64,
}

/// Flights for training and validation.
pub struct Flights {
    /// Tracks for training.
    pub learn: Vec<Track>,
    /// Tracks for validation, which are not used for training.
    pub judge: Vec<Track>,
    /// Number of training samples. Samples of repeated flights are counted once.
    pub samples: usize,
    /// Longest sample time of the logs, s; at least the model's time step.
    pub slowest_s: f64,
    /// Notes for the reader of the report.
    pub notes: Vec<String>,
}

/// Number of samples that are held out at the end of a track of `samples` samples.
fn held_out(samples: usize) -> usize {
    (HELD_OUT_PART * samples as f64) as usize
}

impl FlightArguments {
    /// Reads the flights. `model` converts the measured controls to those that act on the aircraft, and gives the air density.
    ///
    /// # Errors
    /// If there are no flights, a file cannot be read, or a log has fewer than ten samples per second.
    pub fn read(&self, model: &GreyBox) -> Result<Flights> {
        let mut notes = Vec::new();
        let mut tracks = Vec::new();
        for folder in &self.folders {
            tracks.extend(collected(folder, model)?);
        }
        let mut slowest_s = STEP;
        let logged = self.logged(&self.logs, model, &mut notes, &mut slowest_s)?;
        tracks.extend(logged.into_iter().map(|rows| Track::new(model, rows.into_iter())));
        if !self.recent.is_empty() {
            return self.with_recent(tracks, model, notes, slowest_s);
        }
        if tracks.is_empty() {
            bail!("there is nothing to learn from: give --log or --collect");
        }
        let samples = |learn: &[Track]| learn.iter().map(|t| t.states.len()).sum();
        if tracks.len() < HELD_OUT {
            notes.push(
                "The scores are of the last fifth of each flight, which was held out.".into(),
            );
            let ended = |t: &Track| t.split(t.states.len() - held_out(t.states.len()));
            let (learn, judge): (Vec<Track>, Vec<Track>) =
                tracks.iter().map(ended).map(|[a, b]| (a, b)).unzip();
            return Ok(Flights { samples: samples(&learn), learn, judge, slowest_s, notes });
        }
        let (mut learn, mut judge) = (Vec::new(), Vec::new());
        for (k, track) in tracks.into_iter().enumerate() {
            if k % HELD_OUT == HELD_OUT - 1 { judge.push(track) } else { learn.push(track) }
        }
        Ok(Flights { samples: samples(&learn), learn, judge, slowest_s, notes })
    }

    /// Whether all flights come from `--log`: there are no folders of `greylag collect` and no recent flights.
    pub fn is_logs_alone(&self) -> bool {
        self.folders.is_empty() && self.recent.is_empty()
    }

    /// The rows (state, controls, altitude) of each section of `logs` without gaps, resampled to the model's time step. Adds
    /// to `notes`, and raises `slowest_s` to the longest sample time of `logs`, s.
    fn logged(
        &self,
        logs: &[PathBuf],
        model: &GreyBox,
        notes: &mut Vec<String>,
        slowest_s: &mut f64,
    ) -> Result<Vec<Vec<Row>>> {
        if logs.is_empty() {
            return Ok(Vec::new());
        }
        let intake = self.reading.take_in(logs, model, ActuatorClock::Estimated)?;
        notes.extend(intake.notes);
        let mut all = Vec::new();
        for flight in &intake.flights {
            notes.extend(slow(flight)?);
            *slowest_s = slowest_s.max(flight.step_s);
            all.extend(flight.segments.iter().map(|segment| {
                let rows = segment.instants.iter().map(|i| (i.state, i.controls, i.altitude));
                resampled(&rows.collect::<Vec<_>>(), flight.step_s)
            }));
        }
        Ok(all)
    }

    /// The training and validation data if there are recent flights. The training data are the tracks `others` and the recent
    /// flights. Recent flights are repeated until they make up about the requested fraction of all samples.
    fn with_recent(
        &self,
        others: Vec<Track>,
        model: &GreyBox,
        mut notes: Vec<String>,
        mut slowest_s: f64,
    ) -> Result<Flights> {
        let share = self.recent_share;
        let (mut recent, mut judge) = (Vec::new(), Vec::new());
        for rows in self.logged(&self.recent, model, &mut notes, &mut slowest_s)? {
            let end = rows.len() - held_out(rows.len());
            recent.push(Track::new(model, rows[..end].iter().copied()));
            judge.push(Track::new(model, rows[end..].iter().copied()));
        }
        let count = |tracks: &[Track]| tracks.iter().map(|t| t.states.len()).sum::<usize>();
        let (old, new) = (count(&others), count(&recent));
        if new == 0 {
            bail!("the recent logs hold no flight to learn from");
        }
        notes.push(
            "The scores are of the last fifth of each recent flight, which was held out.".into(),
        );
        if share == 1.0 || old == 0 {
            return Ok(Flights { learn: recent, judge, samples: new, slowest_s, notes });
        }
        let wanted = share / (1.0 - share) * old as f64 / new as f64;
        let copies = wanted.round().clamp(1.0, MOST_COPIES) as usize;
        notes.push(format!(
            "{new} samples of recent flights count {copies} times against {old} of others: {:.0} % of the training data.",
            100.0 * (copies * new) as f64 / (copies * new + old) as f64
        ));
        let mut learn = others;
        (0..copies).for_each(|_| learn.extend(recent.iter().cloned()));
        Ok(Flights { learn, judge, samples: old + new, slowest_s, notes })
    }
}

/// Parses `text`, the value of an option that is a fraction of the training samples.
///
/// # Errors
/// If the text is no number above 0 and at most 1.
pub fn share(text: &str) -> Result<f64, String> {
    let share = text.parse().ok().filter(|share| *share > 0.0 && *share <= 1.0);
    share.ok_or_else(|| "give a number above 0, at most 1".into())
}

/// A sample: state, measured controls, altitude (m).
type Row = (State, Controls, f64);

/// A warning if the flight's sample time exceeds the model's time step; otherwise `None`.
///
/// # Errors
/// If the sample time exceeds [`SLOWEST_S`].
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

/// The episodes in the subfolders (rounds) of `folder`, which `greylag collect` wrote, in the order of their names.
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
