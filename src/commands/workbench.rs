//! `greylag workbench`: a page in the browser. The user compares a model with flight logs there and adds missing effects to the
//! model. An effect is a physical contribution to forces and moments. A session keeps the model, the flights and the results in a
//! folder.

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result};

#[cfg(feature = "demo")]
use crate::commands::faults;
use crate::commands::files::shipped;
use crate::commands::intake::Reading;
#[cfg(feature = "demo")]
use crate::workbench::Failsafes;
use crate::workbench::Given;
use crate::workbench::server::{random_token, serve};
use crate::workbench::session::FILE;

/// Options of `greylag workbench`.
#[derive(clap::Args)]
#[command(
    after_help = "The page is served on this machine only, to whoever has the token of the printed address. Everything is kept in the session's folder as it happens; Ctrl-C ends the workbench, and the same command goes on from there."
)]
pub struct Arguments {
    /// Flight logs to begin with: CSV, PX4 ULog, ArduPilot .bin, MAVLink .tlog or ROS 2 bag (.mcap). More can be added on the
    /// page.
    logs: Vec<PathBuf>,
    /// Model file [default: the model of the session; for a new session, the file named by the environment variable
    /// GREYLAG_MODEL].
    #[arg(long)]
    model: Option<PathBuf>,
    /// TCP port on 127.0.0.1; with 0 the system chooses a free port.
    #[arg(long, default_value_t = 0)]
    port: u16,
    /// Folder of the session. It is created if it does not exist.
    #[arg(long = "dir", default_value = "greylag-session")]
    folder: PathBuf,
    #[command(flatten)]
    reading: Reading,
}

/// Path of the model: the value of `--model`; without this option, and for a new session only, the value of the environment
/// variable `GREYLAG_MODEL`.
fn model(arguments: &Arguments) -> Option<PathBuf> {
    let new = !arguments.folder.join(FILE).exists();
    let environment = || std::env::var_os("GREYLAG_MODEL").filter(|_| new).map(PathBuf::from);
    arguments.model.clone().or_else(environment)
}

/// Opens the session and serves it until Ctrl-C.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    let given = Given {
        folder: arguments.folder.clone(),
        model: model(arguments).as_deref().map(shipped),
        logs: arguments.logs.clone(),
        reading: arguments.reading.of_workbench(),
        #[cfg(feature = "demo")]
        failsafes: Failsafes::new(|kind| faults::shipped(kind).map_err(|e| format!("{e:#}"))),
    };
    let token = random_token().context("cannot draw a token for the page")?;
    serve(given, arguments.port, &token, |address| {
        let session = arguments.folder.display();
        // if standard output is closed, the page is served all the same
        let _ = write!(
            std::io::stdout(),
            "the workbench is open at {address}\nsession: {session}; Ctrl-C ends it\n"
        );
    })
    .with_context(|| format!("cannot open the workbench in {}", arguments.folder.display()))?;
    Ok(ExitCode::SUCCESS)
}
