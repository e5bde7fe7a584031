//! `greylag campaign run --cell`: runs one cell in this process. A cell is a command line of a campaign, run at one
//! combination of settings. Its results are written to a folder of its own.

use std::ffi::OsString;
use std::io::ErrorKind;
use std::path::Path;
use std::process::ExitCode;
use std::time::{Instant, SystemTime, UNIX_EPOCH};

use anyhow::{Context, Result, bail};

use crate::campaign::harvest::harvest;
use crate::campaign::store::{Claimed, Failure, Times};
use crate::campaign::{Cell, Plan, Record, Standing, Store};
use crate::commands::interruption::{Ended, Interruption};
use crate::commands::{self, VERSION, one_line, status};

/// Subcommands that a cell may run: the name, whether this build of the program has it, and the feature that it needs.
const KNOWN: [(&str, bool, &str); 3] = [
    ("collect", cfg!(feature = "demo"), "sitl"),
    ("evaluate", cfg!(feature = "demo"), "sitl"),
    ("train", cfg!(feature = "learn"), "learn"),
];

/// Fails if the command line of a cell does not begin with a subcommand that a cell may run, or if its arguments are invalid.
/// The arguments of a subcommand that this build lacks are not checked; `run` then reports the missing feature.
pub fn check(plan: &Plan, store: &Store, path: &Path) -> Result<()> {
    for cell in &plan.cells {
        let about = || format!("campaign file {}: stage {}", path.display(), cell.stage);
        let first = cell.words.first().map(String::as_str).unwrap_or_default();
        match KNOWN.iter().find(|(name, ..)| *name == first) {
            None => bail!(
                "{}: command {first:?} cannot be a cell: it may begin with collect, train or evaluate",
                about()
            ),
            Some((_, true, _)) => {
                commands::check_line(&line(cell, store.folder())).with_context(about)?;
            }
            Some(_) => (),
        }
    }
    Ok(())
}

fn line(cell: &Cell, folder: &Path) -> Vec<OsString> {
    cell.words_in(folder).into_iter().map(OsString::from).collect()
}

/// Runs a cell, unless it is done. The exit status is `TRY_AGAIN` if a later attempt may succeed.
pub fn run(plan: &Plan, store: &Store, cell: &Cell) -> Result<ExitCode> {
    let id = &cell.id;
    if let Standing::Done(_) = store.standing(cell)? {
        println!("cell {id}: done before");
        return Ok(ExitCode::SUCCESS);
    }
    if let Some((_, _, feature)) =
        KNOWN.iter().find(|(name, there, _)| cell.words[0] == *name && !there)
    {
        bail!(
            "cell {id} needs a program built with the feature {feature}; see the how-to on campaigns"
        );
    }
    for before in cell.after.iter().map(|number| &plan.cells[number - 1]) {
        match store.standing(before)? {
            Standing::Done(_) => (),
            Standing::Failed(failure) => {
                bail!("cell {id} reads cell {}, which failed: {}", before.id, failure.error)
            }
            _ => return Ok(later(&format!("cell {id} waits for cell {}", before.id))),
        }
    }
    let Some(claimed) = store.claim(cell)? else {
        return Ok(later(&format!("cell {id} is being run by another process")));
    };
    // another process may have finished the cell in the meantime
    if let Standing::Done(_) = store.standing(cell)? {
        return Ok(ExitCode::SUCCESS);
    }
    carry_out(plan, store, cell, &claimed)
}

fn later(why: &str) -> ExitCode {
    eprintln!("greylag: {why}; try again");
    ExitCode::from(status::TRY_AGAIN)
}

