//! A function of two variables given on a grid, bilinear between the points and constant beyond them.

use super::Real;
use super::table::TableError;

/// Largest number of points along the second variable. [`Grid::at`] holds one number for each in registers or on the stack.
const MOST_COLUMNS: usize = 16;
/// Largest number of points along the first variable.
const MOST_ROWS: usize = 100;

/// A bilinear function of the variables x and y.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    x: Vec<f64>,
    y: Vec<f64>,
    /// The function along `y` at the first `x`: the value at the first `y`, then a slope for each interval of `y`.
    first: Vec<f64>,
    /// For each interval of `x`: the slope over `x` as a function of `y`, stored like `first`.
    slopes: Vec<Vec<f64>>,
}

/// Error in the definition of a grid.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum GridError {
    /// The points of one variable are invalid.
    #[error("{variable}: {why}")]
    Axis {
        /// Name of the variable.
        variable: &'static str,
        /// The error in its points.
        why: TableError,
    },
    /// The number of values does not match the grid.
    #[error("a grid of {0} by {1} points needs {0} rows of {1} values")]
    Uneven(usize, usize),
    /// Points are so close that a slope is not finite.
    #[error("a grid's points must not be so close that a slope is infinite: some up to row {} are", .0 + 1)]
    TooSteep(usize),
    /// A value is not finite.
    #[error("a grid's values must be finite: row {}, column {} is not", .0 + 1, .1 + 1)]
    NotFinite(usize, usize),
}

fn increasing(points: &[f64], most: usize) -> Result<(), TableError> {
    if points.len() < 2 {
        return Err(TableError::TooShort(points.len()));
    }
    if points.len() > most {
        return Err(TableError::TooLong { points: points.len(), most });
    }
    if let Some(i) = points.iter().position(|x| !x.is_finite()) {
        return Err(TableError::NotFinite(i));
    }
    match (1..points.len()).find(|&i| points[i] <= points[i - 1]) {
        Some(i) => Err(TableError::NotIncreasing(i)),
        None => Ok(()),
    }
}

/// Returns the value at the first point of `y`, then the slope of each interval of `y`. The value at `y[j]` is `values(j)`.
fn along(y: &[f64], values: impl Fn(usize) -> f64) -> Vec<f64> {
    let slope = |j: usize| (values(j) - values(j - 1)) / (y[j] - y[j - 1]);
    std::iter::once(values(0)).chain((1..y.len()).map(slope)).collect()
}

/// Clipped ramp: `x` − `from`, limited to 0..(`to` − `from`).
#[inline(always)]
fn ramp<R: Real>(x: R, from: f64, to: f64) -> R {
    let (part, length) = ((x - R::from_f64(from)).max(R::zero()), R::from_f64(to - from));
    R::where_less(part, length, part, length)
}

impl Grid {
    /// The function with the value `values[i][j]` at (`x[i]`, `y[j]`). Both `x` and `y` must increase.
    ///
    /// # Errors
    /// If `x` or `y` does not increase, a slope is infinite, the values do not match the grid, a number is not finite, or there
    /// are fewer than 2 by 2 or more than 100 by 16 points.
    pub fn new(x: &[f64], y: &[f64], values: &[Vec<f64>]) -> Result<Grid, GridError> {
        let of = |variable| move |why| GridError::Axis { variable, why };
        increasing(x, MOST_ROWS).map_err(of("the first variable"))?;
        increasing(y, MOST_COLUMNS).map_err(of("the second variable"))?;
        if values.len() != x.len() || values.iter().any(|row| row.len() != y.len()) {
            return Err(GridError::Uneven(x.len(), y.len()));
        }
        for (i, row) in values.iter().enumerate() {
            if let Some(j) = row.iter().position(|value| !value.is_finite()) {
                return Err(GridError::NotFinite(i, j));
            }
        }
        let slope = |i: usize| along(y, |j| (values[i][j] - values[i - 1][j]) / (x[i] - x[i - 1]));
        let first = along(y, |j| values[0][j]);
        let slopes: Vec<Vec<f64>> = (1..x.len()).map(slope).collect();
        let mut all = std::iter::once(&first).chain(&slopes);
        if let Some(i) = all.position(|row| row.iter().any(|s| !s.is_finite())) {
            return Err(GridError::TooSteep(i));
        }
        Ok(Grid { x: x.to_vec(), y: y.to_vec(), first, slopes })
    }

