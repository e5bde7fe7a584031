//! `greylag amend`: a model refitted to flights, missing effects added.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use comfy_table::{CellAlignment, Table};
use serde::Serialize;
use sha2::{Digest, Sha256};

use crate::commands::files::{self, Overwrite, shipped};
use crate::commands::intake::{Intake, LogArguments};
use crate::model::GreyBox;
use crate::model::edit::{Edit, Number};
use crate::physics::{effects, inputs};
use crate::sysid::amend::{self, Added, Amended, Amendment, Parameter, Refused};
use crate::sysid::compare::HorizonScore;
use crate::sysid::reconstruct::ActuatorClock;

/// Exit status when an effect was refused, a log left out, or flights contradict one another.
const IN_DOUBT: u8 = 2;
/// Characters of a file's SHA-256 that sources carry.
const PREFIX: usize = 12;
/// Longest name of a model, bytes.
const NAME: usize = 64;

/// Options of `greylag amend`.
#[derive(clap::Args)]
#[command(
    group = clap::ArgGroup::new("what").required(true),
    after_help = "Exit status: 0 done, 1 nothing was written, 2 written, but an effect was refused, a log was left out or flights contradict one another."
)]
pub struct Arguments {
    /// Model file to start from; it stays as it is.
    #[arg(long)]
    model: PathBuf,
    #[command(flatten)]
    logs: LogArguments,
    /// Logs to judge by, which the fit does not see; without them the last log, or, of a single one,
    /// its last third.
    #[arg(long, num_args = 1..)]
    hold_out: Vec<PathBuf>,
    /// Add the effects that a diagnosis of these logs asserts.
    #[arg(long, group = "what")]
    accept: bool,
    /// Add these effects of the catalogue, in this order.
    #[arg(long = "effect", value_name = "ID", num_args = 1.., group = "what")]
    effects: Vec<String>,
    /// Add nothing: fit the model's own coefficients.
    #[arg(long, group = "what")]
    tune_only: bool,
    /// Write effects into the model that the data refuse.
    #[arg(long)]
    accept_anyway: bool,
    /// Folder for model.toml, the airframe and amend.json; made if there is none.
    #[arg(long)]
    out: PathBuf,
    /// Replace files of the folder that exist.
    #[arg(long)]
    force: bool,
}

/// A log with its hash.
#[derive(Serialize)]
struct Hashed {
    path: String,
    sha256: String,
}

/// What goes into `amend.json`.
#[derive(Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    story: &'a Amendment,
    model_file: String,
    logs: &'a [Hashed],
    hold_out: &'a [Hashed],
}

/// Reads, reconstructs, fits; prints before and after; writes the model.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    let path = shipped(&arguments.model);
    let overwrite = arguments.force.into();
    let model = GreyBox::load(&path)?;
    let places = Places::new(&path, &arguments.out, overwrite)?;
    if let Some(twice) = arguments.hold_out.iter().find(|p| arguments.logs.paths.contains(p)) {
        bail!("{} cannot be fitted to and held out at once; name it in one place", twice.display());
    }
    for id in &arguments.effects {
        if effects::Kind::from_id(id).is_none() && inputs::Kind::from_id(id).is_none() {
            bail!("effect {id:?} is unknown to this program; `greylag effects list` names those it knows");
        }
        if model.has(id) {
            bail!("model {} has the effect {id} already; --tune-only refits its coefficients", model.name);
        }
    }
    let (paths, held) = divided(&arguments.logs.paths, &arguments.hold_out);
    let (logs, hold_out) = (hashed(&paths)?, hashed(&held)?);
    let clock = ActuatorClock::AsRecorded;
    let Intake { mut flights, mut notes, mut in_doubt } =
        arguments.logs.of(paths).take_in(&model, clock)?;
    let tests = if held.is_empty() {
        notes.push(format!("{}: fitted to its first two thirds, judged by the last", flights[0].name));
        let [first, last] = amend::split(&flights[0]);
        flights = vec![first];
        vec![last]
    } else {
        let more = arguments.logs.of(held).take_in(&model, clock)?;
        notes.extend(more.notes);
        in_doubt |= more.in_doubt;
        more.flights
    };
    let options = amend::Options {
        effects: wanted(arguments)?,
        refused: if arguments.accept_anyway { Refused::Kept } else { Refused::Left },
        ..amend::Options::default()
    };
    let mut amended = amend::amend(&model, &flights, &tests, &options, &|doing| eprintln!("{doing}"))?;
    let story = &mut amended.amendment;
    story.notes.splice(0..0, notes);
    in_doubt |= story.effects.iter().any(|e| !e.refused.is_empty());
    in_doubt |= story.notes.iter().any(|n| n.contains("by") && n.contains("alone: something differed"));
    print(story);
    let all_refused = !story.effects.is_empty() && !story.parameters.iter().any(|p| p.added);
    if all_refused {
        bail!(
            "no effect was accepted, so nothing was written; --tune-only writes the tuned model, \
             --accept-anyway writes a refused effect"
        );
    }
    places.write(&model, &amended, &logs, &hold_out, overwrite)?;
    Ok(if in_doubt { ExitCode::from(IN_DOUBT) } else { ExitCode::SUCCESS })
}