fn carry_out(plan: &Plan, store: &Store, cell: &Cell, claimed: &Claimed) -> Result<ExitCode> {
    println!("cell {} of {}: {}\n    {}", cell.number, plan.cells.len(), cell.id, cell.command());
    let begun = Instant::now();
    let ended = commands::carry_out(&line(cell, store.folder()), &Interruption::watch()?).and_then(
        |ended| match ended {
            Ended::Done => Ok(Some(record(plan, cell, claimed)?)),
            Ended::Interrupted => Ok(None),
        },
    );
    match ended {
        Ok(Some(record)) => {
            claimed.finish(&record, &times(cell, claimed, begun.elapsed().as_secs_f64()))?;
            println!("cell {}: done in {:.0} s", cell.id, begun.elapsed().as_secs_f64());
            Ok(ExitCode::SUCCESS)
        }
        Ok(None) => Ok(later(&format!("cell {} was interrupted", cell.id))),
        Err(error) if is_temporary(&error) => {
            Ok(later(&format!("cell {}: {}", cell.id, one_line::one_line(&error))))
        }
        Err(error) => {
            let said = one_line::one_line(&error);
            claimed.fail(&Failure { error: said, program: program() })?;
            Err(error.context(format!("cell {}", cell.id)))
        }
    }
}

fn record(plan: &Plan, cell: &Cell, claimed: &Claimed) -> Result<Record> {
    let harvest = harvest(&claimed.folder)?;
    Ok(Record {
        schema: Record::SCHEMA.into(),
        campaign: plan.file.name.clone(),
        cell: cell.id.clone(),
        stage: cell.stage.clone(),
        levels: cell.levels.clone(),
        seed: cell.seed(),
        identity: cell.identity.clone(),
        program: program(),
        command: cell.command(),
        inputs: cell.inputs.clone(),
        files: harvest.files,
        metrics: harvest.metrics,
        curve: harvest.curve,
    })
}

fn program() -> String {
    format!("greylag {}", VERSION.as_str())
}

fn times(cell: &Cell, claimed: &Claimed, seconds: f64) -> Times {
    Times {
        cell: cell.id.clone(),
        seconds,
        core_seconds: core_seconds().unwrap_or(seconds),
        resumed: claimed.resumed,
        ended_unix_s: SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |t| t.as_secs()),
        processor: processor(),
        program: program(),
    }
}

/// Processor time of all threads of this process, s, from /proc. `None` on systems other than Linux.
fn core_seconds() -> Option<f64> {
    /// Number of ticks per second. The times in /proc are in ticks.
    const TICKS: f64 = 100.0;
    let text = std::fs::read_to_string("/proc/self/stat").ok()?;
    // the second field is a name in parentheses, which may hold spaces
    let fields: Vec<&str> = text.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks = |at: usize| fields.get(at)?.parse::<f64>().ok();
    Some((ticks(11)? + ticks(12)?) / TICKS)
}

fn processor() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = text.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": "));
    name.map_or(std::env::consts::ARCH.into(), |(_, name)| name.trim().to_owned())
}

/// Whether a cause of the error is temporary, such as a full disk, so that a later attempt may succeed.
fn is_temporary(error: &anyhow::Error) -> bool {
    use ErrorKind::{
        Interrupted, OutOfMemory, QuotaExceeded, ResourceBusy, StaleNetworkFileHandle, StorageFull,
        TimedOut, WouldBlock,
    };
    let kinds = [
        Interrupted,
        OutOfMemory,
        QuotaExceeded,
        ResourceBusy,
        StaleNetworkFileHandle,
        StorageFull,
        TimedOut,
        WouldBlock,
    ];
    error
        .chain()
        .filter_map(|cause| cause.downcast_ref::<std::io::Error>())
        .any(|e| kinds.contains(&e.kind()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_disk_passes_and_a_missing_file_does_not() {
        let of = |kind: ErrorKind| {
            is_temporary(&anyhow::Error::from(std::io::Error::from(kind)).context("writing"))
        };
        assert!(of(ErrorKind::StorageFull) && !of(ErrorKind::NotFound));
        assert!(!is_temporary(&anyhow::anyhow!("no such option")));
    }

    #[test]
    fn the_time_of_the_cores_is_known_on_linux() {
        if cfg!(target_os = "linux") {
            let begun = Instant::now();
            let mut sum = 0u64;
            while begun.elapsed().as_millis() < 60 {
                sum = sum.wrapping_mul(3).wrapping_add(1);
            }
            assert!(std::hint::black_box(sum) != 2 && core_seconds().unwrap() > 0.0);
        }
    }
}
