//! `greylag effects`: shows the catalogue of physical effects, such as stall or a servo delay, that a model can include.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use comfy_table::Table;
use serde::Serialize;

use crate::commands::effect_files::{effect_paths, is_file};
use crate::commands::files::{self, JsonArgument, Overwrite, shipped};
use crate::commands::{given, outputs};
use crate::model::GreyBox;
use crate::physics::Channel;
use crate::physics::catalogue::on_air;
use crate::physics::effects::{Coefficient, Description};
use crate::physics::formula::expression::Function;
use crate::physics::formula::{Variable, Written, register};
use crate::physics::inputs;
use crate::report::{EffectReport, effect_facts};
use crate::sysid::flight_path::measurement_effects::MEASUREMENT_EFFECTS;
use crate::sysid::signature::{SignatureError, signature};

/// Options of `greylag effects`.
#[derive(clap::Args)]
pub struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(clap::Subcommand)]
enum What {
    /// List all effects, one per line.
    List(JsonArgument),
    /// Describe one effect of the catalogue or of a file in full. With --report, draw its signature: how it changes forces,
    /// moments and the response to a manoeuvre.
    Show(Show),
    /// List the variables and functions of formulas in effect files.
    Variables,
}

#[derive(clap::Args)]
struct Show {
    /// The effect's id, as `greylag effects list` names it, or an effect file.
    #[arg(value_name = "ID|FILE")]
    id: String,
    /// Write an HTML page with the description and the signature of the effect.
    #[arg(long)]
    report: Option<PathBuf>,
    /// Model for which the signature is computed.
    #[arg(long, default_value = "params/x8/jsbsim.toml")]
    model: PathBuf,
    /// Replace the files if they exist.
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    json: JsonArgument,
}

/// An effect as JSON.
#[derive(Serialize)]
struct Document {
    id: &'static str,
    description: &'static str,
    acts_on: &'static str,
    channels: String,
    parameters: Vec<Parameter>,
}

/// A parameter of an effect.
#[derive(Serialize)]
struct Parameter {
    name: &'static str,
    meaning: &'static str,
    unit: &'static str,
    bounds: (f64, f64),
}

impl Document {
    fn new(place: Place, about: &Description) -> Document {
        let parameter = |c: &Coefficient| Parameter {
            name: c.name,
            meaning: c.meaning,
            unit: c.unit,
            bounds: c.bounds,
        };
        Document {
            id: about.id,
            description: about.description,
            acts_on: place.words(),
            channels: channels(place, about),
            parameters: about.coefficients.iter().map(parameter).collect(),
        }
    }
}

/// Schema of the JSON output.
const SCHEMA: &str = "greylag.effects/1";

/// The catalogue as JSON.
#[derive(Serialize)]
struct Listed {
    effects: Vec<Document>,
}

/// What an effect acts on. The list of effects has the order of these variants.
#[derive(Clone, Copy, PartialEq)]
enum Place {
    Forces,
    Deflections,
    Measurement,
    Prior,
}

impl Place {
    fn words(self) -> &'static str {
        match self {
            Place::Forces => "forces, moments or the body",
            Place::Deflections => "deflections",
            Place::Measurement => "measurement",
            Place::Prior => "forces or moments, as part of a prior",
        }
    }
}

/// All effects of the program, with what they act on.
fn catalogue() -> Vec<(Place, Description)> {
    let (missing, prior): (Vec<_>, Vec<_>) = on_air().partition(|about| about.entry.is_some());
    let inputs = inputs::Kind::ALL.iter().map(|kind| kind.describe());
    let at = |place| move |about| (place, about);
    missing
        .into_iter()
        .map(at(Place::Forces))
        .chain(inputs.map(at(Place::Deflections)))
        .chain(MEASUREMENT_EFFECTS.into_iter().map(at(Place::Measurement)))
        .chain(prior.into_iter().map(at(Place::Prior)))
        .collect()
}

/// Prints the list, one effect or the variables of formulas. Writes the page of the effect.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    match &arguments.what {
        What::List(json) => {
            json.writable(Overwrite::New)?;
            if !json.takes_stdout() {
                print!("{}", list());
            }
            let all = catalogue();
            let effects = all.iter().map(|(place, about)| Document::new(*place, about)).collect();
            json.write(SCHEMA, &Listed { effects }, Overwrite::New)?;
        }
        What::Show(show) => self::show(show)?,
        What::Variables => print!("{}", variables()),
    }
    Ok(ExitCode::SUCCESS)
}

fn list() -> String {
    let mut table = Table::new();
    table.load_style(comfy_table::presets::UTF8_FULL_CONDENSED);
    table.set_content_arrangement(comfy_table::ContentArrangement::Dynamic);
    table.set_header(["effect", "acts on", "channels", "parameters", "what it is"]);
    for (place, about) in catalogue() {
        let unit = |unit: &str| if unit.is_empty() { "".into() } else { format!(" ({unit})") };
        let parameters: Vec<String> =
            about.coefficients.iter().map(|c| format!("{}{}", c.name, unit(c.unit))).collect();
        table.add_row([
            about.id.into(),
            place.words().into(),
            channels(place, &about),
            parameters.join(", "),
            about.description.to_owned(),
        ]);
    }
    format!(
        "{table}\n`greylag effects show ID` describes one in full; --report draws its signature.\n"
    )
}

