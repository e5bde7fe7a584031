//! Rows with the values of columns that are sampled at other times than the rest of the row.

use crate::Sample;
use crate::columns::{COLUMNS, Column, index};

/// Time for which a value is held, s.
const HELD_S: f64 = 0.5;

/// The rows at intervals of at least `every_s`. In the columns `names`, a missing value is replaced by the last one before it.
pub fn held(rows: &[Sample], names: &[&str], every_s: f64) -> Vec<Sample> {
    let columns: Vec<Column> = names.iter().filter_map(|n| Some(COLUMNS[index(n)?])).collect();
    let mut last = vec![(f64::NEG_INFINITY, f64::NAN); columns.len()];
    let (mut out, mut kept) = (Vec::new(), f64::NEG_INFINITY);
    for row in rows {
        for (last, (_, get, _)) in last.iter_mut().zip(&columns) {
            if get(row).is_finite() {
                *last = (row.time_s, get(row));
            }
        }
        if row.time_s - kept < every_s {
            continue;
        }
        kept = row.time_s;
        let mut full = *row;
        for ((since, value), (_, _, place)) in last.iter().zip(&columns) {
            *place(&mut full) = if row.time_s - since <= HELD_S { *value } else { f64::NAN };
        }
        out.push(full);
    }
    out
}
