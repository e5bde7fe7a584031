//! Estimate of the noise of each channel (a force or a moment): a filter that whitens it, its variance, and its whitened values.
//!
//! The data are means over windows, which are short stretches of flight. A cell contains the windows of one channel of one
//! flight. A block is a stretch of about 4 s. A column is a regressor. A candidate is a physical effect that the model may lack.
//! A ridge regression explains the model's residual by all coefficients of the model and all candidates. The noise is the part
//! that it leaves unexplained.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::diagnose::regression::cells::{Cell, Cells, Placed};
use crate::diagnose::regression::local::CHANNELS;
use crate::diagnose::regression::whiten::Whitener;

/// Order of the autoregressive whitening filter.
const ORDER: usize = 8;
/// Ridge parameter of the regression, as a fraction of a column's squared norm.
const RIDGE: f64 = 1e-4;
/// Number of whitening filters that are fitted one after the other, each to the residual of a regression with the previous
/// filter.
const PASSES: usize = 2;

/// Noise of every channel.
#[derive(Clone)]
pub struct Noise {
    /// Whitening filter of each channel. It scales the noise to a variance of 1.
    pub whiteners: [Whitener; CHANNELS],
    /// Whitened noise, one list for each cell. The regression reduces the variance of its residual in each block. The noise is
    /// corrected for this reduction.
    pub residuals: Vec<Vec<f64>>,
}

impl Noise {
    /// Estimates the noise by a regression of the column with index `last`, the model's residual, on all other columns. `rich`
    /// holds the columns of each flight.
    pub fn estimate(cells: &Cells, rich: &[Placed], last: usize) -> Noise {
        let mut residuals = vec![Vec::new(); cells.list.len()];
        let whiteners = std::array::from_fn(|channel| {
            let own: Vec<usize> =
                (0..cells.list.len()).filter(|k| cells.list[*k].channel == channel).collect();
            let (whitener, left) = one_channel(cells, &own, rich, last);
            own.iter().zip(left).for_each(|(k, list)| residuals[*k] = list);
            whitener
        });
        Noise { whiteners, residuals }
    }
}

/// Whitened data of one cell: the regressors `x`, and the model's residual `y` that they are fitted to.
struct Rows {
    x: DMatrix<f64>,
    y: DVector<f64>,
}

fn one_channel(
    cells: &Cells,
    own: &[usize],
    rich: &[Placed],
    last: usize,
) -> (Whitener, Vec<Vec<f64>>) {
    let mut whitener = Whitener::fit(&[vec![1.0]], 0);
    for pass in 0..=PASSES {
        let rows: Vec<Rows> =
            own.iter().map(|k| rows(&cells.list[*k], rich, last, &whitener)).collect();
        let Some(fit) = Fit::new(&rows) else { break };
        let raw: Vec<Vec<f64>> =
            own.iter().flat_map(|k| raw_residual(&cells.list[*k], rich, last, &fit)).collect();
        if pass == PASSES {
            let lists: Vec<Vec<f64>> = own
                .iter()
                .zip(&rows)
                .map(|(k, rows)| fit.unshrunk(&cells.list[*k], rows))
                .collect();
            let count: usize = lists.iter().map(Vec::len).sum();
            let square: f64 = lists.iter().flatten().map(|x| x * x).sum();
            let level = (square / count as f64).sqrt();
            let level = if level.is_finite() && level > 0.0 { level } else { 1.0 };
            let lists = lists.iter().map(|l| l.iter().map(|x| x / level).collect()).collect();
            return (whitener.scaled(level), lists);
        }
        whitener = Whitener::fit(&raw, ORDER);
    }
    (whitener, own.iter().map(|k| vec![0.0; cells.list[*k].windows.len()]).collect())
}

fn rows(cell: &Cell, rich: &[Placed], last: usize, whitener: &Whitener) -> Rows {
    let (places, all) = cell.matrix(&rich[cell.flight], whitener);
    let width = rich.iter().flatten().map(|(place, _)| place + 1).max().unwrap_or(0);
    let mut x = DMatrix::zeros(cell.windows.len(), width);
    let mut y = DVector::zeros(cell.windows.len());
    for (k, place) in places.iter().enumerate() {
        if *place == last {
            y.copy_from(&all.column(k));
        } else {
            x.set_column(*place, &all.column(k));
        }
    }
    Rows { x, y }
}

/// Solution of the ridge regression. The columns are scaled to unit norm before the ridge is added.
struct Fit {
    scale: DVector<f64>,
    inverse: Cholesky<f64, Dyn>,
    solution: DVector<f64>,
}

impl Fit {
    fn new(rows: &[Rows]) -> Option<Fit> {
        let width = rows.first()?.x.ncols();
        let mut gram = DMatrix::zeros(width, width);
        let mut product = DVector::zeros(width);
        for r in rows {
            gram += r.x.tr_mul(&r.x);
            product += r.x.tr_mul(&r.y);
        }
        let scale = gram.diagonal().map(|d| if d > 0.0 { d.sqrt().recip() } else { 0.0 });
        for i in 0..width {
            for j in 0..width {
                gram[(i, j)] *= scale[i] * scale[j];
            }
            gram[(i, i)] += if scale[i] > 0.0 { RIDGE } else { 1.0 };
        }
        let inverse = gram.cholesky()?;
        let solution = inverse.solve(&product.component_mul(&scale)).component_mul(&scale);
        Some(Fit { scale, inverse, solution })
    }

    /// The residual of the regression in `rows`, with each block b multiplied by (I − H_bb)^(−1/2), where H is the hat matrix.
    /// This restores the variance that the noise has without the regression (Bell and McCaffrey 2002, "CR2").
    fn unshrunk(&self, cell: &Cell, rows: &Rows) -> Vec<f64> {
        let left = &rows.y - &rows.x * &self.solution;
        let mut out = vec![0.0; left.len()];
        for (_, from, to) in cell.rows_of_blocks() {
            let mut scaled = rows.x.rows(from, to - from).transpose();
            for (mut row, s) in scaled.row_iter_mut().zip(self.scale.iter()) {
                row *= *s;
            }
            let half = self
                .inverse
                .l()
                .solve_lower_triangular(&scaled)
                .unwrap_or_else(|| DMatrix::zeros(scaled.nrows(), scaled.ncols()));
            let hat = half.tr_mul(&half);
            let turn = (DMatrix::identity(to - from, to - from) - hat).symmetric_eigen();
            // the eigenvalues have a lower bound, because the correction of a block that the regression almost reproduces would
            // be too large
            let root = turn.eigenvalues.map(|e| e.max(0.04).sqrt().recip());
            let part = turn.eigenvectors.tr_mul(&left.rows(from, to - from));
            let part = &turn.eigenvectors * part.component_mul(&root);
            out[from..to].copy_from_slice(part.as_slice());
        }
        out
    }
}

/// The residual of the regression `fit` in the data before whitening, one list for each sequence of adjacent windows.
fn raw_residual(cell: &Cell, rich: &[Placed], last: usize, fit: &Fit) -> Vec<Vec<f64>> {
    let mut left = vec![0.0; cell.windows.iter().max().map_or(0, |w| w + 1)];
    for (place, column) in &rich[cell.flight] {
        let weight = if *place == last { 1.0 } else { -fit.solution[*place] };
        for w in cell.windows.iter().filter(|_| !column[cell.channel].is_empty()) {
            left[*w] += weight * column[cell.channel][*w];
        }
    }
    cell.split(&left)
}
