//! Checks for columns that never change.

use super::ENOUGH;
use super::relation::values;
use crate::Sample;
use crate::columns::{BLOCK, COLUMNS, NEEDED};
use crate::finding::Finding;

/// Findings about measured columns that are constant in all rows.
pub fn check(rows: &[Sample]) -> Vec<Finding> {
    let mut seen = COLUMNS.map(|_| Seen::default());
    for block in rows.chunks(BLOCK) {
        for (seen, (_, get, _)) in seen.iter_mut().zip(COLUMNS).filter(|(seen, _)| !seen.moves) {
            block.iter().map(get).filter(|x| x.is_finite()).for_each(|x| seen.take(x));
        }
    }
    seen.iter().zip(COLUMNS).filter_map(|(seen, (name, ..))| dead(seen, name)).collect()
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
    let needed = NEEDED.contains(&name);
    Some(if needed { Finding::problem(text) } else { Finding::warning(text) })
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
