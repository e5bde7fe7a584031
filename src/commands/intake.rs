//! Options that name flight logs, and the reconstruction of the flights in these logs.
//!
//! A reconstruction estimates states, sensor errors and wind from kinematics alone. A finding is a suspected error of a log,
//! for instance a wrong unit.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use super::mapping_file::converted;
use super::{bar, given, mistake};
use crate::logs::finding::{Cure, Finding, Severity};
use crate::logs::mapping::Mapping;
use crate::logs::phases::Flying;
use crate::logs::quoted;
use crate::logs::sources::Asked;
use crate::logs::{self, Log, csv::Tolerance};
use crate::model::GreyBox;
use crate::sysid::flight_path::installation::{Prior, share};
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
    /// Files of the flights, in the order of the command line.
    pub used: Vec<PathBuf>,
    /// Priors of the constants of the installation for further flights of the aircraft, such as those held out.
    pub installation: Vec<Prior>,
}

/// What the reconstruction of a flight takes besides the log.
#[derive(Clone, Copy)]
struct Setting<'a> {
    model: &'a GreyBox,
    clock: ActuatorClock,
    /// Priors from other flights of the aircraft.
    priors: &'a [Prior],
}

impl Setting<'_> {
    /// The reconstructed flight `log` with the name `name` from the file `path`.
    fn reconstruct(&self, path: &Path, name: &str, log: Log) -> Result<Reconstruction> {
        let options = flight_path::Options::of(name, self.model, self.clock);
        let options = options.down_to(log.flies.sustained_s).expecting(self.priors);
        reconstruct(log.flight, &options)
            .with_context(|| format!("cannot use flight log {}", path.display()))
    }
}

impl Intake {
    fn add(&mut self, flight: Reconstruction, name: &str, findings: &[Finding]) {
        self.flights.push(flight);
        self.in_doubt |= findings.iter().any(|f| f.severity == Severity::Problem);
        self.notes.extend(findings.iter().map(|f| f.noted(name)));
    }

