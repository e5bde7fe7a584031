//! A function of one variable that is given by points. It is linear between the points and constant beyond them.

use super::Real;

/// A piecewise linear function of one variable.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    floor: f64,
    /// For each segment between neighbouring points: start in x, length in x, and slope.
    segments: Vec<(f64, f64, f64)>,
}

/// Error in the definition of a table.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum TableError {
    /// There are too few points.
    #[error("a table needs at least two points, this one has {0}")]
    TooShort(usize),
    /// There are too many points.
    #[error("a table may have {most} points, this one has {points}; thin it out")]
    TooLong {
        /// Number of points given.
        points: usize,
        /// Largest number of points allowed.
        most: usize,
    },
    /// The two lists differ in length.
    #[error("a table needs as many ordinates as abscissae, this one has {0} and {1}")]
    Uneven(usize, usize),
    /// The abscissae are not increasing.
    #[error("a table's abscissae must increase: point {} does not", .0 + 1)]
    NotIncreasing(usize),
    /// Two abscissae are so close that the slope between them is not finite.
    #[error("a table's abscissae must not be so close that a slope is infinite: points {} and {} are", .0, .0 + 1)]
    TooSteep(usize),
    /// A number is not finite.
    #[error("a table's numbers must be finite: point {} is not", .0 + 1)]
    NotFinite(usize),
}

/// Largest number of points. It limits the time to evaluate a model.
const MAX_POINTS: usize = 1000;

impl Table {
    /// Makes the table with the points (`x[i]`, `y[i]`). `x` must increase.
    pub fn new(x: &[f64], y: &[f64]) -> Result<Table, TableError> {
        if x.len() != y.len() {
            return Err(TableError::Uneven(x.len(), y.len()));
        }
        if x.len() < 2 {
            return Err(TableError::TooShort(x.len()));
        }
        if x.len() > MAX_POINTS {
            return Err(TableError::TooLong { points: x.len(), most: MAX_POINTS });
        }
        if let Some(i) = (0..x.len()).find(|&i| !(x[i].is_finite() && y[i].is_finite())) {
            return Err(TableError::NotFinite(i));
        }
        if let Some(i) = (1..x.len()).find(|&i| x[i] <= x[i - 1]) {
            return Err(TableError::NotIncreasing(i));
        }
        let segment = |i: usize| {
            let length = x[i] - x[i - 1];
            (x[i - 1], length, (y[i] - y[i - 1]) / length)
        };
        let segments: Vec<(f64, f64, f64)> = (1..x.len()).map(segment).collect();
        if let Some(i) = segments.iter().position(|(_, _, slope)| !slope.is_finite()) {
            return Err(TableError::TooSteep(i + 1));
        }
        Ok(Table { floor: y[0], segments })
    }

    /// The points (x, y) of the table.
    pub fn points(&self) -> Vec<(f64, f64)> {
        let mut y = self.floor;
        let mut points = Vec::with_capacity(self.segments.len() + 1);
        let mut end = 0.0;
        for &(x, length, slope) in &self.segments {
            points.push((x, y));
            y += length * slope;
            end = x + length;
        }
        points.push((end, y));
        points
    }

    /// Value at `x`; NaN if `x` is NaN. It is computed as a sum of clipped ramps, without a search, so that SIMD lanes need no
    /// branches. At a point of the table, the derivative is the slope of the segment to the right of it.
    #[inline(always)]
    pub fn at<R: Real>(&self, x: R) -> R {
        // the second term is zero, or NaN if `x` is NaN
        let mut y = R::from_f64(self.floor) + x.scale(0.0);
        for &(start, length, slope) in &self.segments {
            let part = (x - R::from_f64(start)).max(R::zero());
            let length = R::from_f64(length);
            y += R::where_less(part, length, part, length).scale(slope);
        }
        y
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Dual;

    #[test]
    fn is_linear_between_points_and_constant_beyond() {
        let table = Table::new(&[-1.0, 0.0, 2.0], &[3.0, 1.0, 5.0]).unwrap();
        for (x, y) in
            [(-9.0, 3.0), (-1.0, 3.0), (-0.5, 2.0), (0.0, 1.0), (1.0, 3.0), (2.0, 5.0), (7.0, 5.0)]
        {
            assert_eq!(table.at(x), y, "at {x}");
        }
    }

    #[test]
    fn on_a_point_the_slope_is_that_of_the_right_side() {
        let table = Table::new(&[-1.0, 0.0, 2.0], &[3.0, 1.0, 5.0]).unwrap();
        for (x, slope) in
            [(-1.0, -2.0), (0.0, 2.0), (2.0, 0.0), (-0.5, -2.0), (1.0, 2.0), (-9.0, 0.0)]
        {
            assert_eq!(table.at(Dual::<1>::variable(x, 0)).gradient, [slope], "at {x}");
        }
        assert!(table.at(f64::NAN).is_nan());
    }

    #[test]
    fn refuses_points_that_are_no_function() {
        assert_eq!(Table::new(&[0.0], &[1.0]), Err(TableError::TooShort(1)));
        assert_eq!(Table::new(&[0.0, 1.0], &[1.0]), Err(TableError::Uneven(2, 1)));
        assert_eq!(Table::new(&[0.0, 0.0], &[1.0, 2.0]), Err(TableError::NotIncreasing(1)));
        assert_eq!(Table::new(&[0.0, 1.0], &[1.0, f64::NAN]), Err(TableError::NotFinite(1)));
        let close = Table::new(&[-1.0, 0.0, 5e-324], &[1.0, 2.0, 3.0]);
        assert_eq!(close, Err(TableError::TooSteep(2)));
        assert!(TableError::TooSteep(2).to_string().ends_with("points 2 and 3 are"));
        assert!(Table::new(&[0.0, 5e-324], &[1.0, 1.0]).is_ok());
    }
}
