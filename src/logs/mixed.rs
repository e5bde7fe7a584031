//! Computes the deflections and commands of aileron, elevator, rudder and throttle from columns of the individual surfaces
//! and motors of an airframe. Each is a weighted sum; the airframe's mixer holds the weights.

use super::columns::{COLUMNS, Place, index};
use super::mapping::Mapping;
use greylag_physics::mixer::{Does, Mixer};

/// Contribution of one file column to one log-format column.
pub(super) struct Share {
    /// Index of the file column.
    pub field: usize,
    /// Name of the log-format column.
    pub column: &'static str,
    /// Access to that column in a sample.
    pub place: Place,
    /// Factor on the file column.
    pub share: f64,
}

/// Columns of the deflections, then of the commands, in the order of the mixer's controls.
const DEFLECTIONS: [&str; 4] = ["aileron_rad", "elevator_rad", "rudder_rad", "throttle"];
const COMMANDS: [&str; 4] = ["aileron_cmd", "elevator_cmd", "rudder_cmd", "throttle_cmd"];

/// Finds the log-format columns that can be computed from the file's columns `names` with the mixer of `mapping`. For
/// a surface or motor NAME, NAME_rad and NAME_throttle give deflections and throttle, and NAME_cmd gives commands.
/// Columns that the file or the mapping already has are left out.
pub(super) fn columns(names: &[String], mapping: &Mapping) -> Vec<Share> {
    let Some(mixer) = mapping.mixer() else { return Vec::new() };
    let deflections: Vec<[f64; 4]> = mixer.shares().collect();
    let is_there =
        |column: &str| names.iter().any(|n| n == column) || mapping.get(column).is_some();
    let of = |columns: [&'static str; 4], shares: &[[f64; 4]], suffix: fn(Does) -> &'static str| {
        let made = (0..4).filter(|j| !is_there(columns[*j]));
        made.filter_map(|j| made_of(names, mixer, columns[j], j, shares, suffix))
            .flatten()
            .collect()
    };
    let position = |does| if does == Does::Pulls { "throttle" } else { "rad" };
    let both: [Vec<Share>; 2] =
        [of(DEFLECTIONS, &deflections, position), of(COMMANDS, mixer.command_shares(), |_| "cmd")];
    both.into_iter().flatten().collect()
}

/// The contributions to control `j` of the mixer; `None` if the file lacks a column for one of its surfaces or
/// motors.
fn made_of(
    names: &[String],
    mixer: &Mixer,
    column: &'static str,
    j: usize,
    shares: &[[f64; 4]],
    suffix: fn(Does) -> &'static str,
) -> Option<Vec<Share>> {
    let place = COLUMNS[index(column)?].2;
    let moving = mixer.effectors().iter().zip(shares).filter(|(_, share)| share[j] != 0.0);
    let all = moving.map(|(effector, share)| {
        let wanted = format!("{}_{}", effector.name, suffix(effector.does));
        let field = names.iter().position(|n| *n == wanted)?;
        Some(Share { field, column, place, share: share[j] })
    });
    all.collect()
}
