//! A function given by points: linear between them, constant beyond.

use super::Real;

/// A piecewise linear function of one variable.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    start: f64,
    floor: f64,
    /// (x at the segment's start, its length, slope).
    segments: Vec<(f64, f64, f64)>,
}

/// Why points do not make a table.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum TableError {
    /// Too few points.
    #[error("a table needs at least two points, this one has {0}")]
    TooShort(usize),
    /// The two lists differ in length.
    #[error("a table needs as many ordinates as abscissae, this one has {0} and {1}")]
    Uneven(usize, usize),
    /// The abscissae are not increasing.
    #[error("a table's abscissae must increase: point {0} does not")]
    NotIncreasing(usize),
    /// A number is not finite.
    #[error("a table's numbers must be finite: point {0} is not")]
    NotFinite(usize),
}

impl Table {
    /// The table through the points (`x[i]`, `y[i]`), `x` increasing.
    pub fn new(x: &[f64], y: &[f64]) -> Result<Table, TableError> {
        if x.len() != y.len() {
            return Err(TableError::Uneven(x.len(), y.len()));
        }
        if x.len() < 2 {
            return Err(TableError::TooShort(x.len()));
        }
        if let Some(i) = (0..x.len()).find(|&i| !(x[i].is_finite() && y[i].is_finite())) {
            return Err(TableError::NotFinite(i));
        }
        if let Some(i) = (1..x.len()).find(|&i| x[i] <= x[i - 1]) {
            return Err(TableError::NotIncreasing(i));
        }
        let segments = (1..x.len())
            .map(|i| {
                let length = x[i] - x[i - 1];
                (x[i - 1], length, (y[i] - y[i - 1]) / length)
            })
            .collect();
        Ok(Table { start: x[0], floor: y[0], segments })
    }

    /// The function's value at `x`. A sum of clipped ramps: no search, hence no branch per lane.
    #[inline(always)]
    pub fn at<R: Real>(&self, x: R) -> R {
        let mut y = R::from_f64(self.floor);
        for &(start, length, slope) in &self.segments {
            y += (x - R::from_f64(start)).clamp(0.0, length).scale(slope);
        }
        y
    }

    /// The smallest abscissa of the table.
    pub fn start(&self) -> f64 {
        self.start
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn refuses_points_that_are_no_function() {
        assert_eq!(Table::new(&[0.0], &[1.0]), Err(TableError::TooShort(1)));
        assert_eq!(Table::new(&[0.0, 1.0], &[1.0]), Err(TableError::Uneven(2, 1)));
        assert_eq!(Table::new(&[0.0, 0.0], &[1.0, 2.0]), Err(TableError::NotIncreasing(1)));
        assert_eq!(Table::new(&[0.0, 1.0], &[1.0, f64::NAN]), Err(TableError::NotFinite(1)));
    }
}
