//! `greylag mystery`: makes a blind test of `greylag diagnose`, and later reveals the answer.
//!
//! It flies the simulated aircraft with one effect (a term of the forces or moments) that the supplied model lacks. It writes the
//! logs, the model and the answer (the effect, in coded form) into a folder.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, anyhow, bail};
use comfy_table::{CellAlignment, Table};
use greylag_sitl::plant::PlantOptions;
use serde::{Deserialize, Serialize};

use crate::commands::choices;
use crate::commands::files::shipped;
use crate::control::{ControllerKind, build};
use crate::logs::csv;
use crate::model::GreyBox;
use crate::physics::catalogue;
use crate::physics::formula::register;
use crate::sim::installation::Installation;
use crate::sim::missing::{Craft, Missing, MissingKind};
use crate::sim::starting_model::starting_model;
use crate::sim::trial::{Subject, Trial};

/// Name of the file with the answer in coded form.
const SEALED: &str = "answer.sealed";
/// File name of the diagnosis that is compared with the answer.
const DIAGNOSIS: &str = "diagnosis.json";
/// Name and version of the answer's format.
const SCHEMA: &str = "greylag.mystery/1";

/// Options of `greylag mystery`.
#[derive(clap::Args)]
pub struct Arguments {
    /// Seed of all random draws: the effect, the flights, the wind, the errors of model and
    /// sensors.
    #[arg(long, required_unless_present = "open")]
    seed: Option<u64>,
    /// New folder for the logs, the model and the answer in coded form.
    #[arg(long, value_name = "DIR", required_unless_present = "open")]
    out: Option<PathBuf>,
    /// Exact model of the simulator's aircraft. The folder receives a copy without the hidden effect and with errors in the
    /// coefficients, and a copy of the airframe file.
    #[arg(long, value_name = "FILE", default_value = "params/x8/jsbsim.toml")]
    model: PathBuf,
    /// Folder that contains NAME/NAME.xml, the JSBSim file of --aircraft; without this option the aircraft is one of those
    /// built into the program.
    #[arg(long, value_name = "DIR", requires = "aircraft")]
    aircraft_dir: Option<PathBuf>,
    /// Name of the simulator's aircraft that the model describes [default: x8].
    #[arg(long, value_name = "NAME", requires = "model")]
    aircraft: Option<String>,
    /// Hide this effect instead of one drawn from the seed; an unknown ID prints a list of all
    /// effects.
    #[arg(long, value_name = "ID", group = "what")]
    effect: Option<String>,
    /// Hide the effect that this effect file defines, with the coefficients given in the file.
    #[arg(long, value_name = "FILE", group = "what")]
    hide: Option<PathBuf>,
    /// Amplitude of the hidden effect in its unit; for an effect of a file, the value of its first coefficient.
    #[arg(long, requires = "what", allow_negative_numbers = true, value_parser = finite)]
    amplitude: Option<f64>,
    /// Severity of MIL-spec turbulence in the flights, such as 3 (light) or 4 (moderate) [default: no turbulence].
    #[arg(long, value_name = "1..7", value_parser = clap::value_parser!(u8).range(1..=7))]
    turbulence_severity: Option<u8>,
    /// Controller of the flights. `any` and `adaptive` use no model: they need only the cruise airspeed and whether the aircraft
    /// has a rudder.
    #[arg(long, value_name = "NAME", default_value = "lqi", value_parser = choices::controller())]
    controller: ControllerKind,
    /// Reveal the answer of a folder, and compare it with the folder's diagnosis.json.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["seed", "out", "what", "turbulence_severity"])]
    open: Option<PathBuf>,
    /// Reveal the answer even if the folder has no diagnosis yet.
    #[arg(long, requires = "open")]
    give_up: bool,
}

/// Reads a finite number.
fn finite(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|x| x.is_finite());
    number.ok_or_else(|| "give a finite number".into())
}

/// The effect that was hidden.
#[derive(Debug, Deserialize, Serialize)]
struct Answer {
    schema: String,
    seed: u64,
    id: String,
    amplitude: f64,
    unit: String,
    /// Names and true values of the effect's coefficients; empty if the catalogue's effect only approximates the hidden one.
    parameters: Vec<(String, f64)>,
}

