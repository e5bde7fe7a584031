//! `greylag logs`: shows, converts and reconstructs flight logs.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use clap::Subcommand;

use crate::commands::files;
use crate::commands::mapping_file::mapping;
use crate::commands::mistake;
use crate::commands::status::IN_DOUBT;
use crate::commands::{given, outputs};
use crate::logs::finding::Severity;
use crate::logs::info::Info;
use crate::logs::mapping::Mapping;
use crate::logs::phases::{Flying, PhaseKind};
use crate::logs::quoted;
use crate::logs::sources::Asked;
use crate::logs::{Flight, Log, Options, csv};
use crate::model::GreyBox;
use crate::physics::Airframe;
use crate::sysid::flight_path::reconstruction::Reconstruction;
use crate::sysid::flight_path::{self, ActuatorClock};

/// Options of `greylag logs`.
#[derive(clap::Args)]
pub struct Arguments {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Subcommand)]
enum Verb {
    /// Show what logs hold, with rates and gaps, and which data each log lacks for which purpose. The
    /// exit status is 3 if a log cannot be read or has a problem that makes its numbers wrong.
    Info {
        /// CSV, PX4 ULog, ArduPilot .bin, MAVLink .tlog or ROS 2 bag (.mcap), distinguished by content.
        #[arg(required = true)]
        files: Vec<PathBuf>,
        /// Print JSON: one object, or for several logs a list of objects.
        #[arg(long)]
        json: bool,
        /// Write a mapping file that corrects the wrong units and signs that were found. Other commands
        /// read it by --mapping.
        #[arg(long, value_name = "FILE", conflicts_with = "json")]
        write_mapping: Option<PathBuf>,
        /// Model file of the aircraft, whose envelope sets the airspeed above which rows count as
        /// flight [default: no model, 7 m/s].
        #[arg(long)]
        model: Option<PathBuf>,
        #[command(flatten)]
        reading: Reading,
    },
    /// Write a log of any format as a CSV table.
    Convert {
        /// CSV, PX4 ULog, ArduPilot .bin, MAVLink .tlog or ROS 2 bag (.mcap), distinguished by content.
        input: PathBuf,
        /// The CSV table to write.
        output: PathBuf,
        /// Model file of the aircraft, whose envelope sets the airspeed above which rows count as
        /// flight [default: no model, 7 m/s].
        #[arg(long)]
        model: Option<PathBuf>,
        /// Replace the table if it exists.
        #[arg(long)]
        force: bool,
        #[command(flatten)]
        reading: Reading,
    },
    /// Reconstruct the flight path of a log: write the states without sensor errors as a CSV table and
    /// print sensor errors, wind and delays between sensors with their standard deviations.
    Reconstruct {
        /// CSV, PX4 ULog, ArduPilot .bin, MAVLink .tlog or ROS 2 bag (.mcap), distinguished by content.
        input: PathBuf,
        /// The CSV table to write, with the columns of a Greylag log.
        output: PathBuf,
        /// Model file of the aircraft. Its actuators turn logged commands into deflections.
        #[arg(long, default_value = "params/x8/prior.toml")]
        model: PathBuf,
        /// Replace the table if it exists.
        #[arg(long)]
        force: bool,
        #[command(flatten)]
        reading: Reading,
    },
}

#[derive(clap::Args)]
struct Reading {
    /// A TOML file that assigns fields of the logs to columns.
    #[arg(long)]
    mapping: Option<PathBuf>,
    /// Airframe file whose [surfaces] and [motors] state what the logged actuators drive.
    #[arg(long, value_name = "FILE")]
    airframe: Option<PathBuf>,
    /// Read the log no matter how many of its rows are unusable.
    #[arg(long)]
    lenient: bool,
    /// Read this instance of a topic instead of the one that the reader chooses: airspeed=1, or
    /// ATTITUDE=2/1 (system/component).
    #[arg(long, value_name = "TOPIC=INSTANCE")]
    source: Vec<Asked>,
}

impl Reading {
    /// The settings for reading logs. If `model` is given, its envelope sets the airspeed above which the aircraft counts as
    /// flying, and its mixer applies unless `--airframe` has one.
    fn options(&self, model: Option<&GreyBox>) -> Result<Options> {
        let mapping = self.mapping.as_deref().map(Mapping::load).transpose()?.unwrap_or_default();
        let airframe = self.airframe.as_deref().map(|path| Airframe::load(&files::shipped(path)));
        let own = airframe.transpose()?.and_then(|airframe| airframe.mixer);
        let mapping =
            mapping.with_mixer(own.or_else(|| model.and_then(|m| m.airframe.mixer.clone())));
        let tolerance = if self.lenient { csv::Tolerance::Lenient } else { csv::Tolerance::Strict };
        let flies = model.map(|m| Flying::from(m.airframe.envelope.flying_from_mps()));
        let (flies, sources) = (mapping.flies(flies), self.source.clone());
        Ok(Options { tolerance, mapping, flies, sources })
    }