/// The channels of an effect as text: for most effects the letters of its forces and moments, such as `D L m`.
fn channels(place: Place, about: &Description) -> String {
    let letter = |channel: &Channel| match channel {
        Channel::Drag => "D",
        Channel::Lift => "L",
        Channel::Side => "Y",
        Channel::BodyX => "T",
        Channel::Roll => "l",
        Channel::Pitch => "m",
        Channel::Yaw => "n",
    };
    match (place, about.entry) {
        (Place::Deflections, _) => "all with deflections".into(),
        (Place::Measurement, _) => "kinematics".into(),
        (_, Some(entry)) => entry.channels.iter().map(letter).collect::<Vec<_>>().join(" "),
        (_, None) => about.id.split('_').next().unwrap_or_default().into(),
    }
}

/// Text with the variables and functions that a formula may contain.
fn variables() -> String {
    let mut text = String::from("variables\n");
    for v in Variable::ALL {
        text += &format!("  {:12} {:18} {}\n", v.name(), v.alias(), v.meaning());
    }
    text += "functions, in addition to + - * / ^\n";
    for f in Function::ALL.iter().filter(|f| !f.is_operator()) {
        text += &format!("  {:12} {}\n", f.name(), f.meaning());
    }
    text + "  clamp        clamp(x, low, high)\n  table        table(x; x1:y1, x2:y2, …): linear between, constant beyond\n"
}

/// The effect with the id `name`, or the effect in the file `name`.
fn named(name: &str) -> Result<(Place, Description)> {
    if is_file(name) {
        let read = register::load(&shipped(Path::new(name)))?;
        let [effect] = read[..] else { bail!("{name} is not one effect file; name one") };
        return Ok((Place::Forces, effect.about));
    }
    let mut catalogue = catalogue();
    let Some(found) = catalogue.iter().position(|(_, about)| about.id == name) else {
        let like = |about: &Description| strsim::jaro_winkler(about.id, name);
        let (_, nearest) = catalogue
            .iter()
            .max_by(|a, b| like(&a.1).total_cmp(&like(&b.1)))
            .context("the catalogue has no effect")?;
        bail!(
            "there is no effect {name}; the nearest id is {}, `greylag effects list` has all",
            nearest.id
        );
    };
    Ok(catalogue.swap_remove(found))
}

/// Prints the properties that only effects from files have.
fn written(effect: &Written) {
    let names: Vec<&str> = effect.variables().iter().map(|v| v.name()).collect();
    let kinks = effect.kinks();
    println!("  {:20} {:?}", "status", effect.status);
    println!("  {:20} {}", "depends on", names.join(", "));
    println!(
        "  {:20} {}",
        "kinks",
        if kinks.is_empty() { "none".into() } else { kinks.join(", ") }
    );
    println!("  {:20} {}", "operations", effect.operations());
}

fn show(show: &Show) -> Result<()> {
    let (place, about) = named(&show.id)?;
    let overwrite = show.force.into();
    // Both outputs are checked before either is written. Otherwise the JSON file could be written and the page refused, and a
    // second attempt would be refused because the JSON file exists.
    let written = show.json.path().into_iter().chain(&show.report);
    let own = effect_paths(std::slice::from_ref(&show.id));
    outputs::check(written, [given::files(&show.model), own].concat(), overwrite)?;
    let listed = Listed { effects: vec![Document::new(place, &about)] };
    show.json.write(SCHEMA, &listed, overwrite)?;
    let channels = channels(place, &about);
    if !show.json.takes_stdout() {
        print(place, &about, &channels);
    }
    let Some(path) = &show.report else { return Ok(()) };
    let model = GreyBox::load(&shipped(&show.model))?;
    let values = example(&model, &about);
    if values.is_empty() && place == Place::Prior {
        bail!("model {} has no {}; name a model that has it (--model)", model.name, about.id);
    }
    let drawn = match signature(&model, &about, &values) {
        Err(SignatureError::Measurement { .. }) => None,
        other => Some(other?),
    };
    let report = EffectReport {
        about,
        channels,
        place: place.words(),
        signature: drawn.as_ref(),
        model: model.name,
        values,
    };
    files::write(path, &report.page().render(), overwrite)
}

/// Prints the description and the parameters of an effect.
fn print(place: Place, about: &Description, channels: &str) {
    println!("{}", about.id);
    for [name, text] in effect_facts(about, place.words(), channels) {
        println!("  {name:20} {text}");
    }
    println!("  parameters");
    for c in about.coefficients {
        let (low, high) = c.bounds;
        let line = format!("    {:18} {}; {low} to {high} {}", c.name, c.meaning, c.unit);
        println!("{}", line.trim_end());
    }
    if let Some(table) = about.table {
        println!("    {table:18} table over alpha_rad, which only a model file can give");
    }
    if let Some(effect) = register::find(about.id) {
        written(effect);
    }
}

/// Coefficients for the signature: the example values of the catalogue. An effect without example values, such as linear
/// lift, takes its coefficients from `model`.
fn example(model: &GreyBox, about: &Description) -> Vec<f64> {
    match about.entry {
        Some(entry) => entry.example.into(),
        None => {
            let own = format!("{}.", about.id);
            let named = model.coefficients().iter();
            named.filter(|c| c.name.starts_with(&own)).map(|c| c.value).collect()
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::commands::command_of;

    #[test]
    fn nothing_is_written_if_the_page_exists() {
        let folder = tempfile::tempdir().unwrap();
        let [page, json] = ["page.html", "effect.json"].map(|name| folder.path().join(name));
        std::fs::write(&page, "mine").unwrap();
        let words = ["effects", "show", "drag_beta2", "--report"];
        let mut line: Vec<std::ffi::OsString> = words.map(Into::into).into();
        line.extend([page.into_os_string(), "--json".into(), json.clone().into_os_string()]);
        assert!(crate::commands::run(command_of(&line).unwrap()).is_err());
        assert!(!json.exists());
    }
}
