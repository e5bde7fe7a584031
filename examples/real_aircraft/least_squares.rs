//! A model's coefficients by plain least squares of forces and moments: what a fit without free runs and without a prior reaches.

use greylag::model::GreyBox;
use greylag::sysid::weak_form::prepared::Prepared;
use greylag::sysid::weak_form::windows;
use nalgebra::{DMatrix, DVector};

/// Singular values below this part of the largest are taken as zero.
const RANK: f64 = 1e-6;

/// `model` with coefficients by plain least squares of forces and moments over windows of 0.37 s, without bounds and without a
/// prior. The weight of a channel is the inverse root mean square of what the model as given leaves in it. The model as given
/// is returned if `flights` have no window.
pub fn least_squares(model: &GreyBox, flights: &[Prepared]) -> GreyBox {
    let count = model.coefficients().len();
    let (mut rows, mut right) = (Vec::new(), Vec::new());
    for flight in flights {
        let columns = windows::columns(model, flight).values;
        for (w, left) in windows::force_and_moment_residuals(model, flight).iter().enumerate() {
            for (channel, left) in left.iter().enumerate().filter(|(_, x)| x.is_finite()) {
                rows.push((channel, columns.iter().map(|c| c[channel][w]).collect::<Vec<_>>()));
                right.push(*left);
            }
        }
    }
    if rows.is_empty() {
        return model.clone();
    }
    let mut square = [(0.0, 0.0); 6];
    for ((channel, _), y) in rows.iter().zip(&right) {
        square[*channel].0 += y * y;
        square[*channel].1 += 1.0;
    }
    let weight = square.map(|(sum, n): (f64, f64)| (n / sum.max(f64::MIN_POSITIVE)).sqrt());
    let a = DMatrix::from_fn(rows.len(), count, |i, j| weight[rows[i].0] * rows[i].1[j]);
    let y = DVector::from_fn(right.len(), |i, _| weight[rows[i].0] * right[i]);
    let size: Vec<f64> = a.column_iter().map(|c| c.norm().max(f64::MIN_POSITIVE)).collect();
    let scaled = DMatrix::from_fn(rows.len(), count, |i, j| a[(i, j)] / size[j]);
    let Ok(solved) = scaled.svd(true, true).solve(&y, RANK) else { return model.clone() };
    let moved = model.coefficients().iter().enumerate().map(|(k, c)| c.value + solved[k] / size[k]);
    let values: Vec<f64> = moved.collect();
    let mut fitted = model.clone();
    fitted.set_coefficients(&values);
    fitted
}
