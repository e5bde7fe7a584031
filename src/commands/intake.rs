//! The options that name flight logs, from the files to reconstructed flights.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use crate::logs::finding::{Finding, Severity};
use crate::logs::mapping::Mapping;
use crate::logs::phases::Flying;
use crate::logs::{self, csv::Tolerance};
use crate::model::GreyBox;
use crate::sysid::flight_path::reconstruction::Reconstruction;
use crate::sysid::flight_path::{self, ActuatorClock, reconstruct};
#[cfg(feature = "study")]
use crate::workbench;

/// Which logs, read how.
#[derive(Clone, clap::Args)]
pub struct LogArguments {
    /// Flight logs: CSV, PX4 ULog, ArduPilot .bin or MAVLink .tlog, distinguished by content.
    #[arg(long = "log", num_args = 1.., required = true)]
    pub paths: Vec<PathBuf>,
    #[command(flatten)]
    reading: Reading,
}

/// How logs are read.
#[derive(Clone, clap::Args)]
pub struct Reading {
    /// A TOML file that says where columns of the logs come from.
    #[arg(long)]
    mapping: Option<PathBuf>,
    /// Read logs in which more than 5 % of the rows are unusable.
    #[arg(long)]
    lenient: bool,
    /// Use logs in which wrong units, signs or axes were found.
    #[arg(long)]
    despite_problems: bool,
}

/// What the logs gave.
#[derive(Default)]
pub struct Intake {
    /// The flights that could be reconstructed; at least one.
    pub flights: Vec<Reconstruction>,
    /// What was odd about the logs, left-out ones included.
    pub notes: Vec<String>,
    /// Whether a log was left out or holds what makes the figures wrong.
    pub in_doubt: bool,
}

impl LogArguments {
    /// Other logs, read in the same way.
    #[cfg(feature = "study")]
    pub fn of(&self, paths: Vec<PathBuf>) -> LogArguments {
        LogArguments { paths, ..self.clone() }
    }

    /// Reads and reconstructs the logs; one that cannot be is said and left out.
    ///
    /// # Errors
    /// If the mapping cannot be read, or no log is left.
    pub fn take_in(&self, model: &GreyBox, clock: ActuatorClock) -> Result<Intake> {
        self.reading.take_in(&self.paths, model, clock)
    }
}

impl Reading {
    /// The settings of the readers of logs.
    ///
    /// # Errors
    /// If the mapping cannot be read.
    pub fn options(&self) -> Result<logs::Options> {
        let mapping = self.mapping.as_deref().map(Mapping::load).transpose()?.unwrap_or_default();
        Ok(logs::Options { tolerance: self.tolerance(), mapping, flies: Flying::default() })
    }

    /// The same for a workbench.
    #[cfg(feature = "study")]
    pub fn of_workbench(&self) -> workbench::Reading {
        workbench::Reading {
            mapping: self.mapping.clone(),
            tolerance: self.tolerance(),
            despite_problems: self.despite_problems,
        }
    }

    fn tolerance(&self) -> Tolerance {
        if self.lenient { Tolerance::Lenient } else { Tolerance::Strict }
    }

    /// As [`LogArguments::take_in`], of `paths`.
    ///
    /// # Errors
    /// If the mapping cannot be read, or no log is left.
    pub fn take_in(
        &self,
        paths: &[PathBuf],
        model: &GreyBox,
        clock: ActuatorClock,
    ) -> Result<Intake> {
        let flies = Flying::from(model.airframe.envelope.flying_from_mps());
        let mut reading = logs::Options { flies, ..self.options()? };
        reading.mapping = reading.mapping.with_mixer(model.airframe.mixer.clone());
        let mut intake = Intake::default();
        for (k, (path, name)) in paths.iter().zip(logs::names(paths)).enumerate() {
            eprintln!("log {} of {}: reading and reconstructing {name}", k + 1, paths.len());
            match self.reconstruct_one(path, &name, &reading, model, clock) {
                Ok((flight, findings)) => {
                    intake.flights.push(flight);
                    intake.in_doubt |= findings.iter().any(|f| f.severity == Severity::Problem);
                    intake.notes.extend(findings.iter().map(|f| format!("{name}: {f}")));
                }
                Err(error) => {
                    eprintln!("greylag: {error:#}");
                    intake.in_doubt = true;
                    intake.notes.push(format!("left out: {error:#}"));
                }
            }
        }
        if intake.flights.is_empty() {
            bail!("no log can be compared: what is wrong with each is said above");
        }
        Ok(intake)
    }

    /// The reconstructed flight of a log, with what was odd about the file.
    fn reconstruct_one(
        &self,
        path: &Path,
        name: &str,
        reading: &logs::Options,
        model: &GreyBox,
        clock: ActuatorClock,
    ) -> Result<(Reconstruction, Vec<Finding>)> {
        let log = logs::load(path, reading)?;
        if let Some(problems) = log.problems().filter(|_| !self.despite_problems) {
            bail!(
                "flight log {}: {problems}. Every figure would be wrong. If the log is right all the same, use it with --despite-problems",
                path.display()
            );
        }
        let options = flight_path::Options::of(name, model, clock);
        let flight = reconstruct(&log.flight, &options)
            .with_context(|| format!("cannot use flight log {}", path.display()))?;
        Ok((flight, log.findings))
    }
}
