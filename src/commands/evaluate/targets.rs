//! The flights by which `greylag evaluate` scores a controller. Each flies to a target (a commanded roll and pitch) of a file,
//! or steps from one random attitude to another.

use anyhow::{Result, bail};

use super::Arguments;
use crate::commands::files::shipped;
use crate::physics::Airframe;
use crate::physics::airframe::Envelope;
use crate::sim::evaluation::{Course, courses as of_targets};
use crate::sim::steps::steps;
use crate::sim::targets::{Row, TargetFile};

/// The targets of the file that the options select; empty with `--no-targets`.
pub(super) fn rows(arguments: &Arguments) -> Result<Vec<Row>> {
    if arguments.no_targets {
        if arguments.steps == 0 {
            bail!("--no-targets leaves nothing to fly: give --steps N, or leave it out");
        }
        return Ok(Vec::new());
    }
    let mut rows = TargetFile::load(&shipped(&arguments.targets))?.rows;
    let path = arguments.targets.display();
    rows.retain(|row| row.number % arguments.every == arguments.every - 1);
    if rows.is_empty() {
        bail!("{path} has fewer targets than --every {}; give a smaller number", arguments.every);
    }
    if !arguments.groups.is_empty() {
        rows.retain(|row| arguments.groups.contains(&row.group));
    }
    if rows.is_empty() {
        bail!("{path} has no targets of that group; leave --group out");
    }
    Ok(rows)
}

/// The targets of `rows` within the bank and pitch limits of the airframe's envelope, or all with `--beyond-envelope`. Prints
/// the number of excluded targets.
pub(super) fn within_envelope(
    mut rows: Vec<Row>,
    arguments: &Arguments,
    airframe: &Airframe,
) -> Result<Vec<Row>> {
    let Envelope { bank_max_deg: bank, pitch_min_deg: low, pitch_max_deg: high, .. } =
        airframe.envelope;
    let all = rows.len();
    if arguments.beyond_envelope || all == 0 {
        return Ok(rows);
    }
    rows.retain(|row| row.roll_deg.abs() <= bank && (low..=high).contains(&row.pitch_deg));
    let limits =
        format!("the envelope of {} (bank {bank}°, pitch {low} to {high}°)", airframe.name);
    match rows.len() {
        0 => bail!("all targets lie beyond {limits}: give others, or --beyond-envelope"),
        left if left < all => eprintln!(
            "{} of {all} targets lie beyond {limits} and are not flown; --beyond-envelope flies them",
            all - left
        ),
        _ => {}
    }
    Ok(rows)
}

/// The flights to the targets `rows` at a commanded airspeed of `airspeed` (m/s), followed by the flights with a step.
pub(super) fn courses(
    arguments: &Arguments,
    rows: &[Row],
    airspeed: f64,
    airframe: &Airframe,
) -> Vec<Course> {
    let mut courses = of_targets(rows, airspeed);
    courses.extend(steps(arguments.seed.into(), arguments.steps, airframe));
    courses
}
