//! `greylag aircraft draw`: draws random aircraft from a distribution, and compares given models with the draws.
//!
//! The comparison is by traits: dimensionless flight characteristics such as the static margin.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result};
use comfy_table::Table;
use comfy_table::presets::NOTHING;

use crate::commands::files::{self, Overwrite, shipped};
use crate::model::GreyBox;
use crate::model::population::{Character, Drawn, Population, TRAITS};
use crate::num::statistics::quantile;

/// Models that are compared with the draws by default: those of the aircraft in `params/`.
const SHIPPED: [&str; 5] = [
    "params/x8/jsbsim.toml",
    "params/aerosonde/jsbsim.toml",
    "params/c172p/jsbsim.toml",
    "params/c172p-flaps/jsbsim.toml",
    "params/a430/prior.toml",
];
/// An aircraft lies inside the distribution if each of its traits lies between these quantiles of the draws.
const INSIDE: [f64; 2] = [0.005, 0.995];

/// Options of `greylag aircraft draw`.
#[derive(clap::Args)]
pub struct Arguments {
    /// File of the distribution that the aircraft are drawn from.
    #[arg(long, value_name = "FILE", default_value = "params/any/aircraft.toml")]
    population: PathBuf,
    /// Seed of the random draws.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Number of aircraft to draw.
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    count: u32,
    /// List the first N drawn aircraft individually.
    #[arg(long, value_name = "N", default_value_t = 0)]
    show: usize,
    /// Models to compare with the draws [default: those of the shipped aircraft].
    #[arg(long = "model", value_name = "FILE", num_args = 1..)]
    models: Vec<PathBuf>,
    /// Write airframe.toml and model.toml of each drawn aircraft to a subfolder of this folder, named by the number of the draw.
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
}

/// Draws the aircraft, prints the quantiles of their traits and writes their files.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    let population = Population::load(&shipped(&arguments.population))?;
    // errors of the options are reported before the first draw is written
    let placed = placed(arguments)?;
    let mut characters = Vec::new();
    let mut shown = listing();
    for number in 0..u64::from(arguments.count) {
        let drawn = population.draw(arguments.seed, number)?;
        let character = Character::of(&drawn.exact)?;
        if (number as usize) < arguments.show {
            shown.add_row(listed(&drawn));
        }
        if let Some(folder) = &arguments.out {
            write(&folder.join(number.to_string()), &drawn)?;
        }
        characters.push(character);
    }
    if arguments.show > 0 {
        println!("{shown}\n");
    }
    print(&characters, &placed);
    if let Some(folder) = &arguments.out {
        println!("wrote {} aircraft below {}", arguments.count, folder.display());
    }
    Ok(ExitCode::SUCCESS)
}

/// The models to compare with the draws, and their traits.
fn placed(arguments: &Arguments) -> Result<Vec<(GreyBox, Character)>> {
    let given: Vec<PathBuf> = match arguments.models.is_empty() {
        true => SHIPPED.map(PathBuf::from).to_vec(),
        false => arguments.models.clone(),
    };
    let place = |path: &PathBuf| -> Result<(GreyBox, Character)> {
        let model = GreyBox::load(&shipped(path))?;
        let own = Character::of(&model)
            .with_context(|| format!("cannot place {}", model.airframe.name))?;
        Ok((model, own))
    };
    given.iter().map(place).collect()
}

fn write(folder: &Path, drawn: &Drawn) -> Result<()> {
    std::fs::create_dir_all(folder)
        .with_context(|| format!("cannot make the folder {}", folder.display()))?;
    for (name, text) in ["airframe.toml", "model.toml"].iter().zip(&drawn.files) {
        files::write(&folder.join(name), text, Overwrite::New)?;
    }
    Ok(())
}

fn listing() -> Table {
    let mut table = Table::new();
    table.load_style(NOTHING);
    table.set_header([
        "draw",
        "layout",
        "mass kg",
        "span m",
        "area m2",
        "cruise m/s",
        "margin %",
        "delay ms",
        "thrust/weight",
    ]);
    table
}

fn listed(drawn: &Drawn) -> Vec<String> {
    let m = &drawn.measures;
    let weight = m.mass * crate::physics::atmosphere::STANDARD_GRAVITY;
    vec![
        drawn.number.to_string(),
        drawn.layout.name().into(),
        format!("{:.3}", m.mass),
        format!("{:.2}", m.span),
        format!("{:.3}", m.area),
        format!("{:.1}", drawn.exact.airframe.envelope.airspeed_cruise_mps),
        format!("{:.1}", 100.0 * drawn.static_margin),
        format!("{:.0}", 1e3 * drawn.delay_s),
        format!("{:.2}", m.static_thrust / weight),
    ]
}

/// Prints a table with the quantiles of each trait over the draws, and its values in the models `placed`. Below, prints the
/// meaning of each trait, and the traits in which each model lies outside the quantiles [`INSIDE`].
fn print(characters: &[Character], placed: &[(GreyBox, Character)]) {
    let mut table = Table::new();
    table.load_style(NOTHING);
    let names = placed.iter().map(|(model, _)| model.airframe.name.clone());
    table.set_header(["", "0.5 %", "median", "99.5 %"].map(String::from).into_iter().chain(names));
    let mut outside = vec![Vec::new(); placed.len()];
    for (k, about) in TRAITS.iter().enumerate() {
        let all: Vec<f64> = characters.iter().map(|c| c.values[k]).collect();
        let [low, high] = INSIDE.map(|q| quantile(&all, q));
        let mut row = vec![about.name.to_owned()];
        row.extend([low, quantile(&all, 0.5), high].map(number));
        for ((_, character), out) in placed.iter().zip(&mut outside) {
            let value = character.values[k];
            let inside = (low..=high).contains(&value);
            row.push(number(value) + if inside { "" } else { " !" });
            if !inside {
                out.push(about.name);
            }
        }
        table.add_row(row);
    }
    println!("{table}");
    for about in &TRAITS {
        println!("{}: {}", about.name, about.meaning);
    }
    for ((model, _), out) in placed.iter().zip(outside) {
        match out.is_empty() {
            true => println!("{} lies among the draws", model.airframe.name),
            false => println!("{} lies outside in {}", model.airframe.name, out.join(", ")),
        }
    }
}

/// Formats `value` with about three significant figures.
fn number(value: f64) -> String {
    match value.abs() {
        x if x >= 100.0 => format!("{value:.0}"),
        x if x >= 10.0 => format!("{value:.1}"),
        x if x >= 1.0 => format!("{value:.2}"),
        _ => format!("{value:.3}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_model_is_reported_before_a_draw_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("draws");
        let arguments = Arguments {
            population: "params/any/aircraft.toml".into(),
            seed: 1,
            count: 1,
            show: 0,
            models: vec!["missing.toml".into()],
            out: Some(out.clone()),
        };
        assert!(run(&arguments).is_err());
        assert!(!out.exists());
    }
}
