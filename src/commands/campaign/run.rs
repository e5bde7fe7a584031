//! `greylag campaign run`: runs the cells of a campaign. A campaign is a set of runs over models, controllers and seeds. A cell
//! is one of these runs.
//!
//! The command runs all cells on this machine, runs one cell, or writes the script that submits all cells to a scheduler.

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use anyhow::{Context, Result, bail};
use clap::ValueEnum;

use super::{Which, local, one};
use crate::campaign::launch::{Job, Launcher, script};
use crate::campaign::{Plan, Store};
use crate::commands::files::shipped;

/// Options of `greylag campaign run`.
#[derive(clap::Args)]
#[command(group(clap::ArgGroup::new("how").required(true).args(["local", "cell", "launcher"])))]
pub struct Arguments {
    #[command(flatten)]
    which: Which,
    /// Run all cells on this machine.
    #[arg(long)]
    local: bool,
    /// Number of cells to run in parallel [default: the number of cores].
    #[arg(long, value_name = "N", requires = "local", value_parser = clap::value_parser!(u16).range(1..))]
    jobs: Option<u16>,
    /// Run the cells again that failed permanently in an earlier run.
    #[arg(long, requires = "local")]
    failed: bool,
    /// Run only these cells and those that they read, such as `"controllers prior=true seed=1"`; may be repeated.
    #[arg(long, value_name = "STAGE AXIS=LEVEL …", requires = "local")]
    only: Vec<String>,
    /// Run one cell, given by its number or id; exit status 75: another attempt may succeed, 1: it failed permanently.
    #[arg(long, value_name = "ID")]
    cell: Option<String>,
    /// Print the script that submits the cells to a scheduler.
    #[arg(long, value_enum)]
    launcher: Option<Launch>,
    /// Run the script of the scheduler instead of printing it.
    #[arg(long, requires = "launcher")]
    submit: bool,
    /// Further options of the scheduler, such as `--partition=short --time=02:00:00`.
    #[arg(
        long,
        value_name = "TEXT",
        requires = "launcher",
        default_value = "",
        allow_hyphen_values = true
    )]
    options: String,
}

/// Schedulers that can run the cells.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Launch {
    /// Job arrays of Slurm.
    Slurm,
    /// Task arrays of HyperQueue.
    Hyperqueue,
    /// GNU parallel on one machine.
    Parallel,
}

/// Largest number of attempts at a cell. Another attempt is made only if the cell was killed or ended with exit status 75.
const ATTEMPTS: usize = 20;

/// Runs the chosen cells, or prints or executes the script.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    let (plan, store) = arguments.which.open()?;
    if let Some(name) = &arguments.cell {
        let cell = plan.cell(name).map_err(anyhow::Error::msg)?;
        return one::run(&plan, &store, cell);
    }
    if let Some(launcher) = arguments.launcher {
        return arguments.launch(launcher, &plan, &store);
    }
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let jobs = arguments.jobs.map_or(cores, usize::from);
    let again = if arguments.failed { local::Failed::Again } else { local::Failed::Leave };
    let chosen = plan.only(&arguments.only).map_err(anyhow::Error::msg).context("--only")?;
    local::run(&plan, &store, &arguments.which.file, &chosen, jobs, again)
}

impl Arguments {
    /// Prints the script for the scheduler, or executes it with `--submit`.
    fn launch(&self, launcher: Launch, plan: &Plan, store: &Store) -> Result<ExitCode> {
        let launcher = match launcher {
            Launch::Slurm => Launcher::Slurm,
            Launch::Hyperqueue => Launcher::Hyperqueue,
            Launch::Parallel => Launcher::Parallel,
        };
        // paths are absolute because a job may start in another folder
        let job = Job {
            program: absolute(&std::env::current_exe().context("finding this program")?)?,
            file: absolute(&shipped(&self.which.file))?,
            out: absolute(store.folder())?,
            attempts: ATTEMPTS,
            options: self.options.clone(),
        };
        let text = script(launcher, plan, &job);
        if !self.submit {
            print!("{text}");
            return Ok(ExitCode::SUCCESS);
        }
        let status = Command::new("bash").arg("-c").arg(&text).status();
        let status = status.context("running the script with bash")?;
        if !status.success() {
            bail!(
                "the script ended with {status}; print it with --launcher alone and run its lines by hand"
            );
        }
        Ok(ExitCode::SUCCESS)
    }
}

fn absolute(path: &Path) -> Result<String> {
    let path: PathBuf = std::path::absolute(path)
        .with_context(|| format!("cannot find the folder of {}", path.display()))?;
    Ok(path.display().to_string())
}
