//! The model of aircraft and actuators, linearised over one control step, for iLQR (iterative linear-quadratic regulator).
//! Its matrix products skip the zeros.
//!
//! Half of the states belong to the actuators' filters. Their rows of the transition matrix have at most four nonzero
//! entries. The products of the backward pass therefore take about a third of the operations of dense products.

use super::problem::{STATES, SURFACES, Square, Vector};
use greylag_physics::servos::Surface;
use nalgebra::{SMatrix, SVector};

/// A matrix with one row per state and `N` columns.
pub(super) type Columns<const N: usize> = SMatrix<f64, STATES, N>;

/// The linear transition δx₊ = A δx + B δu from the states δx before a step and the commands δu to the states δx₊ after it.
/// The first eight states are the aircraft's. The other eight belong to the actuator filters of aileron and elevator.
#[derive(Clone, Debug)]
pub(super) struct Transition {
    /// Jacobian of the aircraft's states after the step with respect to the states before it (eight columns) and to the
    /// deflections of aileron and elevator (two columns).
    pub aircraft: SMatrix<f64, 8, 10>,
    pub filters: [Filter; 2],
}

/// The linear filter of a surface's actuator.
#[derive(Clone, Copy, Debug)]
pub(super) struct Filter {
    /// Derivatives of the deflection after the step with respect to the filter's four states: the present deflection, the
    /// previous one, the last commanded deflection and the one before it.
    own: [f64; 4],
    /// Derivative of the deflection after the step with respect to the command, rad.
    gain: f64,
    /// Commanded deflection per unit of command, rad.
    unit: f64,
}

impl Filter {
    /// The linearised filter of the surface `of`. `deflection` is the deflection after the step and `commanded` is the commanded
    /// deflection, both in rad.
    pub fn new(of: &Surface, deflection: f64, commanded: f64) -> Filter {
        let [b0, a1, a2] = of.filter;
        let unit = of.travel.slope(commanded);
        // at a travel limit the deflection does not change with the filter's states or the command
        if of.travel.reaches(deflection) {
            Filter { own: [-a1, -a2, 2.0 * b0, b0], gain: b0 * unit, unit }
        } else {
            Filter { own: [0.0; 4], gain: 0.0, unit }
        }
    }
}

impl Transition {
    /// The product `value` A.
    pub fn after(&self, value: &Square) -> Square {
        let mut out = Square::zeros();
        let dense = value.fixed_columns::<8>(0) * self.aircraft;
        out.fixed_columns_mut::<8>(0).copy_from(&dense.fixed_columns::<8>(0));
        for (surface, (at, Filter { own, .. })) in self.surfaces().enumerate() {
            let [deflection, next, last] = [at, at + 1, at + 3].map(|i| value.column(i));
            out.set_column(at, &(dense.column(8 + surface) + deflection * own[0] + next));
            out.set_column(at + 1, &(deflection * own[1]));
            out.set_column(at + 2, &(deflection * own[2] + last));
            out.set_column(at + 3, &(deflection * own[3]));
        }
        out
    }

    /// The product Aᵀ `right`.
    pub fn before<const N: usize>(&self, right: &Columns<N>) -> Columns<N> {
        let mut out = Columns::<N>::zeros();
        let dense = self.aircraft.transpose() * right.fixed_rows::<8>(0);
        out.fixed_rows_mut::<8>(0).copy_from(&dense.fixed_rows::<8>(0));
        for (surface, (at, Filter { own, .. })) in self.surfaces().enumerate() {
            let [deflection, next, last] = [at, at + 1, at + 3].map(|i| right.row(i));
            out.set_row(at, &(dense.row(8 + surface) + deflection * own[0] + next));
            out.set_row(at + 1, &(deflection * own[1]));
            out.set_row(at + 2, &(deflection * own[2] + last));
            out.set_row(at + 3, &(deflection * own[3]));
        }
        out
    }

    /// The product `value` B.
    pub fn after_commands(&self, value: &Square) -> Columns<2> {
        let mut out = Columns::<2>::zeros();
        for (surface, (at, Filter { gain, unit, .. })) in self.surfaces().enumerate() {
            out.set_column(surface, &(value.column(at) * gain + value.column(at + 2) * unit));
        }
        out
    }

    /// The product Bᵀ `right`.
    pub fn before_commands<const N: usize>(&self, right: &Columns<N>) -> SMatrix<f64, 2, N> {
        let mut out = SMatrix::<f64, 2, N>::zeros();
        for (surface, (at, Filter { gain, unit, .. })) in self.surfaces().enumerate() {
            out.set_row(surface, &(right.row(at) * gain + right.row(at + 2) * unit));
        }
        out
    }

    /// Adds row number `row` of A, multiplied by `by`, to `to`. The row must be one of the first eight.
    pub fn add_row(&self, row: usize, by: f64, to: &mut Vector) {
        let of: SVector<f64, 10> = self.aircraft.row(row).transpose();
        for i in 0..8 {
            to[i] += of[i] * by;
        }
        for (surface, at) in SURFACES.into_iter().enumerate() {
            to[at] += of[8 + surface] * by;
        }
    }

    fn surfaces(&self) -> impl Iterator<Item = (usize, Filter)> {
        SURFACES.into_iter().zip(self.filters)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A and B as dense matrices.
    fn dense(of: &Transition) -> (Square, Columns<2>) {
        let (mut a, mut b) = (Square::zeros(), Columns::<2>::zeros());
        a.fixed_view_mut::<8, 8>(0, 0).copy_from(&of.aircraft.fixed_columns::<8>(0));
        for (surface, (at, filter)) in of.surfaces().enumerate() {
            a.fixed_view_mut::<8, 1>(0, at).copy_from(&of.aircraft.column(8 + surface));
            for (i, x) in filter.own.into_iter().enumerate() {
                a[(at, at + i)] = x;
            }
            a[(at + 1, at)] = 1.0;
            a[(at + 3, at + 2)] = 1.0;
            b[(at, surface)] = filter.gain;
            b[(at + 2, surface)] = filter.unit;
        }
        (a, b)
    }

    #[test]
    fn products_are_those_of_the_dense_matrices() {
        let filter =
            |k: f64| Filter { own: [1.9, -0.9, 0.02 * k, 0.01 * k], gain: 0.003 * k, unit: 0.4 };
        let transition = Transition {
            aircraft: SMatrix::from_fn(|i, j| ((3 * i + 5 * j) as f64).sin()),
            filters: [filter(1.0), filter(-2.0)],
        };
        let (a, b) = dense(&transition);
        let value = Square::from_fn(|i, j| ((i * j + i + j) as f64).cos());
        let near = |x: f64| assert!(x < 1e-12, "{x}");
        near((transition.after(&value) - value * a).amax());
        near((transition.before(&value) - a.transpose() * value).amax());
        near((transition.after_commands(&value) - value * b).amax());
        near((transition.before_commands(&value) - b.transpose() * value).amax());
        for row in 0..8 {
            let mut sum = Vector::zeros();
            transition.add_row(row, 2.0, &mut sum);
            near((sum - a.row(row).transpose() * 2.0).amax());
        }
    }
}
