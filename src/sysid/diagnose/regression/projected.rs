//! The regression of the residual on the columns (regressors) of the candidates. A candidate is a physical effect that the model
//! may lack. The nuisance parameters are first projected out of residual and columns (Frisch–Waugh–Lovell). The Gram matrices of
//! the regression are computed for each block, a stretch of about 4 s of a flight.
//!
//! Residual and columns are whitened: filtered so that the noise becomes white. The prior of the nuisance parameters acts like
//! further rows, called its pseudo-observations.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::diagnose::regression::cells::{Cells, Placed};
use crate::diagnose::regression::noise::Noise;
use crate::diagnose::regression::whiten::Whitener;

/// A nuisance parameter: a coefficient of the model, a constant of a flight, or a sensor error. It must be estimated but is not
/// of interest.
#[derive(Clone, Debug)]
pub struct Known {
    /// Name of the parameter.
    pub name: String,
    /// Prior standard deviation; infinite for the linear coefficients of an added effect.
    pub width: f64,
    /// Prior mean minus the value at which the model was linearised.
    pub offset: f64,
}

impl Known {
    fn weight(&self) -> f64 {
        if self.width.is_finite() { self.width.powi(-2) } else { 0.0 }
    }
}

/// The columns of the candidates after the projection, with their Gram matrices. The last column is the projected residual.
pub struct Projected {
    /// Gram matrix of each block.
    pub blocks: Vec<DMatrix<f64>>,
    /// Gram matrix of the prior's pseudo-observations.
    pub prior: DMatrix<f64>,
    /// Sum of `prior` and of the Gram matrices of all blocks.
    pub total: DMatrix<f64>,
    /// For each block: scalar products of the columns of the candidates with the noise.
    pub noise: Vec<DVector<f64>>,
    /// Square root of `prior` for the candidates. Multiplied by standard normal random numbers, it gives a random draw of the
    /// contribution of the prior to the products of the candidates with the residual.
    pub prior_root: DMatrix<f64>,
    /// Estimates of the nuisance parameters without any candidate, relative to the point of linearisation.
    pub tuned: DVector<f64>,
    /// Coefficients of the regression of each column on the columns of the nuisance parameters. One unit of a candidate lowers
    /// the estimates of the nuisance parameters by the candidate's column of this matrix.
    pub taken: DMatrix<f64>,
    /// Covariance of the nuisance parameters without any candidate.
    pub covariance: DMatrix<f64>,
    /// For each block and channel: sum of squares of the projected residual, and number of rows.
    pub by_channel: Vec<[(f64, usize); 6]>,
    /// Projected columns of candidates and residual in each cell (the windows of one channel of one flight).
    pub rows: Vec<DMatrix<f64>>,
}

impl Projected {
    /// Projects the nuisance parameters out of the columns `placed`, which has one list for each flight. The nuisance parameters
    /// have the first indices, then come the candidates, and the residual has the index `last`.
    ///
    /// For each index, `shared` has the bias of the product of the column with the residual that is due to noise in both. A
    /// missing entry is zero. `None` if the nuisance parameters cannot be estimated.
    pub fn new(
        cells: &Cells,
        placed: &[Placed],
        last: usize,
        known: &[Known],
        noise: &Noise,
        shared: &[f64],
    ) -> Option<Projected> {
        let (na, ny) = (known.len(), last - known.len() + 1);
        let whitened: Vec<(Vec<usize>, DMatrix<f64>)> = cells
            .list
            .par_iter()
            .map(|c| c.matrix(&placed[c.flight], &noise.whiteners[c.channel]))
            .collect();
        let (mut aa, mut ay) = products_of_known(&whitened, na, ny);
        let shared_of = |place: usize| shared.get(place).copied().unwrap_or(0.0);
        for (k, known) in known.iter().enumerate() {
            ay[(k, ny - 1)] -= shared_of(k);
            aa[(k, k)] += known.weight();
            ay[(k, ny - 1)] += known.weight() * known.offset;
            // a parameter on which neither the flights nor the prior have information keeps its value
            if aa[(k, k)] <= 0.0 {
                aa[(k, k)] = 1.0;
            }
        }
        let covariance = scaled_inverse(&aa)?;
        let taken = &covariance * &ay;
        let rows: Vec<DMatrix<f64>> =
            whitened.par_iter().map(|(places, z)| project(places, z, na, ny, &taken)).collect();
        let mut blocks = block_grams(cells, &rows, ny);
        let of_known = DVector::from_iterator(na, (0..na).map(shared_of));
        let own = DVector::from_iterator(ny - 1, (na..last).map(shared_of));
        let bias = own - taken.columns(0, ny - 1).tr_mul(&of_known);
        let share = 1.0 / blocks.len().max(1) as f64;
        for block in &mut blocks {
            for k in 0..ny - 1 {
                block[(k, ny - 1)] -= share * bias[k];
                block[(ny - 1, k)] -= share * bias[k];
            }
        }
        let by_channel = by_channel(cells, &rows, ny);
        let root = root_of_prior(known, &taken);
        let prior = root.tr_mul(&root);
        let total = blocks.iter().fold(prior.clone(), |sum, b| sum + b);
        let noise = noise_products(cells, &rows, &noise.residuals, ny);
        let tuned = taken.column(ny - 1).into_owned();
        let prior_root = root.columns(0, ny - 1).transpose();
        Some(Projected {
            blocks,
            prior,
            total,
            noise,
            prior_root,
            tuned,
            taken,
            covariance,
            by_channel,
            rows,
        })
    }

