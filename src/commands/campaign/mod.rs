//! `greylag campaign`: plans, runs, gathers and reports many runs over prior (physical) models, controllers and seeds. A cell is
//! one of these runs.

mod cost;
mod gather;
mod local;
mod one;
mod plan;
mod report;
mod run;

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Result;

use crate::campaign::{self, CampaignFile, Plan, Store};
use crate::commands::files::shipped;

/// Options of `greylag campaign`.
#[derive(clap::Args)]
#[command(
    after_help = "A campaign file names axes, seeds and stages; a cell is the command line of a stage at some levels. \
    A cell's folder carries a hash of its command, its inputs and the cells before it: a changed campaign makes new cells \
    and mixes nothing. A cell that is done is not done again; one that was killed goes on from its checkpoint."
)]
pub struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(clap::Subcommand)]
enum What {
    /// Show the cells of a campaign, their costs and their outputs.
    Plan(plan::Arguments),
    /// Run cells: all on this machine, a single one, or all through a cluster's scheduler.
    Run(run::Arguments),
    /// Gather the results of the cells, and list the cells without a result.
    Gather(gather::Arguments),
    /// Write the tables and the HTML page of the results.
    Report(report::Arguments),
}

/// Campaign and results folder that a subcommand works on.
#[derive(clap::Args)]
struct Which {
    /// File that defines the campaign.
    #[arg(value_name = "FILE.toml")]
    file: PathBuf,
    /// Folder for the cells' results [default: campaign-NAME].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// Runs the chosen subcommand of `greylag campaign`.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    match &arguments.what {
        What::Plan(arguments) => plan::run(arguments),
        What::Run(arguments) => run::run(arguments),
        What::Gather(arguments) => gather::run(arguments),
        What::Report(arguments) => report::run(arguments),
    }
}

impl Which {
    /// Reads the campaign file, opens the folder of results, and checks the commands of the cells.
    fn open(&self) -> Result<(Plan, Store)> {
        let path = shipped(&self.file);
        let plan = campaign::plan(CampaignFile::load(&path)?, &path, &shipped)?;
        let folder =
            self.out.clone().unwrap_or_else(|| format!("campaign-{}", plan.file.name).into());
        let store = Store::new(&folder);
        one::check(&plan, &store, &path)?;
        Ok((plan, store))
    }
}
