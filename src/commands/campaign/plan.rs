//! `greylag campaign plan`: shows the cells of a campaign and their cost. A campaign is a planned set of runs in stages. A cell
//! is the command of a stage with one combination of parameters, such as controller and seed.

use std::process::ExitCode;

use anyhow::Result;
use comfy_table::Table;

use super::Which;
use super::cost::{Cost, time};
use crate::campaign::{Plan, Standing, Store};

/// Options of `greylag campaign plan`.
#[derive(clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    which: Which,
    /// List every cell with its command.
    #[arg(long)]
    cells: bool,
}

/// Prints the campaign's stages with their costs, and with `--cells` every cell.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    let (plan, store) = arguments.which.open()?;
    println!("campaign {}: {}", plan.file.name, plan.file.about);
    if arguments.cells {
        for cell in &plan.cells {
            println!("{:>4}  {}\n      {}", cell.number, cell.id, cell.command());
        }
    }
    print_costs(&plan, &store)?;
    println!(
        "$OUT is {}; every cell writes one line there, in its own folder",
        store.folder().display()
    );
    println!("run it: greylag campaign run {} --local", arguments.which.file.display());
    Ok(ExitCode::SUCCESS)
}

/// Prints a table of the stages, and the total cost of the cells that are not done.
fn print_costs(plan: &Plan, store: &Store) -> Result<()> {
    let mut table = Table::new();
    table.load_style(comfy_table::presets::UTF8_FULL_CONDENSED);
    table.set_header([
        "stage",
        "over",
        "cells",
        "done",
        "a cell",
        "known from",
        "core-hours left",
        "writes",
    ]);
    let (mut left, mut unknown) = (0.0, 0);
    for stage in &plan.file.stages {
        let cells = plan.of_stage(&stage.name).count();
        let done = done(plan, store, &stage.name)?;
        let cost = Cost::of(plan, store, stage)?;
        match cost {
            Some(cost) => left += cost.core_seconds * (cells - done) as f64,
            None => unknown += cells - done,
        }
        let hours = |c: Cost| format!("{:.3}", c.core_seconds * (cells - done) as f64 / 3600.0);
        table.add_row([
            stage.name.clone(),
            stage.over.join(" × "),
            cells.to_string(),
            done.to_string(),
            cost.map_or("–".into(), |c| time(c.core_seconds)),
            cost.map_or("run one cell to know".into(), |c| c.from.to_string()),
            cost.map_or("–".into(), hours),
            written(&stage.command).into(),
        ]);
    }
    println!("{table}");
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    println!(
        "{} cells, {:.3} core-hours left: {} on the {cores} cores here",
        plan.cells.len(),
        left / 3600.0,
        time(left / cores as f64)
    );
    if unknown > 0 {
        println!("without {unknown} cells of unknown cost");
    }
    Ok(())
}

fn done(plan: &Plan, store: &Store, stage: &str) -> Result<usize> {
    let mut done = 0;
    for cell in plan.of_stage(stage) {
        done += usize::from(matches!(store.standing(cell)?, Standing::Done(_)));
    }
    Ok(done)
}

/// What `command` writes into the folder of its cell, in words.
fn written(command: &str) -> &'static str {
    let words: Vec<&str> = command.split_whitespace().take(2).collect();
    match words[..] {
        ["collect", ..] => "flights (CSV)",
        ["train", "dynamics"] => "model.toml, residual.safetensors, errors on unseen flights",
        ["train", "policy"] => "actor and critics, learning curve",
        ["evaluate", ..] => "settled errors and divergence",
        _ => "result.json",
    }
}