    /// All files that are read with the log `input`: itself, the mapping, the airframe and the files of `model`.
    fn files(&self, input: &Path, model: Option<&PathBuf>) -> Vec<PathBuf> {
        let model = model.map_or_else(Vec::new, |path| given::files(path));
        let airframe = self.airframe.as_deref().map(files::shipped);
        let named = self.mapping.iter().cloned().chain(airframe);
        model.into_iter().chain(named).chain([input.to_owned()]).collect()
    }
}

/// Runs the chosen subcommand.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    match &arguments.verb {
        Verb::Info { files, json, write_mapping, model, reading } => {
            if let Some(path) = write_mapping {
                files::writable(path, files::Overwrite::New)?;
            }
            let model =
                model.as_deref().map(|path| GreyBox::load(&files::shipped(path))).transpose()?;
            let options = reading.options(model.as_ref())?;
            let (logs, broken) = inspected(files, &options)?;
            let all: Vec<Info> = logs.iter().map(|(_, log)| Info::of(log)).collect();
            match (json, &all[..]) {
                (true, [only]) if !broken => println!("{}", serde_json::to_string_pretty(only)?),
                (true, all) => println!("{}", serde_json::to_string_pretty(all)?),
                (false, all) => print_all(all),
            }
            if let Some(path) = write_mapping {
                let files = logs.into_iter().map(|(file, _)| file);
                write_mapping_file(path, &files.zip(all).collect::<Vec<_>>())?;
                return Ok(status(broken.then_some(Severity::Problem)));
            }
            let worst = all.iter().map(Info::severity).max();
            Ok(status(if broken { Some(Severity::Problem) } else { worst }))
        }
        Verb::Convert { input, output, model, force, reading } => {
            outputs::check([output], reading.files(input, model.as_ref()), (*force).into())?;
            let model =
                model.as_deref().map(|path| GreyBox::load(&files::shipped(path))).transpose()?;
            let log = crate::logs::load(input, &reading.options(model.as_ref())?)?;
            convert(&log, output, *force)
        }
        Verb::Reconstruct { input, output, model, force, reading } => {
            outputs::check([output], reading.files(input, Some(model)), (*force).into())?;
            let model = GreyBox::load(&files::shipped(model))?;
            let log = crate::logs::load(input, &reading.options(Some(&model))?)?;
            let options =
                flight_path::Options::of(&log.flight.name, &model, ActuatorClock::Estimated)
                    .down_to(log.flies.sustained_s);
            let flight = flight_path::reconstruct(&log.flight, &options)?;
            csv_file(&flight.to_flight(), output, *force)?;
            log.findings.iter().for_each(|finding| eprintln!("{finding}"));
            print_reconstruction(&flight, output);
            Ok(ExitCode::SUCCESS)
        }
    }
}

/// The flights of the logs in `files`, each with its file, and whether any log could not be read. Errors of such logs are
/// printed to standard error.
///
/// # Errors
/// The error of the last log if none can be read.
fn inspected(files: &[PathBuf], options: &Options) -> Result<(Vec<(PathBuf, Log)>, bool)> {
    let (mut logs, mut broken) = (Vec::new(), Vec::new());
    for file in files {
        match crate::logs::inspect_all(file, options) {
            Ok(flights) => logs.extend(flights.into_iter().map(|log| (file.clone(), log))),
            Err(why) => broken.push(anyhow::Error::from(why)),
        }
    }
    let last = if logs.is_empty() { broken.pop() } else { None };
    broken.iter().for_each(|error| eprintln!("greylag: {}", mistake::text(error)));
    match last {
        Some(error) => Err(error),
        None => Ok((logs, !broken.is_empty())),
    }
}

/// Writes the mapping file that corrects the wrong units and signs found in `logs`. Corrections that the user must choose or write
/// are only named.
fn write_mapping_file(path: &Path, logs: &[(PathBuf, Info)]) -> Result<()> {
    let findings = || logs.iter().flat_map(|(_, info)| &info.findings);
    let by_hand = findings().any(|f| f.cure.is_none() && f.text.contains("--mapping FILE"));
    let Some(text) = mapping(logs)? else {
        if by_hand {
            bail!(
                "no mapping was written, for the corrections must be chosen by hand: write the right lines of those above into a mapping, below the lines `schema = 1` and `[columns]`"
            );
        }
        bail!("no factor puts anything of these logs right, so no mapping was written");
    };
    files::write(path, &text, files::Overwrite::New)?;
    println!("\nwrote {}; add: --mapping {}", path.display(), quoted(path));
    if by_hand {
        println!("not in it: corrections that must be chosen by hand (see the problems above)");
    }
    Ok(())
}

fn csv_file(flight: &Flight, output: &Path, force: bool) -> Result<()> {
    let mut bytes = Vec::new();
    csv::write(flight, &mut bytes)?;
    let text = String::from_utf8(bytes).context("the table is no text")?;
    files::write(output, &text, force.into())
}

/// Number of decimals for the standard deviation `sd`: enough for one or two significant digits, at least 5, at most 9.
fn decimals(sd: f64) -> usize {
    if sd > 0.0 { (1.0 - sd.log10()).ceil().clamp(5.0, 9.0) as usize } else { 5 }
}

