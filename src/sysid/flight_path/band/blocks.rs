//! Operations on the small matrices of the band solver.

use super::{Block, Wide};

/// Adds the product xᵀ y to `into`. Most entries of `x` are zero.
pub fn add_gram<const R: usize, const A: usize, const B: usize>(
    into: &mut [[f64; B]; A],
    x: &[[f64; A]; R],
    y: &[[f64; B]; R],
) {
    for (i, row) in into.iter_mut().enumerate() {
        for (x, y) in x.iter().zip(y).filter(|(x, _)| x[i] != 0.0) {
            for (sum, y) in row.iter_mut().zip(y) {
                *sum += x[i] * y;
            }
        }
    }
}

/// Adds the upper triangle of the product xᵀ x to `into`. Most entries of `x` are zero.
pub fn add_upper_gram<const R: usize, const A: usize>(into: &mut [[f64; A]; A], x: &[[f64; A]; R]) {
    for (i, row) in into.iter_mut().enumerate() {
        for x in x.iter().filter(|x| x[i] != 0.0) {
            for (sum, y) in row[i..].iter_mut().zip(&x[i..]) {
                *sum += x[i] * y;
            }
        }
    }
}

pub(super) fn subtract_gram<const R: usize, const A: usize, const B: usize>(
    into: &mut [[f64; B]; A],
    x: &[[f64; A]; R],
    y: &[[f64; B]; R],
) {
    for (i, row) in into.iter_mut().enumerate() {
        let by: [f64; R] = std::array::from_fn(|k| x[k][i]);
        subtract_products(row, &by, y, 0);
    }
}

/// Number of columns whose sums stay in registers.
pub(super) const BLOCK: usize = 8;

/// Subtracts each of `rows` times its factor in `by` from `sums`, beginning with the column `from`.
#[inline(always)]
pub(super) fn subtract_products<const R: usize, const B: usize>(
    sums: &mut [f64; B],
    by: &[f64; R],
    rows: &[[f64; B]; R],
    from: usize,
) {
    let mut at = from;
    while at + BLOCK <= B {
        let mut block = [0.0; BLOCK];
        block.copy_from_slice(&sums[at..at + BLOCK]);
        for (by, row) in by.iter().zip(rows) {
            for (sum, x) in block.iter_mut().zip(&row[at..at + BLOCK]) {
                *sum -= by * x;
            }
        }
        sums[at..at + BLOCK].copy_from_slice(&block);
        at += BLOCK;
    }
    for (by, row) in by.iter().zip(rows) {
        for (sum, x) in sums[at..].iter_mut().zip(&row[at..]) {
            *sum -= by * x;
        }
    }
}

pub(super) fn add<const A: usize, const B: usize>(into: &mut [[f64; B]; A], other: &[[f64; B]; A]) {
    for (row, other) in into.iter_mut().zip(other) {
        row.iter_mut().zip(other).for_each(|(x, y)| *x += y);
    }
}

/// Lower Cholesky factor L with L Lᵀ = `a`; `None` if `a` is not positive definite.
pub(super) fn cholesky<const N: usize>(a: &Block<N>) -> Option<Block<N>> {
    let mut l = [[0.0; N]; N];
    for i in 0..N {
        for j in 0..=i {
            let dot: f64 = (0..j).map(|k| l[i][k] * l[j][k]).sum();
            let left = a[i][j] - dot;
            l[i][j] = if i == j { left.sqrt() } else { left / l[j][j] };
        }
        if !(l[i][i].is_finite() && l[i][i] > 0.0) {
            return None;
        }
    }
    Some(l)
}

/// Solves L x = `y` and replaces `y` by the solution x.
pub(super) fn forward<const N: usize, const W: usize>(l: &Block<N>, y: &mut Wide<N, W>) {
    for (i, by) in l.iter().enumerate() {
        let (done, rest) = y.split_at_mut(i);
        let row = &mut rest[0];
        for (by, done) in by.iter().zip(done.iter()) {
            row.iter_mut().zip(done).for_each(|(x, d)| *x -= by * d);
        }
        let scale = by[i].recip();
        row.iter_mut().for_each(|x| *x *= scale);
    }
}

pub(super) fn transposed<const N: usize>(a: &Block<N>) -> Block<N> {
    std::array::from_fn(|i| std::array::from_fn(|j| a[j][i]))
}