/// Logs to fit to, logs to judge by: the last one if none are named, none of a single one.
fn divided(logs: &[PathBuf], hold_out: &[PathBuf]) -> (Vec<PathBuf>, Vec<PathBuf>) {
    match (logs, hold_out) {
        ([first @ .., last], []) if !first.is_empty() => (first.to_vec(), vec![last.clone()]),
        _ => (logs.to_vec(), hold_out.to_vec()),
    }
}

fn wanted(arguments: &Arguments) -> Result<Vec<Added>> {
    if arguments.accept {
        bail!(
            "--accept needs a diagnosis, which this version cannot make yet; name the effects with \
             --effect"
        );
    }
    Ok(arguments.effects.iter().map(|id| Added { id: id.clone(), start: None }).collect())
}

fn hashed(paths: &[PathBuf]) -> Result<Vec<Hashed>> {
    let one = |path: &PathBuf| {
        let content = std::fs::read(path).with_context(|| {
            format!("cannot read flight log {}; name a file that exists", path.display())
        })?;
        let sha256 = Sha256::digest(content).iter().map(|b| format!("{b:02x}")).collect();
        Ok(Hashed { path: path.display().to_string(), sha256 })
    };
    paths.iter().map(one).collect()
}

/// Where things are read and written.
struct Places {
    original: PathBuf,
    airframe: PathBuf,
    folder: PathBuf,
}

impl Places {
    /// Fails at once if something could not be written later, so that no long work is lost to it.
    fn new(original: &Path, folder: &Path, overwrite: Overwrite) -> Result<Places> {
        let text = std::fs::read_to_string(original)?;
        let table: toml::Table = toml::from_str(&text)?;
        let named = table.get("airframe").and_then(toml::Value::as_str).unwrap_or_default();
        let airframe = original.parent().unwrap_or(Path::new(".")).join(named);
        std::fs::create_dir_all(folder).with_context(|| {
            format!("cannot make the folder {}; name another one", folder.display())
        })?;
        let places = Places { original: original.into(), airframe, folder: folder.into() };
        let original = std::fs::canonicalize(original)?;
        if std::fs::canonicalize(places.model()).is_ok_and(|p| p == original) {
            bail!("{} is the model to start from; name another folder", places.model().display());
        }
        files::writable(&places.model(), overwrite)?;
        files::writable(&places.json(), overwrite)?;
        if !places.airframe_is_there()? {
            files::writable(&places.own_airframe(), overwrite)?;
        }
        Ok(places)
    }

    fn model(&self) -> PathBuf {
        self.folder.join("model.toml")
    }

    fn json(&self) -> PathBuf {
        self.folder.join("amend.json")
    }

    /// The airframe beside the new model.
    fn own_airframe(&self) -> PathBuf {
        self.folder.join(self.airframe.file_name().unwrap_or("airframe.toml".as_ref()))
    }

    /// Whether the airframe stands beside the new model already, the same to the byte.
    fn airframe_is_there(&self) -> Result<bool> {
        let own = self.own_airframe();
        Ok(own.exists() && std::fs::read(own)? == std::fs::read(&self.airframe)?)
    }

    fn write(
        &self,
        before: &GreyBox,
        amended: &Amended,
        logs: &[Hashed],
        hold_out: &[Hashed],
        overwrite: Overwrite,
    ) -> Result<()> {
        let text = std::fs::read_to_string(&self.original)?;
        let own = self.own_airframe();
        let airframe = own.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let text = edit(before, amended, logs, airframe).apply(&text)?;
        if !self.airframe_is_there()? {
            files::write(&own, &std::fs::read_to_string(&self.airframe)?, overwrite)?;
        }
        files::write(&self.model(), &text, overwrite)?;
        let read = GreyBox::load(&self.model())?;
        if let Some(lost) = differs(&read, &amended.model) {
            std::fs::remove_file(self.model())?;
            bail!("the written model read back with another {lost}, and was removed; report this");
        }
        let document = Document {
            story: &amended.amendment,
            model_file: self.original.display().to_string(),
            logs,
            hold_out,
        };
        files::write(&self.json(), &(serde_json::to_string_pretty(&document)? + "\n"), overwrite)?;
        println!("wrote {}", self.model().display());
        Ok(())
    }
}