/// Makes the folder of a blind test, or reveals the hidden effect of such a folder.
///
/// # Errors
/// If the folder to be made exists, or the aircraft cannot be flown with the effect. If the answer cannot be read, or there is
/// no diagnosis yet and `--give-up` is not given.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    match (&arguments.open, arguments.seed, &arguments.out) {
        (Some(folder), _, _) if !arguments.give_up && undiagnosed(folder) => bail!(
            "no diagnosis is in {d}, and the answer ends the game: --give-up opens it all the same\n  diagnose first: greylag \
             diagnose --model {d}/model.toml --log {d}/train-1.csv {d}/train-2.csv {d}/train-3.csv --json {d}/{DIAGNOSIS}",
            d = folder.display()
        ),
        (Some(folder), _, _) => open(folder),
        (None, Some(seed), Some(out)) => make(arguments, seed, out),
        _ => bail!("give --seed and --out, or --open"),
    }
}

fn make(arguments: &Arguments, seed: u64, out: &Path) -> Result<ExitCode> {
    let parent = out.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if out.exists() {
        bail!("{} exists; name another folder", out.display());
    }
    if !parent.is_dir() {
        bail!("cannot create {}: name a folder in one that exists", out.display());
    }
    let path = shipped(&arguments.model);
    let reference = GreyBox::load(&path)?;
    let text =
        std::fs::read_to_string(&path).with_context(|| format!("reading {}", path.display()))?;
    let missing = missing(arguments, &reference, seed)?;
    let trial = Trial {
        subject: subject(arguments, &reference)?,
        seed,
        missing: vec![missing.clone()],
        turbulence: arguments.turbulence_severity,
        installed: Installation::TRUE,
    };
    // The files are written into a temporary folder, which is renamed at the end. A folder named `out` is thus complete.
    let beside = tempfile::Builder::new().prefix(".mystery").tempdir_in(parent);
    let beside = beside.with_context(|| {
        format!("cannot make a folder in {}, so name another place with --out", parent.display())
    })?;
    let folder = beside.path().join("mystery");
    std::fs::create_dir(&folder).with_context(|| format!("creating {}", folder.display()))?;
    put(&folder, "airframe.toml", &airframe(&path, &text)?)?;
    let model = starting_model(&text, &format!("mystery-{seed}"), seed, &trial.missing);
    put(&folder, "model.toml", &model.map_err(|why| anyhow!("making the model: {why}"))?)?;
    GreyBox::load(&folder.join("model.toml"))?;
    let logs = trial.fly(build(arguments.controller, &reference)?.as_ref())?;
    for flight in logs.training.iter().chain(&logs.testing) {
        csv::save(flight, &folder.join(&flight.name))?;
    }
    put(&folder, SEALED, &seal(&answer(seed, &missing))?)?;
    put(&folder, "README.txt", &readme(out))?;
    std::fs::rename(folder, out).with_context(|| format!("creating {}", out.display()))?;
    println!(
        "{}: three training flights, two test flights, a model that lacks something",
        out.display()
    );
    println!("what to do is in {}", out.join("README.txt").display());
    Ok(ExitCode::SUCCESS)
}

/// The simulator's aircraft, with the airframe of the reference model.
fn subject(arguments: &Arguments, reference: &GreyBox) -> Result<Subject> {
    let mut plant =
        PlantOptions { aircraft_dir: arguments.aircraft_dir.clone(), ..PlantOptions::default() };
    if let Some(name) = &arguments.aircraft {
        plant.aircraft.clone_from(name);
    }
    if arguments.aircraft.is_none() && !reference.airframe.name.to_lowercase().contains("x8") {
        bail!(
            "{} is a model of {}: name the simulator's aircraft that it is of with --aircraft",
            arguments.model.display(),
            reference.airframe.name
        );
    }
    Subject::new(plant, &reference.airframe)
        .map_err(|why| anyhow!("the airframe of model {}: {why}", reference.name))
}

