//! `greylag amend --leave-one-out`: compares model structures by cross-validation. Each flight in turn is predicted by a
//! model that was fitted to all other flights.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Result;
use comfy_table::{CellAlignment, Table};

use super::places::Made;
use crate::commands::bar::Bar;
use crate::commands::files::{self, Overwrite};
use crate::model::GreyBox;
use crate::sysid::amend::leave_one_out::{
    Effort, Fitted, Scored, Structure, alternatives, leave_one_out,
};
use crate::sysid::amend::{Added, Options};
use crate::sysid::flight_path::reconstruction::Reconstruction;
use crate::sysid::per_flight::{PerFlight, SensorErrors};

/// Default prior standard deviation of the angles between the sensors' axes and the body axes, °. Sensors that were aligned
/// by eye have such errors.
const ASKEW_DEG: f64 = 3.0;

/// Name of the structure with a linear residual.
const LINEAR_RESIDUAL: &str = "--tune-only, then train residual";

/// The structures to compare:
/// - the model as given,
/// - a fit of its coefficients,
/// - the same fit; the sensor errors common to the fitted flights then also correct the flight left out,
/// - the same fit with additional constants of each flight: trim coefficients, misalignment angles of the sensor axes, or both,
/// - the same fit, followed by a linear residual (`greylag train residual`),
/// - a fit in which physical bounds are the only prior,
/// - a fit with each of `effects` added, and with all of them added, both with the constants of each flight in `asked`,
/// - screened: a fit with wider priors, and with each other effect of the catalogue that `model` lacks.
pub fn structures(model: &GreyBox, effects: &[Added], asked: PerFlight) -> Vec<Structure> {
    let complete =
        |name: &str, fitted| Structure { name: name.into(), fitted, effort: Effort::Complete };
    let of = |name: String, effects: &[Added], per_flight: PerFlight| {
        complete(&name, Fitted::Coefficients { effects: effects.to_vec(), per_flight })
    };
    let none = PerFlight::default();
    let trims = PerFlight { trims: Some(asked.trims.unwrap_or(1.0)), ..none };
    let askew_deg = asked.askew_deg.unwrap_or(ASKEW_DEG);
    let axes = PerFlight { askew_deg: Some(askew_deg), ..none };
    let both = PerFlight { trims: trims.trims, ..axes };
    let sensors = PerFlight { sensors: SensorErrors::Kept, ..none };
    let mut all = vec![
        complete("as given", Fitted::Nothing),
        of("--tune-only".into(), &[], none),
        of("--tune-only --sensor-errors kept".into(), &[], sensors),
        of("--tune-only --flight-trims".into(), &[], trims),
        of(format!("--tune-only --axes-askew {askew_deg}"), &[], axes),
        of(format!("--tune-only --flight-trims --axes-askew {askew_deg}"), &[], both),
        complete(LINEAR_RESIDUAL, Fitted::LinearResidual),
        complete("--tune-only --from-scratch", Fitted::FromScratch),
    ];
    let with = |id: &str| format!("--effect {id}");
    all.extend(effects.iter().map(|e| of(with(&e.id), std::slice::from_ref(e), asked)));
    if effects.len() > 1 {
        let ids: Vec<&str> = effects.iter().map(|e| e.id.as_str()).collect();
        all.push(of(with(&ids.join(" ")), effects, asked));
    }
    let widened = |factor: f64| format!("--tune-only --widths {factor}");
    all.extend(alternatives(model, effects, widened, with));
    all
}

/// Cross-validates `structures` of `model` on `flights` and prints a table of their errors. Writes the table as JSON to the
/// file `json` if one is given, and makes its folder.
pub fn run(
    model: &GreyBox,
    flights: &[Reconstruction],
    structures: &[Structure],
    json: Option<&PathBuf>,
    overwrite: Overwrite,
) -> Result<ExitCode> {
    let bar = Bar::new();
    let horizons_s = Options::default().horizons_s;
    let scored = leave_one_out(model, flights, structures, &horizons_s, &|s| bar.update(s))?;
    bar.go_on()?;
    drop(bar);
    println!("{}", table(&scored));
    for s in scored.iter().filter(|s| !s.screened) {
        let by: Vec<String> =
            s.flights.iter().zip(&s.errors).map(|(f, e)| format!("{f} {e:.4}")).collect();
        println!("{}: {}", s.structure, by.join(", "));
    }
    let judged = scored.first().map_or(&[][..], |s| s.flights.as_slice());
    let short = flights.iter().map(|f| &f.name).filter(|name| !judged.contains(*name));
    for name in short {
        println!(
            "{name}: too short for the shortest horizon, so it is fitted to and never left out"
        );
    }
    match scored.iter().find(|s| s.chosen) {
        Some(s) if s.free == 0 => {
            println!("The model as given predicts flights left out as well as any fit: keep it.");
        }
        Some(s) if s.structure == LINEAR_RESIDUAL => println!(
            "The simplest within one standard error of the best is a fit with a linear residual: fit with --tune-only --fit-all, \
             then give the fitted model and the same logs to greylag train residual."
        ),
        Some(s) => println!(
            "The simplest within one standard error of the best is {}; fit it to all flights with --fit-all.",
            s.structure
        ),
        None => println!("No structure could be fitted with every flight left out once."),
    }
    if let Some((structure, c)) =
        scored.iter().find(|s| s.chosen).and_then(|s| Some((&s.structure, s.combined?)))
    {
        println!(
            "Together with the state at the start of a run and the mean state, the error of {structure} on the flight left out is \
             {:.4}; the model's weight is then {:.2} of 1.",
            c.error, c.weight_of_model
        );
    }
    if let Some(path) = json {
        let _made = path.parent().map(Made::folder).transpose()?;
        files::write(path, &(serde_json::to_string_pretty(&scored)? + "\n"), overwrite)?;
    }
    Ok(ExitCode::SUCCESS)
}

fn table(scored: &[Scored]) -> Table {
    let mut table = Table::new();
    table.load_style(comfy_table::presets::UTF8_FULL_CONDENSED);
    table.set_header([
        "structure",
        "free",
        "error on the flight left out",
        "± standard error",
        "± relative to the best",
        "",
    ]);
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    let number = |x: f64| if x.is_finite() { format!("{x:.4}") } else { "–".into() };
    for s in scored {
        let remark = match (s.chosen, s.screened) {
            (true, _) => "chosen",
            (_, true) => "screened",
            _ => "",
        };
        let free = s.free.to_string();
        let [a, b, c] = [s.mean, s.standard_error, s.beside_best].map(number);
        table.add_row([s.structure.clone(), free, a, b, c, remark.into()]);
    }
    table
}
