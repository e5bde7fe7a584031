//! Logs for a fit, and logs for its validation, which the fit does not see.

use std::path::PathBuf;

use anyhow::Result;

use crate::commands::intake::{Intake, LogArguments};
use crate::model::GreyBox;
use crate::sysid::amend::split;
use crate::sysid::flight_path::ActuatorClock;
use crate::sysid::flight_path::reconstruction::Reconstruction;

/// Logs for the fit and logs for validation: those of `hold_out`. If `hold_out` is empty, the last of several `logs` is for
/// validation; a single log is only for the fit.
pub fn divided(logs: &[PathBuf], hold_out: &[PathBuf]) -> (Vec<PathBuf>, Vec<PathBuf>) {
    match (logs, hold_out) {
        ([first @ .., last], []) if !first.is_empty() => (first.to_vec(), vec![last.clone()]),
        _ => (logs.to_vec(), hold_out.to_vec()),
    }
}

/// The flights for validation: those of the files `held`, read as `logs` are. If `held` is empty, the first flight in `taken` is
/// split: its last third is returned, and `taken` keeps the first two thirds.
pub fn validation(
    logs: &LogArguments,
    held: Vec<PathBuf>,
    (model, clock): (&GreyBox, ActuatorClock),
    taken: &mut Intake,
) -> Result<Vec<Reconstruction>> {
    if held.is_empty() {
        let name = &taken.flights[0].name;
        taken.notes.push(format!("{name}: fitted to its first two thirds, judged by the last"));
        let [first, last] = split(&taken.flights[0]);
        taken.flights = vec![first];
        return Ok(vec![last]);
    }
    let more = logs.of(held).take_in_as(model, clock, &taken.installation)?;
    taken.notes.extend(more.notes);
    taken.in_doubt |= more.in_doubt;
    taken.used.extend(more.used);
    Ok(more.flights)
}
