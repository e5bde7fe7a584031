//! Checks for columns that never change.

use super::ENOUGH;
use super::relation::values;
use crate::Sample;
use crate::columns::{BLOCK, COLUMNS, NEEDED};
use crate::finding::Finding;

/// Findings about measured columns that are constant in all rows.
pub fn check(rows: &[Sample]) -> Vec<Finding> {
    seen(rows).iter().zip(COLUMNS).filter_map(|(seen, (name, ..))| dead(seen, name)).collect()
}

/// Columns of sensors without which a flight can be reconstructed.
const OPTIONAL: [&str; 9] = [
    "yaw_rad",
    "alpha_rad",
    "beta_rad",
    "ax_mps2",
    "ay_mps2",
    "az_mps2",
    "vn_mps",
    "ve_mps",
    "vd_mps",
];

/// Sets those of the [`OPTIONAL`] columns that are constant in all rows to NaN. An example is the vertical velocity of a
/// horizontal GPS export.
pub fn blank(rows: &mut [Sample]) {
    for (seen, (name, _, place)) in seen(rows).iter().zip(COLUMNS) {
        if OPTIONAL.contains(&name) && dead(seen, name).is_some() {
            rows.iter_mut().for_each(|row| *place(row) = f64::NAN);
        }
    }
}

fn seen(rows: &[Sample]) -> [Seen; COLUMNS.len()] {
    let mut seen = COLUMNS.map(|_| Seen::default());
    for block in rows.chunks(BLOCK) {
        for (seen, (_, get, _)) in seen.iter_mut().zip(COLUMNS).filter(|(seen, _)| !seen.moves) {
            block.iter().map(get).filter(|x| x.is_finite()).for_each(|x| seen.take(x));
        }
    }
    seen
}

/// First value of a column, number of its values, and whether they differ.
#[derive(Default)]
struct Seen {
    first: Option<f64>,
    count: usize,
    moves: bool,
}

impl Seen {
    fn take(&mut self, x: f64) {
        self.moves |= *self.first.get_or_insert(x) != x;
        self.count += 1;
    }
}

fn dead(seen: &Seen, name: &'static str) -> Option<Finding> {
    let first = seen.first?;
    if seen.count < 2 * ENOUGH || may_rest(name) || seen.moves {
        return None;
    }
    let text = format!(
        "{name} is constantly {first} over all {} rows: a sensor that is absent or dead",
        seen.count
    );
    Some(match name {
        name if NEEDED.contains(&name) => Finding::problem(text),
        name if OPTIONAL.contains(&name) => Finding::warning(text + "; it is not used"),
        _ => Finding::warning(text),
    })
}

/// Returns a problem if the commands of aileron and elevator are constant in flight and no recorded deflection of these surfaces
/// changes. The commands that fly the aircraft are then in another channel or instance.
pub fn commands(flown: &[Sample]) -> Option<Finding> {
    let rests = |name: &str| {
        let get = COLUMNS.iter().find(|c| c.0 == name).map(|c| c.1)?;
        let seen = values(flown, get);
        let first = *seen.first()?;
        let rests = seen.len() >= 2 * ENOUGH && seen.iter().all(|x| *x == first);
        rests.then_some((name.to_owned(), first))
    };
    let moves = |name: &str| {
        let get = COLUMNS.iter().find(|c| c.0 == name).map(|c| c.1);
        let seen = get.map(|get| values(flown, get)).unwrap_or_default();
        seen.iter().any(|x| *x != seen[0])
    };
    let (aileron, elevator) = (rests("aileron_cmd")?, rests("elevator_cmd")?);
    if moves("aileron_rad") || moves("elevator_rad") {
        return None;
    }
    Some(Finding::problem(format!(
        "{} is constantly {} and {} is constantly {} all through the flight: this is not what flies the aircraft; \
         name another channel in a mapping, or another instance with --source",
        aileron.0, aileron.1, elevator.0, elevator.1
    )))
}

/// Whether a column may be constant in a correct log. Examples are commands, targets, an absent rudder and the declared sampling
/// of the rates.
fn may_rest(name: &str) -> bool {
    name.ends_with("_cmd")
        || name.ends_with("_target_rad")
        || matches!(
            name,
            "rudder_rad" | "air_density_kgpm3" | "rate_hold_s" | "throttle" | "altitude_m"
        )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_constant_vertical_velocity_is_not_used() {
        let row = |k: usize| {
            let north = 15.0 + (k as f64).sin();
            let velocity_ned_mps = [north, 0.1 * north, 0.0];
            Sample { time_s: k as f64, velocity_ned_mps, aileron_rad: 0.0, ..Sample::default() }
        };
        let mut rows: Vec<Sample> = (0..200).map(row).collect();
        let said: Vec<String> = check(&rows).into_iter().map(|f| f.text).collect();
        assert!(said.iter().any(|s| s.starts_with("vd_mps") && s.ends_with("it is not used")));
        blank(&mut rows);
        assert!(rows.iter().all(|r| r.velocity_ned_mps[2].is_nan() && r.aileron_rad == 0.0));
        assert!(rows.iter().all(|r| r.velocity_ned_mps[0].is_finite()));
    }
}
