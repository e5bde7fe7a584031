//! Converts tables of numbers to SIMD blocks and back: one row per lane.

use greylag::model::block::Block;
use greylag::num::{Lanes, ROW};

/// The rows of a table with `K` columns from row `first`, one per lane. Lanes beyond the end of the table repeat the
/// last row. The table has at least one row.
pub fn gather<const K: usize>(table: &[f32], first: usize) -> [Block; K] {
    let last = table.len() / K - 1;
    let mut block = [Lanes([0.0; ROW]); K];
    for lane in 0..ROW {
        let row = (first + lane).min(last) * K;
        for (column, x) in block.iter_mut().zip(&table[row..row + K]) {
            column.0[lane] = *x;
        }
    }
    block
}

/// Writes the lanes of a block to the rows of `table` from row `first`. Lanes beyond the end of the table are dropped.
pub fn scatter<const K: usize>(block: &[Block; K], table: &mut [f32], first: usize) {
    let rows = table[first * K..].chunks_exact_mut(K).take(ROW);
    for (lane, row) in rows.enumerate() {
        for (x, column) in row.iter_mut().zip(block) {
            *x = column.0[lane];
        }
    }
}