/// What changes in the model file.
fn edit(before: &GreyBox, amended: &Amended, logs: &[Hashed], airframe: String) -> Edit {
    let fitted = &amended.amendment.parameters;
    let known = before.coefficients().len();
    let number = |c: &crate::model::Named| {
        let sd = fitted.iter().find(|p| p.name == c.name).map(|p| p.sd);
        Number { name: c.name.clone(), value: c.value, sd }
    };
    let new = |name: &str| !before.coefficients().iter().any(|c| c.name == name);
    let source = |name: &str| {
        let id = name.split('.').next().unwrap_or_default();
        let prior = effects::Kind::from_id(id).map(|k| k.describe().source);
        prior.or_else(|| inputs::Kind::from_id(id).map(|k| k.describe().source)).unwrap_or("").into()
    };
    let all = amended.model.coefficients();
    let changed = all.iter().filter(|c| fitted.iter().any(|p| p.name == c.name && !p.added));
    let logs: Vec<String> = logs.iter().map(short).collect();
    let name = match known == all.len() {
        true => format!("{}-tuned", before.name),
        false => amended.model.name.clone(),
    };
    let shortened = format!("{}-amended", before.name.chars().take(40).collect::<String>());
    Edit {
        name: if name.len() <= NAME { name } else { shortened },
        airframe,
        changed: changed.map(number).collect(),
        added: all.iter().filter(|c| new(&c.name)).map(|c| (number(c), source(&c.name))).collect(),
        fitted_to: logs.join(", "),
    }
}

fn short(log: &Hashed) -> String {
    let name = Path::new(&log.path).file_name().unwrap_or_default().to_string_lossy().into_owned();
    format!("{name} (sha256 {})", &log.sha256[..PREFIX])
}

/// A coefficient that is not the same to the bit.
fn differs(read: &GreyBox, meant: &GreyBox) -> Option<String> {
    if read.coefficients().len() != meant.coefficients().len() {
        return Some("number of coefficients".into());
    }
    let same = |name: &str, value: f64| {
        read.coefficients().iter().any(|c| c.name == name && c.value.to_bits() == value.to_bits())
    };
    meant.coefficients().iter().find(|c| !same(&c.name, c.value)).map(|c| c.name.clone())
}

fn print(story: &Amendment) {
    println!("{}\n{}", parameter_table(&story.parameters), error_table(story));
    story.sentences.iter().for_each(|sentence| println!("{sentence}"));
    story.notes.iter().for_each(|note| println!("note: {note}"));
}

fn empty_table<const N: usize>(header: [&str; N]) -> Table {
    let mut table = Table::new();
    table.load_style(comfy_table::presets::UTF8_FULL_CONDENSED);
    table.set_header(header);
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

fn parameter_table(parameters: &[Parameter]) -> Table {
    let mut table = empty_table(["coefficient", "before", "fitted", "95 % from", "to", ""]);
    for p in parameters {
        let before = if p.added { "–".into() } else { number(p.prior) };
        let remark = match (p.at_bound, p.added) {
            (true, _) => "at its bound",
            (_, true) => "added",
            _ => "",
        };
        let [low, high] = p.ci95;
        let row = [p.name.clone(), before, number(p.value), number(low), number(high), remark.into()];
        table.add_row(row);
    }
    table
}

/// Free-run errors on the flights that the fit did not see.
fn error_table(story: &Amendment) -> Table {
    let header = ["RMSE / x_c on held-out flights", "1 s", "2 s", "5 s", "10 s", "diverged"];
    let mut table = empty_table(header);
    let rows = [("as given", &story.given), ("tuned", &story.before), ("amended", &story.after)];
    for (name, scores) in rows {
        let mut row = vec![name.to_string()];
        row.extend(scores.iter().map(error));
        let last = scores.iter().rfind(|s| s.runs > 0);
        row.push(last.map_or("–".into(), |s| format!("{}/{}", s.diverged, s.runs)));
        table.add_row(row);
    }
    table
}

fn error(score: &HorizonScore) -> String {
    if score.runs > 0 { format!("{:.5}", score.rmse_scaled) } else { "–".into() }
}

/// Four significant figures.
fn number(x: f64) -> String {
    match x.abs() {
        0.0 => "0".into(),
        size if !size.is_finite() => "–".into(),
        size if size < 1e-5 => format!("{x:.2e}"),
        size => {
            let places = (3 - size.log10().floor() as i32).clamp(0, 8) as usize;
            format!("{x:.places$}")
        }
    }
}