fn print_reconstruction(flight: &Reconstruction, output: &Path) {
    let rows: usize = flight.segments.iter().map(|s| s.instants.len()).sum();
    println!("{rows} reconstructed samples of {} in {}", flight.name, output.display());
    for n in &flight.nuisances {
        let moved = n.prior.map(|p| {
            let d = decimals(p.sd);
            format!("prior {}, sd {:.d$}, moved by {:.1} of it", p.value, p.sd, n.moved())
        });
        let d = decimals(n.sd);
        let found = format!("{:<22} {:>11.d$} ± {:.d$} {}", n.name, n.value, n.sd, n.unit);
        println!("{found:<50} {}", moved.unwrap_or_default());
    }
    flight.notes.iter().for_each(|note| println!("{note}"));
}

fn convert(log: &Log, output: &Path, force: bool) -> Result<ExitCode> {
    csv_file(&log.flight, output, force)?;
    log.findings.iter().for_each(|finding| eprintln!("{finding}"));
    println!("{} rows of {} in {}", log.flight.samples.len(), log.flight.name, output.display());
    Ok(status(Some(Info::of(log).severity())))
}

/// Exit status for the severity of the most severe finding.
fn status(worst: Option<Severity>) -> ExitCode {
    match worst {
        Some(Severity::Problem) => ExitCode::from(IN_DOUBT),
        _ => ExitCode::SUCCESS,
    }
}

fn print_all(all: &[Info]) {
    for (k, info) in all.iter().enumerate() {
        if k > 0 {
            println!();
        }
        print(info);
    }
}

fn print(info: &Info) {
    let life = info.life.as_ref().map(|life| format!(" ({life})")).unwrap_or_default();
    println!("{}{life}: {}", info.name, info.format.name());
    if let Some(vehicle) = &info.vehicle {
        println!("{}, by {}", vehicle.kind.name(), vehicle.by);
    }
    println!(
        "{} rows, {:.3} to {:.3} s ({:.1} s), {:.1} Hz; {:.1} s in flight; {} rows dropped",
        info.rows,
        info.from_s,
        info.to_s,
        info.to_s - info.from_s,
        info.rate_hz,
        info.flight_s,
        info.dropped_rows
    );
    println!("\nPhases");
    for phase in info.phases.iter().take(SHOWN) {
        let kind = if phase.kind == PhaseKind::Flight { "in flight" } else { "on ground" };
        println!("  {:>10.2} to {:>10.2} s  {kind}  {} rows", phase.from_s, phase.to_s, phase.rows);
    }
    more(info.phases.len());
    for (from, to) in info.hovers.iter().take(SHOWN) {
        println!("  {from:>10.2} to {to:>10.2} s  hover or transition, left out");
    }
    more(info.hovers.len());
    if !info.gaps.is_empty() {
        println!("\nGaps");
        for (start, length) in info.gaps.iter().take(SHOWN) {
            println!("  {length:.2} s at {start:.2} s");
        }
        more(info.gaps.len());
    }
    print_sources(info);
    println!("\nChannels");
    let mut table = comfy_table::Table::new();
    table.load_style(comfy_table::presets::NOTHING);
    table.set_header(["column", "from", "rate", "samples", "longest gap"]);
    for channel in &info.channels {
        table.add_row([
            channel.columns.join(", "),
            channel.origin.clone(),
            format!("{:.1} Hz", channel.rate_hz),
            channel.samples.to_string(),
            format!("{:.2} s", channel.largest_gap_s),
        ]);
    }
    println!("{table}");
    print_purposes(info);
    if !info.findings.is_empty() {
        println!("\nTo know");
        info.findings.iter().for_each(|finding| println!("  {finding}"));
    }
}

/// Prints which purposes the log serves, and what it lacks for the others.
fn print_purposes(info: &Info) {
    println!("\nServes for");
    for purpose in &info.purposes {
        let verdict = match (&purpose.missing[..], &purpose.slow[..]) {
            ([], []) => "yes".to_owned(),
            ([], slow) => format!("no: {}", slow.join(", ")),
            (missing, _) => format!("no, for want of {}", missing.join(", ")),
        };
        println!("  {}: {verdict}", purpose.name);
        purpose.instead.iter().for_each(|x| println!("      with {x}"));
    }
}

/// Prints the instances of the topics that occur several times in the log.
fn print_sources(info: &Info) {
    if info.sources.is_empty() {
        return;
    }
    println!("\nSources");
    for source in &info.sources {
        println!(
            "  {} {}: {:.1} Hz, {:.2} to {:.2} s, {}{}",
            source.topic,
            source.instance,
            source.rate_hz,
            source.from_s,
            source.to_s,
            if source.moves { "moves" } else { "never changes" },
            if source.read { ", read" } else { "" }
        );
    }
}

/// Largest number of phases and of gaps that are printed. `--json` has all.
const SHOWN: usize = 12;

fn more(count: usize) {
    if count > SHOWN {
        println!("  … and {} more", count - SHOWN);
    }
}
