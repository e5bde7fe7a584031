//! Options that name flight logs, and the reconstruction of the flights in these logs.
//!
//! A reconstruction estimates states, sensor errors and wind from kinematics alone. A finding is a suspected error of a log,
//! for instance a wrong unit.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use super::{bar, given, mistake};
use crate::logs::finding::{Finding, Severity};
use crate::logs::mapping::Mapping;
use crate::logs::phases::Flying;
use crate::logs::quoted;
use crate::logs::sources::Asked;
use crate::logs::{self, Log, csv::Tolerance};
use crate::model::GreyBox;
use crate::sysid::flight_path::reconstruction::Reconstruction;
use crate::sysid::flight_path::{self, ActuatorClock, reconstruct};
#[cfg(feature = "study")]
use crate::workbench;

/// Logs and options for reading them.
#[derive(Clone, clap::Args)]
pub struct LogArguments {
    /// Flight logs: CSV, PX4 ULog, ArduPilot .bin, MAVLink .tlog or ROS 2 bag (.mcap), distinguished by content.
    #[arg(long = "log", num_args = 1.., required = true)]
    pub paths: Vec<PathBuf>,
    #[command(flatten)]
    reading: Reading,
}

/// Options for reading logs.
#[derive(Clone, clap::Args)]
pub struct Reading {
    /// TOML file that assigns fields of the logs to columns.
    #[arg(long)]
    mapping: Option<PathBuf>,
    /// Read logs in which more than 5 % of the rows are unusable.
    #[arg(long)]
    lenient: bool,
    /// Use logs in which wrong units, signs or axes were found.
    #[arg(long)]
    despite_problems: bool,
    /// The instance of a topic to read instead of the one that the reader chooses: airspeed=1, or
    /// ATTITUDE=2/1 (system/component).
    #[arg(long, value_name = "TOPIC=INSTANCE")]
    source: Vec<Asked>,
}

/// Flights that were read and reconstructed from the logs.
#[derive(Default)]
pub struct Intake {
    /// The reconstructed flights, at least one.
    pub flights: Vec<Reconstruction>,
    /// Findings about the logs, and the reasons why logs were left out.
    pub notes: Vec<String>,
    /// Whether a log was left out, or has a finding that makes the results wrong.
    pub in_doubt: bool,
}

impl Intake {
    fn add(&mut self, flight: Reconstruction, name: &str, findings: &[Finding]) {
        self.flights.push(flight);
        self.in_doubt |= findings.iter().any(|f| f.severity == Severity::Problem);
        self.notes.extend(findings.iter().map(|f| format!("{name}: {f}")));
    }

    fn leave_out(&mut self, error: &anyhow::Error) {
        let said = mistake::text(error);
        eprintln!("greylag: {said}");
        self.in_doubt = true;
        self.notes.push(format!("left out: {}", said.lines().next().unwrap_or_default()));
    }
}

impl LogArguments {
    /// The logs `paths`, with the same reading options.
    #[cfg(feature = "study")]
    pub fn of(&self, paths: Vec<PathBuf>) -> LogArguments {
        LogArguments { paths, ..self.clone() }
    }

    /// The logs and the reading options as words of a command line, with a leading space.
    pub fn words(&self) -> String {
        let logs: String = self.paths.iter().map(|log| format!(" {}", quoted(log))).collect();
        format!(" --log{logs}{}", self.reading.words())
    }

    /// The command that inspects the logs. The file `model` states from which airspeed on the aircraft flies. The command lacks the
    /// option for logs with problems, because it names these problems.
    #[cfg(feature = "study")]
    pub fn inspected(&self, model: &Path) -> String {
        let reading = Reading { despite_problems: false, ..self.reading.clone() };
        let logs: String = self.paths.iter().map(|log| format!(" {}", quoted(log))).collect();
        format!("greylag logs info{logs}{} --model {}", reading.words(), quoted(model))
    }

    /// The options for reading the logs, as arguments of another command.
    #[cfg(feature = "study")]
    pub fn reading_words(&self) -> Vec<std::ffi::OsString> {
        let Reading { mapping, lenient, despite_problems, source } = &self.reading;
        let mapping = mapping.iter().flat_map(|file| ["--mapping".into(), file.clone().into()]);
        let sources = source.iter().flat_map(|s| ["--source".into(), s.to_string().into()]);
        let flags = [(*lenient, "--lenient"), (*despite_problems, "--despite-problems")];
        let given = flags.into_iter().filter(|(given, _)| *given).map(|(_, word)| word.into());
        mapping.chain(sources).chain(given).collect()
    }

