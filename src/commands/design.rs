//! `greylag design`: finds the flight-test manoeuvre whose data best distinguish two effects, one of which a model may lack. An
//! effect is a physical contribution to forces and moments.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use comfy_table::{CellAlignment, Table};
use serde::Serialize;

use crate::commands::bar::Bar;
use crate::commands::effect_files::{effect_paths, named_effects};
use crate::commands::files::{self, JsonArgument, shipped};
use crate::commands::{given, outputs};
use crate::control::{ControllerKind, build};
use crate::model::GreyBox;
use crate::sim::design::{ENOUGH, LONGEST_S, Plan, Prospect, Suspect, plan, prospects};

/// Options of `greylag design`.
#[derive(clap::Args)]
pub struct Arguments {
    /// The model that lacks both effects.
    #[arg(long, value_name = "FILE")]
    model: PathBuf,
    /// The two effects: ids of the catalogue (see `greylag effects`), or effect files (TOML).
    #[arg(long, value_name = "ID|FILE", num_args = 2, required = true)]
    between: Vec<String>,
    /// Values of an effect's constants, in the order of `greylag effects show`, instead of typical ones (may be repeated).
    #[arg(long, value_name = "ID=V,V…", allow_hyphen_values = true)]
    values: Vec<String>,
    /// Write the schedule, for `greylag fly --schedule`.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Replace the files if they exist.
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    json: JsonArgument,
}

/// Result as JSON. `separation` measures how well the data of a manoeuvre distinguish the two effects: the squared
/// difference between their predictions after a refit, in noise variances, summed over the flight. It is null if the
/// simulated flight leaves the roll or pitch bounds of a schedule. `needed_s` is the flight time (s) after which the effects
/// count as distinguished. It is null without a separation, and if no finite time suffices.
#[derive(Serialize)]
struct Document<'a> {
    between: [&'a str; 2],
    manoeuvres: Vec<Manoeuvre<'a>>,
    chosen: Option<&'a str>,
    /// Time of flying the chosen manoeuvre after which the effects count as distinguished, s.
    chosen_s: Option<f64>,
}

#[derive(Serialize)]
struct Manoeuvre<'a> {
    name: &'a str,
    duration_s: f64,
    separation: Option<f64>,
    needed_s: Option<f64>,
}

fn document<'a>(
    suspects: &'a [Suspect; 2],
    all: &'a [Prospect],
    plan: Option<&'a Plan>,
) -> Document<'a> {
    let row = |p: &'a Prospect| Manoeuvre {
        name: p.name,
        duration_s: p.duration_s,
        separation: p.apart(),
        needed_s: p.seconds().filter(|s| s.is_finite()),
    };
    Document {
        between: [&suspects[0].id, &suspects[1].id],
        manoeuvres: all.iter().map(row).collect(),
        chosen: plan.map(|p| p.manoeuvre.name),
        chosen_s: plan.map(|p| p.seconds),
    }
}