    /// Number of rows of each channel.
    pub fn rows_by_channel(&self) -> [f64; 6] {
        std::array::from_fn(|c| self.by_channel.iter().map(|of| of[c].1 as f64).sum())
    }

    /// Number of columns of the candidates.
    pub fn width(&self) -> usize {
        self.total.ncols() - 1
    }

    /// Gram matrix of other columns after the same projection. `placed` has these columns for each flight, with the indices of
    /// the candidates. `whiteners` has the whitening filter of each channel.
    pub fn others(&self, cells: &Cells, placed: &[Placed], whiteners: &[Whitener]) -> DMatrix<f64> {
        let (na, ny) = (self.taken.nrows(), self.taken.ncols());
        let mut gram = DMatrix::zeros(ny, ny);
        for cell in &cells.list {
            let (places, z) = cell.matrix(&placed[cell.flight], &whiteners[cell.channel]);
            let rows = project(&places, &z, na, ny, &self.taken);
            gram.gemm_tr(1.0, &rows, &rows, 1.0);
        }
        gram
    }

    /// The Gram matrices of all blocks, each used once.
    pub fn grams(&self) -> Grams<'_> {
        let blocks = self.blocks.iter().collect();
        Grams { blocks, prior: &self.prior, total: self.total.clone() }
    }

    /// The Gram matrices of a bootstrap sample that has the blocks `blocks`. A block may occur several times or not at all.
    pub fn resampled(&self, blocks: impl Iterator<Item = usize>) -> Grams<'_> {
        let blocks: Vec<&DMatrix<f64>> = blocks.map(|b| &self.blocks[b]).collect();
        let mut total = self.prior.clone();
        blocks.iter().for_each(|b| total += *b);
        Grams { blocks, prior: &self.prior, total }
    }
}

/// Gram matrices of the columns of candidates and residual in a selection of blocks.
pub struct Grams<'a> {
    /// Gram matrix of each selected block.
    pub blocks: Vec<&'a DMatrix<f64>>,
    /// Gram matrix of the prior's pseudo-observations.
    pub prior: &'a DMatrix<f64>,
    /// Sum of `prior` and of the Gram matrices of the selected blocks.
    pub total: DMatrix<f64>,
}

/// Inverse of a symmetric matrix whose rows may differ widely in size. The matrix is scaled first. `None` if it is not positive
/// definite.
pub fn scaled_inverse(matrix: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let scale = matrix.diagonal().map(|d| d.max(f64::MIN_POSITIVE).sqrt().recip());
    let n = matrix.nrows();
    let mut scaled = DMatrix::from_fn(n, n, |i, j| matrix[(i, j)] * scale[i] * scale[j]);
    for i in 0..n {
        scaled[(i, i)] += 1e-10;
    }
    let inverse = scaled.cholesky()?.inverse();
    Some(DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] * scale[i] * scale[j]))
}

/// The pseudo-observations of the prior, a square root of their Gram matrix. There is one row for each nuisance parameter and one
/// column for each candidate. The last column is the residual.
fn root_of_prior(known: &[Known], taken: &DMatrix<f64>) -> DMatrix<f64> {
    let mut root = -taken.clone();
    let last = root.ncols() - 1;
    for (k, known) in known.iter().enumerate() {
        root[(k, last)] += known.offset;
        root.row_mut(k).scale_mut(known.weight().sqrt());
    }
    root
}

