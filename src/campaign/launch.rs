//! Scripts that submit a campaign to a scheduler.
//!
//! A campaign runs in stages, one after the other. Each stage has cells: runs of one command with different parameters.
//! A script submits the cells of a stage as one array of jobs. Each job runs `greylag campaign run FILE --cell N`.

use super::file::StageFile;
use super::plan::Plan;

/// Schedulers for which scripts are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Launcher {
    /// Job arrays of Slurm.
    Slurm,
    /// Task arrays of HyperQueue.
    Hyperqueue,
    /// GNU parallel on this machine, or on the machines named in its options.
    Parallel,
}

/// Values that are inserted into a script.
#[derive(Clone, Debug)]
pub struct Job {
    /// Path of the program `greylag`.
    pub program: String,
    /// Path of the campaign file.
    pub file: String,
    /// Path of the campaign's output folder.
    pub out: String,
    /// Largest number of attempts at a cell. An attempt is repeated after exit status 75 (a later attempt may succeed), and
    /// if a signal ended the process.
    pub attempts: usize,
    /// Further options of the scheduler, such as a partition and a time limit.
    pub options: String,
}

const SLURM: &str = include_str!("launch/slurm.sh");
const HYPERQUEUE: &str = include_str!("launch/hyperqueue.sh");
const PARALLEL: &str = include_str!("launch/parallel.sh");

/// The script that submits `plan` with the scheduler `launcher`.
pub fn script(launcher: Launcher, plan: &Plan, job: &Job) -> String {
    let template = match launcher {
        Launcher::Slurm => SLURM,
        Launcher::Hyperqueue => HYPERQUEUE,
        Launcher::Parallel => PARALLEL,
    };
    let stages: String = plan.file.stages.iter().map(|stage| line(plan, stage)).collect();
    template
        .replace("@NAME@", &plan.file.name)
        .replace("@PROGRAM@", &quoted(&job.program))
        .replace("@FILE@", &quoted(&job.file))
        .replace("@OUT@", &quoted(&job.out))
        .replace("@ATTEMPTS@", &job.attempts.to_string())
        .replace("@OPTIONS@", &job.options)
        .replace("@STAGES@", stages.trim_end())
}

/// The script's line for a stage: the stage's name, and the numbers of its first and last cell.
fn line(plan: &Plan, stage: &StageFile) -> String {
    let numbers: Vec<usize> = plan.of_stage(&stage.name).map(|cell| cell.number).collect();
    let (first, last) = (numbers.first().unwrap_or(&0), numbers.last().unwrap_or(&0));
    format!("stage {} {first} {last}\n", stage.name)
}

/// Quotes a word for a shell.
fn quoted(word: &str) -> String {
    format!("'{}'", word.replace('\'', "'\\''"))
}
