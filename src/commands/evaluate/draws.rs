//! Evaluation of controllers in simulations of random models. The coefficients of each random model (a draw) are drawn from
//! the prior distributions of one model's coefficients.

use std::process::ExitCode;

use anyhow::Result;
use comfy_table::Table;
use serde::Serialize;

use super::{Arguments, Entrant, entrants, progress, tables, targets};
use crate::commands::files;
use crate::model::GreyBox;
use crate::num::statistics::quantile;
use crate::sim::evaluation::{Evaluation, Robustness};
use crate::sim::targets::Row;

/// The JSON document of the evaluation.
#[derive(Serialize)]
struct DrawsDocument<'a> {
    schema: &'static str,
    program: &'static str,
    command_line: String,
    seed: u32,
    targets: String,
    model: &'a str,
    controllers: &'a [Robustness],
}

/// Evaluates the controllers in `draws` draws of the first model, prints the tables and writes the JSON. The controllers are
/// built for each of `models`, and every one flies in draws of the first.
pub(super) fn over_draws(
    arguments: &Arguments,
    draws: u32,
    models: &[GreyBox],
    rows: &[Row],
) -> Result<ExitCode> {
    let airframe = &models[0].airframe;
    let courses = targets::courses(arguments, rows, airframe.reference.airspeed, airframe);
    let fly = |e: &Entrant| {
        let progress = progress(draws.into(), "draws", &format!("{}, model {}", e.kind, e.model));
        let make = || e.controller.boxed_clone();
        let names = [e.kind.name(), e.model.as_str()];
        let seeds = [arguments.seed, draws];
        let flown = Robustness::of(names, &make, &models[0], &courses, seeds, &|| progress.inc(1))?;
        progress.finish_and_clear();
        Ok(flown)
    };
    let flown = entrants(arguments, models)?.iter().map(fly).collect::<Result<Vec<_>>>()?;
    let all: Vec<Evaluation> = flown.iter().map(|r| r.all.clone()).collect();
    if !files::is_stdout(arguments.json.as_deref()) {
        tables::print(&all, arguments.limited());
        println!("{}", draws_table(&flown));
        println!("flown in draws of model {} from the widths of its coefficients", models[0].name);
        println!("intervals assume independent flights; the second table shows how draws differ");
    }
    if let Some(path) = &arguments.json {
        let document = DrawsDocument {
            schema: "greylag.robustness/1",
            program: concat!("greylag ", env!("CARGO_PKG_VERSION")),
            command_line: files::command_line(),
            seed: arguments.seed,
            targets: arguments.targets.display().to_string(),
            model: &models[0].name,
            controllers: &flown,
        };
        let text = serde_json::to_string_pretty(&document)? + "\n";
        files::write(path, &text, arguments.force.into())?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Table of each controller's results over the draws. The settled error of a target is the mean of roll and pitch RMSE over the
/// last fifth of the flight, degrees. The mean of a draw is its mean settled error over all targets. A target diverged if its
/// settled error exceeds 10°. A draw has a divergence if any of its targets diverged.
fn draws_table(flown: &[Robustness]) -> Table {
    let mut table = Table::new();
    table.load_style(comfy_table::presets::UTF8_FULL_CONDENSED);
    table.set_header([
        "controller",
        "model",
        "draws",
        "with a divergence",
        "mean ° of a draw: median",
        "95 %",
        "worst",
    ]);
    for Robustness { all, draws } in flown {
        let means: Vec<f64> = draws.iter().map(|(mean, _)| *mean).collect();
        let mut row = vec![all.controller.clone(), all.model.clone(), draws.len().to_string()];
        let lost = draws.iter().filter(|(_, lost)| *lost > 0).count();
        row.push(lost.to_string());
        row.extend([0.5, 0.95, 1.0].map(|q| format!("{:.3}", quantile(&means, q))));
        table.add_row(row);
    }
    table
}