    /// The points along the first and along the second variable.
    pub fn axes(&self) -> [&[f64]; 2] {
        [&self.x, &self.y]
    }

    /// Value at (`x`, `y`). NaN if `x` or `y` is NaN. The value is a sum of clipped ramps as in [`Table::at`](super::Table::at).
    /// The sum needs no search for an interval, and hence no branch for each lane of a SIMD vector.
    #[inline(always)]
    pub fn at<R: Real>(&self, x: R, y: R) -> R {
        let mut ramps = [R::zero(); MOST_COLUMNS];
        let steps = self.y.len() - 1;
        for (j, ramped) in ramps.iter_mut().enumerate().take(steps) {
            *ramped = ramp(y, self.y[j], self.y[j + 1]);
        }
        // the first term is zero, or NaN if `x` or `y` is NaN
        let mut sum = (x + y).scale(0.0) + line(&self.first, &ramps);
        for (i, slopes) in self.slopes.iter().enumerate() {
            sum += ramp(x, self.x[i], self.x[i + 1]) * line(slopes, &ramps);
        }
        sum
    }
}

/// The value at the first point plus the sum of the ramps times their slopes.
#[inline(always)]
fn line<R: Real>(slopes: &[f64], ramps: &[R; MOST_COLUMNS]) -> R {
    let mut sum = R::from_f64(slopes[0]);
    for (slope, ramped) in slopes[1..].iter().zip(ramps) {
        sum += ramped.scale(*slope);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Dual;

    fn grid() -> Grid {
        let values = [vec![1.0, 2.0, 0.0], vec![3.0, 8.0, 1.0]];
        Grid::new(&[0.0, 2.0], &[-1.0, 0.0, 4.0], &values).unwrap()
    }

    #[test]
    fn is_bilinear_between_points_and_constant_beyond() {
        let grid = grid();
        for (x, y, value) in [
            (0.0, -1.0, 1.0),
            (2.0, 0.0, 8.0),
            (2.0, 4.0, 1.0),
            (1.0, 0.0, 5.0),
            (1.0, -0.5, 3.5),
            (0.5, 1.0, 0.75 * 1.5 + 0.25 * 6.25),
            (-9.0, 9.0, 0.0),
            (9.0, -9.0, 3.0),
        ] {
            assert!((grid.at(x, y) - value).abs() < 1e-14, "{x} {y}: {}", grid.at(x, y));
        }
        assert!(grid.at(f64::NAN, 0.0).is_nan() && grid.at(0.0, f64::NAN).is_nan());
        assert_eq!(grid.axes(), [&[0.0, 2.0][..], &[-1.0, 0.0, 4.0][..]]);
    }

    #[test]
    fn slopes_are_those_of_the_patch() {
        let [x, y] = [Dual::<2>::variable(0.5, 0), Dual::variable(1.0, 1)];
        let [over_x, over_y] = grid().at(x, y).gradient;
        assert!((over_x - (6.25 - 1.5) / 2.0).abs() < 1e-14);
        assert!((over_y - (0.75 * -0.5 + 0.25 * -1.75)).abs() < 1e-14);
    }

    #[test]
    fn refuses_points_that_are_no_grid() {
        let rows = [vec![1.0, 2.0], vec![3.0, 4.0]];
        assert_eq!(Grid::new(&[0.0, 1.0, 2.0], &[0.0, 1.0], &rows), Err(GridError::Uneven(3, 2)));
        assert!(Grid::new(&[1.0, 1.0], &[0.0, 1.0], &rows).is_err());
        assert_eq!(Grid::new(&[0.0, 5e-324], &[0.0, 1.0], &rows), Err(GridError::TooSteep(1)));
        assert_eq!(Grid::new(&[0.0, 1.0], &[0.0, 5e-324], &rows), Err(GridError::TooSteep(0)));
        let lost = [vec![1.0, 2.0], vec![3.0, f64::NAN]];
        assert_eq!(Grid::new(&[0.0, 1.0], &[0.0, 1.0], &lost), Err(GridError::NotFinite(1, 1)));
    }
}