/// The text of the airframe file that a model file names. `path` is the path of the model file, `model` its text.
fn airframe(path: &Path, model: &str) -> Result<String> {
    #[derive(Deserialize)]
    struct Named {
        airframe: PathBuf,
    }
    let named: Named = toml::from_str(model)?;
    let path = path.parent().unwrap_or(Path::new("")).join(named.airframe);
    std::fs::read_to_string(&path).with_context(|| format!("reading {}", path.display()))
}

/// The effect to hide: the effect of a given file, the one with a given id, or one drawn from `seed`.
fn missing(arguments: &Arguments, reference: &GreyBox, seed: u64) -> Result<Missing> {
    let Some(file) = &arguments.hide else {
        let craft = Craft::of(reference);
        return Ok(Missing::drawn(&craft, seed, arguments.effect.as_deref(), arguments.amplitude)?);
    };
    let read = register::load(&shipped(file))?;
    let [effect] = read[..] else {
        bail!("{} is not one effect file; name one", file.display());
    };
    let mut values = effect.values.clone();
    if let (Some(first), Some(amount)) = (values.first_mut(), arguments.amplitude) {
        *first = amount;
    }
    if values.iter().all(|v| *v == 0.0) {
        bail!(
            "all values of {} are zero, so nothing would be hidden; give --amplitude",
            effect.about.id
        );
    }
    Ok(Missing::written(effect, &values)?)
}

fn put(folder: &Path, name: &str, text: &str) -> Result<()> {
    let path = folder.join(name);
    std::fs::write(&path, text).with_context(|| format!("writing {}", path.display()))
}

fn answer(seed: u64, missing: &Missing) -> Answer {
    let names = coefficient_names(missing.id);
    let name = |k: usize| names.get(k).copied().unwrap_or("amplitude").to_owned();
    Answer {
        schema: SCHEMA.into(),
        seed,
        id: missing.id.into(),
        amplitude: missing.amplitude,
        unit: unit(missing.id).into(),
        parameters: missing.values.iter().enumerate().map(|(k, v)| (name(k), *v)).collect(),
    }
}

/// The unit of an effect's amplitude.
fn unit(id: &str) -> &'static str {
    let of_file = || register::find(id).map(|e| e.about.coefficients[0].unit);
    MissingKind::from_id(id).map(|kind| kind.unit).or_else(of_file).unwrap_or_default()
}

/// The names of the coefficients of the effect `id`; empty if the catalogue does not have it.
fn coefficient_names(id: &str) -> Vec<&'static str> {
    catalogue::describe(id)
        .map_or(Vec::new(), |about| about.coefficients.iter().map(|c| c.name).collect())
}

/// The answer as JSON in hexadecimal digits, so that a user does not read it by accident.
fn seal(answer: &Answer) -> Result<String> {
    let mut out = String::new();
    for line in serde_json::to_vec(answer)?.chunks(32) {
        line.iter().for_each(|byte| {
            let _ = write!(out, "{byte:02x}");
        });
        out.push('\n');
    }
    Ok(out)
}

fn unseal(text: &str) -> Option<Answer> {
    let digits: Vec<u32> = text
        .chars()
        .filter(|c| !c.is_whitespace())
        .map(|c| c.to_digit(16))
        .collect::<Option<_>>()?;
    let pairs = digits.chunks_exact(2).map(|pair| (16 * pair[0] + pair[1]) as u8);
    serde_json::from_slice(&pairs.collect::<Vec<u8>>()).ok()
}

fn readme(out: &Path) -> String {
    let d = out.display();
    let train = format!("{d}/train-1.csv {d}/train-2.csv {d}/train-3.csv");
    let test = format!("{d}/test-1.csv {d}/test-2.csv");
    format!(
        "The aircraft of these flights has an effect that model.toml lacks; its coefficients are off by\n\
         some 15 % besides, and the sensors are noisy, biased and skewed in time. Find the effect:\n\n\
         1. See where the model fails:\n\
         \x20  greylag compare --model {d}/model.toml --log {train} --report {d}/compare.html\n\
         2. Ask what is missing:\n\
         \x20  greylag diagnose --model {d}/model.toml --log {train} --json {d}/diagnosis.json --report {d}/diagnosis.html\n\
         3. Add it, and fit model and effect anew:\n\
         \x20  greylag amend --model {d}/model.toml --log {train} --diagnosis {d}/diagnosis.json --out {d}/amended\n\
         4. See the error fall on flights that the fit never saw:\n\
         \x20  greylag compare --model {d}/model.toml {d}/amended/model.toml --log {test}\n\
         5. Open the answer:\n\
         \x20  greylag mystery --open {d}\n"
    )
}