    /// Gives all flights the constants of the sensors' installation that only some of them show. `places` has the file of each
    /// flight, and the flight's index in that file. A log is read again, because the first reconstruction has dropped it.
    fn share_installation(
        &mut self,
        places: &[(&Path, usize)],
        reading: &logs::Options,
        setting: &Setting,
    ) -> Result<()> {
        let names: Vec<String> = self.flights.iter().map(|f| f.name.clone()).collect();
        let again = |k: usize, priors: &[Prior]| -> Result<Reconstruction> {
            let ((path, place), name) = (places[k], &names[k]);
            if !bar::is_silent() {
                eprintln!(
                    "reconstructing {name} again, with the installation that other flights show"
                );
            }
            let log = logs::flights(path, reading)?.into_iter().nth(place);
            let log = log.with_context(|| format!("{} has changed", path.display()))?;
            let (Setting { model, clock, .. }, priors) =
                (*setting, [setting.priors, priors].concat());
            Setting { model, clock, priors: &priors }.reconstruct(path, name, log)
        };
        let installation = share(&mut self.flights, again)?;
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        self.notes.extend(installation.sentences(&names));
        self.installation = [setting.priors.to_vec(), installation.priors(None)].concat();
        Ok(())
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

    /// Those of the logs that are in `used`, with the same reading options.
    pub fn among(&self, used: &[PathBuf]) -> LogArguments {
        let paths = self.paths.iter().filter(|path| used.contains(path)).cloned().collect();
        LogArguments { paths, ..self.clone() }
    }

    /// All files that the options name: the logs and the mapping.
    pub fn files(&self) -> impl Iterator<Item = &PathBuf> {
        self.paths.iter().chain(&self.reading.mapping)
    }

    /// The logs and the reading options as words of a command line, with a leading space.
    pub fn words(&self) -> String {
        let logs: String = self.paths.iter().map(|log| format!(" {}", quoted(log))).collect();
        format!(" --log{logs}{}", self.reading.words())
    }

    /// The command that inspects the logs. The file `model` states from which airspeed on the aircraft flies. The command lacks the
    /// option for logs with problems, because it names these problems.
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

    /// Reads and reconstructs the logs. A log that cannot be used is skipped with an error message. A constant of the sensors'
    /// installation that only some of the flights show is used for all of them.
    pub fn take_in(&self, model: &GreyBox, clock: ActuatorClock) -> Result<Intake> {
        self.reading.take_in(&self.paths, model, clock)
    }

    /// Reads and reconstructs the logs, which were flown with the `installation` of flights that were taken in before.
    pub fn take_in_as(
        &self,
        model: &GreyBox,
        clock: ActuatorClock,
        installation: &[Prior],
    ) -> Result<Intake> {
        self.reading.take_in_all(&self.paths, &Setting { model, clock, priors: installation })
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

    /// Reads and reconstructs the logs `paths`. A log that cannot be used is skipped with an error message. A constant of the
    /// sensors' installation that only some of the flights show is used for all of them.
    ///
    /// # Errors
    /// If the mapping cannot be read, or no log can be used.
    pub fn take_in(
        &self,
        paths: &[PathBuf],
        model: &GreyBox,
        clock: ActuatorClock,
    ) -> Result<Intake> {
        self.take_in_all(paths, &Setting { model, clock, priors: &[] })
    }

    fn take_in_all(&self, paths: &[PathBuf], setting: &Setting) -> Result<Intake> {
        let flies = Flying::from(setting.model.airframe.envelope.flying_from_mps());
        let mut reading = self.options()?;
        reading.flies = reading.mapping.flies(Some(flies));
        reading.mapping = reading.mapping.with_mixer(setting.model.airframe.mixer.clone());
        let (mut intake, mut places) = (Intake::default(), Vec::new());
        let cure: fn(&Path) -> String = if paths.len() > 1 { converted } else { mapped };
        for (k, (path, name)) in paths.iter().zip(logs::names(paths)).enumerate() {
            if !bar::is_silent() {
                let of = format!("log {} of {}: ", k + 1, paths.len());
                let of = if paths.len() > 1 { of.as_str() } else { "" };
                eprintln!("{of}reading and reconstructing {name}");
            }
            let read = given::log(path).and_then(|()| {
                logs::flights(path, &reading).map_err(|e| units_first(path, cure, e))
            });
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
                let usable = self.usable(path, &log, cure);
                match usable.and_then(|()| self.reconstruct_one(path, &name, log, setting)) {
                    Ok((flight, findings)) => {
                        intake.add(flight, &name, &findings);
                        places.push((path.as_path(), k));
                    }
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
        intake.share_installation(&places, &reading, setting)?;
        intake.used = places.iter().map(|(path, _)| path.to_path_buf()).collect();
        intake.used.dedup();
        Ok(intake)
    }

    /// Refuses a log with problems, unless the user wants it. `cure` is the remedy for the file at `path`.
    fn usable(&self, path: &Path, log: &Log, cure: fn(&Path) -> String) -> Result<()> {
        if self.despite_problems { Ok(()) } else { refuse_problems(path, log, cure) }
    }

    /// The reconstructed flight of a log, with the findings about the file.
    fn reconstruct_one(
        &self,
        path: &Path,
        name: &str,
        log: Log,
        setting: &Setting,
    ) -> Result<(Reconstruction, Vec<Finding>)> {
        let findings = log.findings.clone();
        Ok((setting.reconstruct(path, name, log)?, findings))
    }
}

/// The remedy for a single log at `path`: the command that writes a mapping, and the option that reads it.
fn mapped(path: &Path) -> String {
    format!(
        "to put it right: greylag logs info {} --write-mapping mapping.toml\n  then add: --mapping mapping.toml",
        quoted(path)
    )
}

/// The error of a log that cannot be read. If wrong units explain the error, it names the remedy `cure`.
fn units_first(path: &Path, cure: fn(&Path) -> String, error: logs::LogError) -> anyhow::Error {
    let hint = match &error {
        logs::LogError::Csv { hint, .. } | logs::LogError::Unusable { hint, .. } => hint,
        _ => "",
    };
    if !hint.contains("--mapping") {
        return error.into();
    }
    let text = error.to_string();
    let what = text.split("; first").next().unwrap_or_default();
    anyhow::anyhow!("{what}): units look wrong (degrees, say)\n  {}", cure(path))
}

/// Refuses a log with a problem (a finding that makes the results wrong). If a mapping can correct the log, the error names the
/// remedy `cure`. The option for logs with problems is named only for a log with a flight, for no other can be used.
fn refuse_problems(path: &Path, log: &Log, cure: fn(&Path) -> String) -> Result<()> {
    let problems: Vec<&Finding> =
        log.findings.iter().filter(|f| f.severity == Severity::Problem).collect();
    if problems.is_empty() {
        return Ok(());
    }
    // For a problem that a factor corrects, the message names only the column. The command in the message explains the problem.
    let said = |f: &&Finding| match &f.cure {
        Some(Cure { column, exchanged_with: Some(other), .. }) => {
            format!("{column} and {other} are exchanged")
        }
        Some(Cure { column, scale, offset, .. }) => {
            let plus = if *offset == 0.0 { String::new() } else { format!(" plus {offset}") };
            format!("{column} has a wrong unit or sign (read it times {scale:.4}{plus})")
        }
        None => f.text.trim_end_matches('.').to_owned(),
    };
    let all: Vec<String> = problems.iter().map(said).collect();
    let right = ". Every figure would be wrong; if the log is right all the same, use it with --despite-problems";
    let right = if log.flown_s() > 0.0 { right } else { "" };
    let curable = problems.iter().all(|f| f.cure.is_some());
    let cure = if curable { format!("\n  {}", cure(path)) } else { String::new() };
    bail!("flight log {}: {}{right}{cure}", quoted(path), all.join("; "))
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