    /// Reads and reconstructs the logs. A log that cannot be used is skipped with an error message.
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
        let (tolerance, sources) = (self.tolerance(), self.source.clone());
        let flies = mapping.flies(None);
        Ok(logs::Options { tolerance, mapping, flies, sources })
    }

    /// The reading options for a workbench.
    #[cfg(feature = "study")]
    pub fn of_workbench(&self) -> workbench::Reading {
        workbench::Reading {
            mapping: self.mapping.clone(),
            tolerance: self.tolerance(),
            despite_problems: self.despite_problems,
            sources: self.source.clone(),
        }
    }

    /// The options as words of a command line, each with a space before it.
    pub fn words(&self) -> String {
        let mapping = self.mapping.iter().map(|file| format!(" --mapping {}", quoted(file)));
        let flags = [(self.lenient, " --lenient"), (self.despite_problems, " --despite-problems")];
        let given = flags.into_iter().filter(|(given, _)| *given).map(|(_, word)| word.to_owned());
        let sources =
            self.source.iter().map(|s| format!(" --source {}", quoted(Path::new(&s.to_string()))));
        mapping.chain(sources).chain(given).collect()
    }

    fn tolerance(&self) -> Tolerance {
        if self.lenient { Tolerance::Lenient } else { Tolerance::Strict }
    }

    /// Reads and reconstructs the logs `paths`. A log that cannot be used is skipped with an error message.
    ///
    /// # Errors
    /// If the mapping cannot be read, or no log can be used.
    pub fn take_in(
        &self,
        paths: &[PathBuf],
        model: &GreyBox,
        clock: ActuatorClock,
    ) -> Result<Intake> {
        let flies = Flying::from(model.airframe.envelope.flying_from_mps());
        let mut reading = self.options()?;
        reading.flies = reading.mapping.flies(Some(flies));
        reading.mapping = reading.mapping.with_mixer(model.airframe.mixer.clone());
        let mut intake = Intake::default();
        for (k, (path, name)) in paths.iter().zip(logs::names(paths)).enumerate() {
            if !bar::is_silent() {
                eprintln!("log {} of {}: reading and reconstructing {name}", k + 1, paths.len());
            }
            let read = given::log(path)
                .and_then(|()| logs::flights(path, &reading).map_err(|e| units_first(path, e)));
            let logs = match read {
                Ok(logs) => logs,
                Err(error) if paths.len() == 1 => {
                    return Err(error.context("no log can be compared"));
                }
                Err(error) => {
                    intake.leave_out(&error);
                    continue;
                }
            };
            let several = logs.len() > 1;
            for (k, log) in logs.into_iter().enumerate() {
                let number = log.flight.name.rsplit_once('#').map(|(_, n)| n.to_owned());
                let number = number.unwrap_or_else(|| (k + 1).to_string());
                let name = if several { format!("{name}#{number}") } else { name.clone() };
                match self.reconstruct_one(path, &name, log, model, clock) {
                    Ok((flight, findings)) => intake.add(flight, &name, &findings),
                    Err(error) if paths.len() == 1 && !several => {
                        return Err(error.context("no log can be compared"));
                    }
                    Err(error) => intake.leave_out(&error),
                }
            }
        }
        if intake.flights.is_empty() {
            bail!("no log can be compared: what is wrong with each is said above");
        }
        Ok(intake)
    }

    /// The reconstructed flight of a log, with the findings about the file.
    fn reconstruct_one(
        &self,
        path: &Path,
        name: &str,
        log: Log,
        model: &GreyBox,
        clock: ActuatorClock,
    ) -> Result<(Reconstruction, Vec<Finding>)> {
        if !self.despite_problems {
            refuse_problems(path, &log.findings)?;
        }
        let options = flight_path::Options::of(name, model, clock).down_to(log.flies.sustained_s);
        let flight = reconstruct(log.flight, &options)
            .with_context(|| format!("cannot use flight log {}", path.display()))?;
        Ok((flight, log.findings))
    }
}

/// The error of a log that cannot be read. If wrong units explain the error, it names the command that corrects them.
fn units_first(path: &Path, error: logs::LogError) -> anyhow::Error {
    let hint = match &error {
        logs::LogError::Csv { hint, .. } | logs::LogError::Unusable { hint, .. } => hint,
        _ => "",
    };
    if !hint.contains("--mapping") {
        return error.into();
    }
    let (text, log) = (error.to_string(), quoted(path));
    let what = text.split("; first").next().unwrap_or_default();
    anyhow::anyhow!(
        "{what}): units look wrong (degrees, say)\n  to put it right: greylag logs info {log} --write-mapping mapping.toml\n  \
         then add: --mapping mapping.toml"
    )
}

/// Refuses a log with a problem (a finding that makes the results wrong). If a mapping can correct the log, the error names the
/// command that writes the mapping.
fn refuse_problems(path: &Path, findings: &[Finding]) -> Result<()> {
    let problems: Vec<&Finding> =
        findings.iter().filter(|f| f.severity == Severity::Problem).collect();
    if problems.is_empty() {
        return Ok(());
    }
    let log = quoted(path);
    // For a problem that a factor corrects, the message names only the column. The command in the message explains the problem.
    let said = |f: &&Finding| match &f.cure {
        Some(cure) => {
            format!("{} has a wrong unit or sign (read it times {:.4})", cure.column, cure.scale)
        }
        None => f.text.trim_end_matches('.').to_owned(),
    };
    let all: Vec<String> = problems.iter().map(said).collect();
    let right = "if the log is right all the same, use it with --despite-problems";
    let curable = problems.iter().all(|f| f.cure.is_some());
    match curable {
        true => bail!(
            "flight log {log}: {}. Every figure would be wrong; {right}\n  to put it right: greylag logs info {log} \
             --write-mapping mapping.toml\n  then add: --mapping mapping.toml",
            all.join("; ")
        ),
        false => {
            bail!("flight log {log}: {}. Every figure would be wrong; {right}", all.join("; "))
        }
    }
}

#[cfg(all(test, feature = "study"))]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        logs: LogArguments,
    }

    #[test]
    fn the_logs_are_inspected_as_they_were_read() {
        let words = "greylag --log a.csv 'b.csv --mapping m.toml --despite-problems";
        let line = Line::parse_from(words.split(' '));
        let command = r"greylag logs info a.csv ''\''b.csv' --mapping m.toml --model m/model.toml";
        assert_eq!(line.logs.inspected(Path::new("m/model.toml")), command);
    }
}