/// Simulates each manoeuvre with each of the two effects and prints the separations. Writes a schedule that repeats the best
/// manoeuvre.
///
/// # Errors
/// If the model, an effect or the file cannot be used, or no manoeuvre distinguishes the two effects.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    let overwrite = arguments.force.into();
    let written = arguments.out.iter().chain(arguments.json.path());
    let inputs = [given::files(&arguments.model), effect_paths(&arguments.between)].concat();
    outputs::check(written, inputs, overwrite)?;
    let model = GreyBox::load(&shipped(&arguments.model))?;
    let suspects = suspects(arguments)?;
    let lqi = build(ControllerKind::Lqi, &model)?;
    let bar = Bar::new();
    let all = prospects(&model, lqi.as_ref(), &suspects, &|stage| bar.update(stage))?;
    bar.go_on()?;
    drop(bar);
    let quiet = arguments.json.takes_stdout();
    if !quiet {
        println!("{}", table(&all));
    }
    let [a, b] = &suspects;
    let cruise = model.airframe.envelope.airspeed_cruise_mps;
    let plan = plan(&all, cruise);
    let found = document(&suspects, &all, plan.as_ref());
    arguments.json.write("greylag.design/1", &found, overwrite)?;
    let Some(Plan { manoeuvre, seconds, times, schedule }) = plan else {
        bail!(
            "no built-in manoeuvre distinguishes {} from {} within {LONGEST_S} s of flight; \
             give larger effects with --values, or treat {} and {} as indistinguishable",
            a.id,
            b.id,
            a.id,
            b.id
        );
    };
    let words = format!(
        "{}: {}\n{seconds:.1} s of this manoeuvre separate {} from {} (required separation {ENOUGH}); \
         one repetition takes {:.0} s",
        manoeuvre.name,
        manoeuvre.description,
        a.id,
        b.id,
        manoeuvre.schedule().duration()
    );
    if !quiet {
        println!("{words}");
    }
    if let Some(path) = &arguments.out {
        files::write(path, &schedule.to_toml(), overwrite)?;
        eprintln!(
            "schedule with {times} repetitions of the manoeuvre, on alternating opposite headings, written to {}; \
             fly it with `greylag fly --schedule {}`, or simulated with `greylag demo --schedule {}`",
            path.display(),
            path.display(),
            path.display()
        );
    }
    Ok(ExitCode::SUCCESS)
}

fn suspects(arguments: &Arguments) -> Result<[Suspect; 2]> {
    let values = arguments.values.iter().map(|text| read(text)).collect::<Result<Vec<_>>>()?;
    let between = named_effects(&arguments.between)?;
    if between.len() != 2 {
        bail!("--between names {} effects; name two, each by its id or its file", between.len());
    }
    if let Some((id, _)) = values.iter().find(|(id, _)| !between.contains(id)) {
        bail!("--values {id}=… names neither of the two effects of --between");
    }
    let suspect = |k: usize| {
        let id = between[k].clone();
        let given = values.iter().find(|(of, _)| *of == id).map(|(_, v)| v.clone());
        Suspect { id, values: given.unwrap_or_default() }
    };
    Ok([suspect(0), suspect(1)])
}

/// Parses the id of an effect with the values of its constants, `id=1.0,2.0`.
fn read(text: &str) -> Result<(String, Vec<f64>)> {
    let wrong = || format!("--values {text}: write ID=VALUE,VALUE…, such as drag_alpha2=0.5");
    let (id, values) = text.split_once('=').with_context(wrong)?;
    let number = |v: &str| v.trim().parse::<f64>().ok().filter(|x| x.is_finite());
    let values: Option<Vec<f64>> = values.split(',').map(number).collect();
    Ok((id.trim().into(), values.with_context(wrong)?))
}

fn table(all: &[Prospect]) -> Table {
    let mut table = Table::new();
    table.load_style(comfy_table::presets::UTF8_FULL_CONDENSED);
    table.set_header(["manoeuvre", "length s", "separation", "visible", "s needed"]);
    table.column_iter_mut().skip(1).for_each(|c| c.set_cell_alignment(CellAlignment::Right));
    let number = |x: Option<f64>| x.map_or("–".into(), |x| format!("{x:.0}"));
    for prospect in all {
        let [a, b] = prospect.separations;
        let visible = a.zip(b).map(|(a, b)| a.visible.min(b.visible));
        table.add_row([
            prospect.name.into(),
            format!("{:.0}", prospect.duration_s),
            prospect.apart().map_or("leaves the bounds".into(), |x| format!("{x:.0}")),
            number(visible),
            prospect
                .seconds()
                .filter(|s| s.is_finite())
                .map_or("–".into(), |s| format!("{s:.1}")),
        ]);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_finite_numbers() {
        assert_eq!(read("drag_alpha2=0.5, -1").unwrap(), ("drag_alpha2".into(), vec![0.5, -1.0]));
        for wrong in ["drag_alpha2", "drag_alpha2=", "drag_alpha2=nan", "drag_alpha2=1,inf"] {
            assert!(read(wrong).unwrap_err().to_string().contains("ID=VALUE"), "{wrong}");
        }
    }
}
