//! Normal equations that are block-tridiagonal in time and bordered by constants.

use nalgebra::{SMatrix, SVector};

use super::nuisance::COUNT;

/// Unknowns at an instant: three each of attitude, velocity over ground and gust.
pub const NODE: usize = 9;

/// A square block of an instant's unknowns.
pub type Block = SMatrix<f64, NODE, NODE>;
/// An instant's unknowns by the constants.
pub type Border = SMatrix<f64, NODE, COUNT>;
/// An instant's unknowns.
pub type NodeVector = SVector<f64, NODE>;
/// The constants by the constants.
pub type Corner = SMatrix<f64, COUNT, COUNT>;
/// The constants.
pub type CornerVector = SVector<f64, COUNT>;

/// What one instant adds to the normal equations.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// Its own block.
    pub own: Block,
    /// Its coupling with the instant before: rows this one, columns the one before.
    pub back: Block,
    /// Its coupling with the constants.
    pub border: Border,
    /// Its right-hand side.
    pub right: NodeVector,
}

impl Row {
    /// Nothing.
    pub fn zero() -> Row {
        Row {
            own: Block::zeros(),
            back: Block::zeros(),
            border: Border::zeros(),
            right: NodeVector::zeros(),
        }
    }
}

/// An instant after elimination: its unknowns are `constant − border · p − next · x₊₁`.
#[derive(Clone, Copy, Debug)]
pub struct Eliminated {
    next: Block,
    border: Border,
    constant: NodeVector,
}

/// The constants' part of the normal equations, to which every stretch adds its share.
#[derive(Clone, Debug)]
pub struct Constants {
    /// Information matrix.
    pub matrix: Corner,
    /// Right-hand side.
    pub right: CornerVector,
    /// Logarithm of the determinant of all that was eliminated.
    pub log_det: f64,
    /// Fall of the sum of squares through the eliminated unknowns.
    pub fall: f64,
}

/// Eliminates the instants of a stretch one after another; `None` if a block is not positive.
pub fn eliminate(rows: &[Row], constants: &mut Constants) -> Option<Vec<Eliminated>> {
    let mut done: Vec<Eliminated> = Vec::with_capacity(rows.len());
    let mut row = *rows.first()?;
    for k in 0..rows.len() {
        let factor = row.own.cholesky()?;
        let next = match rows.get(k + 1) {
            Some(after) => factor.solve(&after.back.transpose()),
            None => Block::zeros(),
        };
        let (border, constant) = (factor.solve(&row.border), factor.solve(&row.right));
        constants.matrix -= row.border.transpose() * border;
        constants.right -= row.border.transpose() * constant;
        constants.fall += row.right.dot(&constant);
        constants.log_det += 2.0 * factor.l_dirty().diagonal().map(f64::ln).sum();
        done.push(Eliminated { next, border, constant });
        if let Some(after) = rows.get(k + 1) {
            row = Row {
                own: after.own - after.back * next,
                back: Block::zeros(),
                border: after.border - after.back * border,
                right: after.right - after.back * constant,
            };
        }
    }
    Some(done)
}

/// The unknowns of a stretch, given the constants.
pub fn substitute(eliminated: &[Eliminated], constants: &CornerVector) -> Vec<NodeVector> {
    let mut after = NodeVector::zeros();
    let mut all: Vec<NodeVector> = eliminated
        .iter()
        .rev()
        .map(|e| {
            after = e.constant - e.border * constants - e.next * after;
            after
        })
        .collect();
    all.reverse();
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    /// The band solution against a dense one of the same system.
    #[test]
    fn band_equals_dense() {
        const N: usize = 4;
        let size = N * NODE + COUNT;
        // residuals with pseudo-random coefficients, each touching two neighbours and the constants
        let mut seed = 1_u64;
        let mut random = || {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (seed >> 33) as f64 / (1_u64 << 31) as f64 - 0.5
        };
        let mut dense = DMatrix::<f64>::identity(size, size);
        let mut right = DVector::<f64>::zeros(size);
        for k in 0..N - 1 {
            for _ in 0..10 {
                let mut j = DVector::<f64>::zeros(size);
                j.rows_mut(k * NODE, 2 * NODE).iter_mut().for_each(|x| *x = random());
                j.rows_mut(N * NODE, COUNT).iter_mut().for_each(|x| *x = random());
                dense += &j * j.transpose();
                right += &j * random();
            }
        }
        let rows: Vec<Row> = (0..N)
            .map(|k| Row {
                own: dense.fixed_view::<NODE, NODE>(k * NODE, k * NODE).into(),
                back: if k > 0 {
                    dense.fixed_view::<NODE, NODE>(k * NODE, (k - 1) * NODE).into()
                } else {
                    Block::zeros()
                },
                border: dense.fixed_view::<NODE, COUNT>(k * NODE, N * NODE).into(),
                right: right.fixed_rows::<NODE>(k * NODE).into(),
            })
            .collect();
        let mut constants = Constants {
            matrix: dense.fixed_view::<COUNT, COUNT>(N * NODE, N * NODE).into(),
            right: right.fixed_rows::<COUNT>(N * NODE).into(),
            log_det: 0.0,
            fall: 0.0,
        };
        let eliminated = eliminate(&rows, &mut constants).unwrap();
        let factor = constants.matrix.cholesky().unwrap();
        let p = factor.solve(&constants.right);
        let x = substitute(&eliminated, &p);
        let reference = dense.clone().lu().solve(&right).unwrap();
        for (k, node) in x.iter().enumerate().take(N) {
            assert!((node - reference.fixed_rows::<NODE>(k * NODE)).norm() < 1e-12);
        }
        assert!((p - reference.fixed_rows::<COUNT>(N * NODE)).norm() < 1e-12);
        let fall = constants.fall + constants.right.dot(&p);
        assert!((fall - right.dot(&reference)).abs() < 1e-12);
        let log_det = constants.log_det + factor.determinant().ln();
        assert!((log_det - dense.determinant().ln()).abs() < 1e-10);
    }
}