/// Whether the folder contains an answer, but no diagnosis for comparison.
fn undiagnosed(folder: &Path) -> bool {
    folder.join(SEALED).exists() && !folder.join(DIAGNOSIS).exists()
}

fn open(folder: &Path) -> Result<ExitCode> {
    let path = folder.join(SEALED);
    let sealed = std::fs::read_to_string(&path).with_context(|| {
        format!("reading {}: name a folder that `greylag mystery` made", path.display())
    })?;
    let answer = unseal(&sealed).filter(|answer| answer.schema == SCHEMA).with_context(|| {
        format!("{} holds no answer; make the mystery anew from its seed", path.display())
    })?;
    println!("hidden: {} = {} {}", answer.id, answer.amplitude, answer.unit);
    let path = folder.join(DIAGNOSIS);
    if !path.exists() {
        println!("{} does not exist: no diagnosis to compare", path.display());
        return Ok(ExitCode::SUCCESS);
    }
    let text = std::fs::read(&path).with_context(|| format!("reading {}", path.display()))?;
    let said: serde_json::Value = serde_json::from_slice(&text)
        .with_context(|| format!("{} is not a diagnosis; write it again", path.display()))?;
    beside(&answer, &said);
    Ok(ExitCode::SUCCESS)
}

/// Prints a comparison of the answer with the diagnosis `said`.
fn beside(answer: &Answer, said: &serde_json::Value) {
    let none = Vec::new();
    let effects = said["effects"].as_array().unwrap_or(&none);
    let id = |effect: &serde_json::Value| effect["id"].as_str().unwrap_or("?").to_owned();
    let asserted: Vec<String> = effects.iter().filter(|e| e["asserted"] == true).map(id).collect();
    let found = if asserted.is_empty() { "nothing".into() } else { asserted.join(", ") };
    println!("diagnosis: verdict {}, asserts {found}", said["verdict"].as_str().unwrap_or("?"));
    let Some((rank, effect)) = effects.iter().enumerate().find(|(_, e)| id(e) == answer.id) else {
        println!("{} is not among the candidates", answer.id);
        return;
    };
    println!("{} is ranked {} of {}", answer.id, rank + 1, effects.len());
    if let Some(alike) = effect["indistinguishable_from"].as_array().filter(|a| !a.is_empty()) {
        let alike: Vec<_> = alike.iter().filter_map(|a| a.as_str()).collect();
        println!("cannot be distinguished from {} with these flights", alike.join(", "));
    }
    let mut table = Table::new();
    table.load_style(comfy_table::presets::UTF8_FULL_CONDENSED);
    table.set_header(["parameter", "hidden", "found", "95 % interval"]);
    table.column_iter_mut().skip(1).for_each(|c| c.set_cell_alignment(CellAlignment::Right));
    for parameter in effect["parameters"].as_array().unwrap_or(&none) {
        let name = parameter["name"].as_str().unwrap_or("?");
        // a name may begin with the effect's id and a dot, as in model files
        let own = name.rsplit('.').next().unwrap_or(name);
        let hidden = answer.parameters.iter().find(|(n, _)| n == own).map(|(_, v)| *v);
        let number = |x: Option<f64>| x.map_or("–".into(), |x| format!("{x:.4}"));
        let ci = &parameter["ci95"];
        table.add_row([
            name.to_owned(),
            number(hidden),
            number(parameter["value"].as_f64()),
            format!("{} to {}", number(ci[0].as_f64()), number(ci[1].as_f64())),
        ]);
    }
    println!("{table}");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_amplitude_is_a_finite_number() {
        assert_eq!(finite("-0.5"), Ok(-0.5));
        for wrong in ["nan", "inf", "much"] {
            assert!(finite(wrong).is_err(), "{wrong}");
        }
    }
}
