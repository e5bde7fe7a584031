//! Scalar cost terms of the iLQR planner (iterative linear-quadratic regulator) with their derivatives.

use std::ops::AddAssign;

/// Value of a cost term, its first derivative (slope), and a non-negative approximation of its second derivative (curvature).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cost {
    pub value: f64,
    pub slope: f64,
    pub curvature: f64,
}

impl Cost {
    pub const NONE: Cost = Cost { value: 0.0, slope: 0.0, curvature: 0.0 };
}

impl AddAssign for Cost {
    fn add_assign(&mut self, other: Cost) {
        self.value += other.value;
        self.slope += other.slope;
        self.curvature += other.curvature;
    }
}

/// The cost ½ (x / size)² of a deviation `x`.
pub(super) fn square(x: f64, size: f64) -> Cost {
    let w = 1.0 / size;
    Cost { value: 0.5 * (x * w) * (x * w), slope: w * w * x, curvature: w * w }
}

/// The pseudo-Huber cost of a deviation `x`. It is about ½ (x / size)² for |x| well below `far`, and about linear for |x|
/// well above. If `far` is `None`, it is quadratic everywhere.
pub(super) fn attitude(x: f64, size: f64, far: Option<f64>) -> Cost {
    let Some(far) = far else { return square(x, size) };
    let w = 1.0 / (size * size);
    let root = (1.0 + (x / far) * (x / far)).sqrt();
    Cost { value: w * far * far * (root - 1.0), slope: w * x / root, curvature: w / root }
}

/// The cost ½ (e / size)², where e is the distance of `x` from the interval `low`..`high`. Zero inside the interval.
pub(super) fn beyond(x: f64, [low, high]: [f64; 2], size: f64) -> Cost {
    if x > high {
        square(x - high, size)
    } else if x < low {
        square(x - low, size)
    } else {
        Cost::NONE
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_are_those_of_differences() {
        let costs: [fn(f64) -> Cost; 3] =
            [|x| square(x, 0.3), |x| attitude(x, 0.05, Some(0.1)), |x| beyond(x, [-0.5, 0.2], 0.1)];
        for cost in costs {
            for x in [-0.7, -0.1, 0.05, 0.4, 2.0] {
                let slope = (cost(x + 1e-6).value - cost(x - 1e-6).value) / 2e-6;
                assert!((cost(x).slope - slope).abs() < 1e-5 * (1.0 + slope.abs()), "{x}");
            }
        }
    }

    #[test]
    fn a_far_error_pulls_no_harder_than_a_nearer_one() {
        let pull = |x: f64| attitude(x, 0.05, Some(0.1)).slope;
        assert!(pull(2.0) < 1.01 * pull(1.0) && pull(0.01) > 0.09 * pull(1.0));
    }
}
