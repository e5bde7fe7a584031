//! Columns that never change.

use super::ENOUGH;
use super::relation::values;
use crate::Sample;
use crate::columns::{COLUMNS, NEEDED};
use crate::finding::Finding;

/// Columns that show one and the same value, though they should move.
pub fn check(rows: &[Sample]) -> Vec<Finding> {
    COLUMNS.iter().filter_map(|(name, get, _)| dead(rows, name, *get)).collect()
}

fn dead(rows: &[Sample], name: &'static str, get: fn(&Sample) -> f64) -> Option<Finding> {
    let seen = values(rows, get);
    let first = *seen.first()?;
    if seen.len() < 2 * ENOUGH || may_rest(name) || seen.iter().any(|x| *x != first) {
        return None;
    }
    let text = format!(
        "{name} is constantly {first} over all {} rows: a sensor that is absent or dead",
        seen.len()
    );
    let needed = NEEDED.contains(&name);
    Some(if needed { Finding::problem(text) } else { Finding::warning(text) })
}

/// Commands rest, rudders are often absent, targets and a declared sampling hold.
fn may_rest(name: &str) -> bool {
    name.ends_with("_cmd")
        || name.ends_with("_target_rad")
        || matches!(
            name,
            "rudder_rad" | "air_density_kgpm3" | "rate_hold_s" | "throttle" | "altitude_m"
        )
}
