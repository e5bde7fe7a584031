//! Scripts that hand a campaign to a scheduler: an array of jobs a stage, each `greylag campaign run FILE --cell N`.

use super::file::StageFile;
use super::plan::Plan;

/// What runs the jobs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Launcher {
    /// Slurm's arrays.
    Slurm,
    /// HyperQueue's arrays.
    Hyperqueue,
    /// GNU parallel on this machine, or on those of its own options.
    Parallel,
}

/// What a script is filled with.
#[derive(Clone, Debug)]
pub struct Job {
    /// The program.
    pub program: String,
    /// The campaign file.
    pub file: String,
    /// The campaign's folder.
    pub out: String,
    /// Attempts at a cell that fails for a time (exit status 75).
    pub attempts: usize,
    /// Further options of the scheduler, such as a partition and a time limit.
    pub options: String,
}

const SLURM: &str = include_str!("launch/slurm.sh");
const HYPERQUEUE: &str = include_str!("launch/hyperqueue.sh");
const PARALLEL: &str = include_str!("launch/parallel.sh");

/// The script that submits `plan`.
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

/// The call of the script's function for a stage: its name, and its first and last cell.
fn line(plan: &Plan, stage: &StageFile) -> String {
    let numbers: Vec<usize> = plan.of_stage(&stage.name).map(|cell| cell.number).collect();
    let (first, last) = (numbers.first().unwrap_or(&0), numbers.last().unwrap_or(&0));
    format!("stage {} {first} {last}\n", stage.name)
}

/// A word for a shell.
fn quoted(word: &str) -> String {
    format!("'{}'", word.replace('\'', "'\\''"))
}