/// Scalar products of the whitened columns of the `na` nuisance parameters with one another, and with the `ny` columns of
/// candidates and residual.
fn products_of_known(
    whitened: &[(Vec<usize>, DMatrix<f64>)],
    na: usize,
    ny: usize,
) -> (DMatrix<f64>, DMatrix<f64>) {
    let (mut aa, mut ay) = (DMatrix::zeros(na, na), DMatrix::zeros(na, ny));
    for (places, z) in whitened {
        let split = places.iter().take_while(|p| **p < na).count();
        let a = z.columns(0, split);
        let products = a.tr_mul(z);
        for (i, pi) in places[..split].iter().enumerate() {
            for (j, pj) in places.iter().enumerate() {
                if *pj < na {
                    aa[(*pi, *pj)] += products[(i, j)];
                } else {
                    ay[(*pi, *pj - na)] += products[(i, j)];
                }
            }
        }
    }
    (aa, ay)
}

/// Columns of candidates and residual in one cell, less the part that the nuisance parameters explain.
fn project(
    places: &[usize],
    z: &DMatrix<f64>,
    na: usize,
    ny: usize,
    taken: &DMatrix<f64>,
) -> DMatrix<f64> {
    let split = places.iter().take_while(|p| **p < na).count();
    let own = DMatrix::from_fn(split, ny, |i, j| taken[(places[i], j)]);
    let mut rows = -(z.columns(0, split) * own);
    for (j, place) in places.iter().enumerate().skip(split) {
        let mut column = rows.column_mut(place - na);
        column += z.column(j);
    }
    rows
}

fn block_grams(cells: &Cells, rows: &[DMatrix<f64>], ny: usize) -> Vec<DMatrix<f64>> {
    // for each block, its parts in the order of the cells: index of the cell, first row and last row + 1
    let mut parts: Vec<Vec<(usize, usize, usize)>> = vec![Vec::new(); cells.blocks()];
    for (k, cell) in cells.list.iter().enumerate() {
        for (block, from, to) in cell.rows_of_blocks() {
            parts[block].push((k, from, to));
        }
    }
    parts
        .par_iter()
        .map(|parts| {
            let mut gram = DMatrix::zeros(ny, ny);
            for (k, from, to) in parts {
                let part = rows[*k].rows(*from, to - from);
                gram.gemm_tr(1.0, &part, &part, 1.0);
            }
            gram
        })
        .collect()
}

fn by_channel(cells: &Cells, rows: &[DMatrix<f64>], ny: usize) -> Vec<[(f64, usize); 6]> {
    let mut sums = vec![[(0.0, 0); 6]; cells.blocks()];
    for (cell, rows) in cells.list.iter().zip(rows) {
        for (row, block) in cell.blocks.iter().enumerate() {
            let place = &mut sums[*block][cell.channel];
            place.0 += rows[(row, ny - 1)].powi(2);
            place.1 += 1;
        }
    }
    sums
}

/// For each block: scalar products of the columns of the candidates with the noise `residuals`.
fn noise_products(
    cells: &Cells,
    rows: &[DMatrix<f64>],
    residuals: &[Vec<f64>],
    ny: usize,
) -> Vec<DVector<f64>> {
    let mut products = vec![DVector::zeros(ny - 1); cells.blocks()];
    for ((cell, rows), left) in cells.list.iter().zip(rows).zip(residuals) {
        for (block, from, to) in cell.rows_of_blocks() {
            let part = rows.view((from, 0), (to - from, ny - 1));
            let left = DVector::from_column_slice(&left[from..to]);
            products[block] += part.tr_mul(&left);
        }
    }
    products
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::regression::cells::Cell;

    #[test]
    fn the_products_of_a_block_are_those_of_its_rows_in_all_cells() {
        let cell = |channel: usize, blocks: &[usize]| Cell {
            flight: 0,
            channel,
            windows: (0..blocks.len()).collect(),
            runs: vec![blocks.len()],
            blocks: blocks.to_vec(),
        };
        let list = vec![cell(0, &[0, 0, 1, 1, 0]), cell(3, &[1, 1, 2])];
        let cells = Cells { list, flight_of_block: vec![0; 3] };
        let rows = [5, 3].map(|n| DMatrix::from_fn(n, 2, |i, j| 1.0 + (3 * i + 7 * j + n) as f64));
        let grams = block_grams(&cells, &rows, 2);
        let product = |of: &[(usize, usize)]| {
            let of = of.iter().map(|(k, row)| rows[*k].row(*row).transpose() * rows[*k].row(*row));
            of.fold(DMatrix::<f64>::zeros(2, 2), |sum, product| sum + product)
        };
        assert_eq!(grams[0], product(&[(0, 0), (0, 1), (0, 4)]));
        assert_eq!(grams[1], product(&[(0, 2), (0, 3), (1, 0), (1, 1)]));
        assert_eq!(grams[2], product(&[(1, 2)]));
    }
}
