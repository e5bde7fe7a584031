//! `greylag report`: draws a recorded flight as an HTML page.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Result, bail};
use clap::Args;

use crate::commands::recording_report::{Reporter, read, segments, sights};
use crate::commands::replay::{Again, FlownArguments};
use crate::commands::{files, outputs};
use crate::control::Pace;

/// The arguments of `greylag report`.
#[derive(Args)]
pub struct Arguments {
    /// Folder with the recording of `greylag fly` or `greylag demo`.
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// HTML file to write [default: report.html in DIR].
    #[arg(long, value_name = "OUT.html")]
    out: Option<PathBuf>,
    /// Replace the page if it exists.
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    flown: FlownArguments,
}

/// Draws attitude, commands, loop timing, the model's prediction error and, for a controller that plans, its candidate plans.
///
/// # Errors
/// If a file of the recording, the model or the policy cannot be read, or the page cannot be written.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    let folder = &arguments.folder;
    if !folder.is_dir() {
        bail!(
            "there is no folder {}: name the one that `greylag fly` printed, which holds flight.csv",
            folder.display()
        );
    }
    let page = arguments.out.clone().unwrap_or_else(|| folder.join("report.html"));
    let overwrite = arguments.force.into();
    let recording = std::fs::read_dir(folder)?.flatten().map(|entry| entry.path());
    let recording = recording.filter(|path| path.extension().is_none_or(|e| e != "html"));
    outputs::check([&page], recording, overwrite)?;
    let flight = read(folder)?;
    let Again { controller, model, model_file, companion, vehicle } =
        arguments.flown.again(folder)?;
    let sights = match controller.pace() {
        Pace::Planned => sights(folder, companion, vehicle).unwrap_or_else(|why| {
            eprintln!("the report does not show what the planner saw: {why:#}");
            Vec::new()
        }),
        Pace::Immediate => Vec::new(),
    };
    let reporter = Reporter {
        title: format!("Flight {}: {controller}, model {}", folder.display(), model.name),
        controller: controller.name(),
        model: &model,
        model_file: &model_file,
        seed: None,
        segments: segments(&flight),
        texts: Vec::new(),
        sights,
    };
    let report = reporter.report(folder, &flight)?;
    files::write(&page, &report.page().render(), overwrite)?;
    println!("report: {}", page.display());
    Ok(ExitCode::SUCCESS)
}
