//! One iteration of the iterative linear-quadratic regulator (iLQR). A backward pass computes feedback gains and changes of the
//! commands. A forward pass with a line search applies them.

use nalgebra::{Matrix2, SMatrix, Vector2};

use super::problem::{Problem, STATES, Square, Trajectory, Vector};
use super::{STEPS, Surfaces};

/// Feedback gain on the deviation of the state from the trajectory of the present plan.
type Gain = SMatrix<f64, 2, STATES>;

/// Step lengths of the line search: factors on the changes of the commands, largest first.
const PARTS: [f64; 4] = [1.0, 0.5, 0.2, 0.05];

/// Feedback gains and changes of the commands at each step of a plan, with scratch memory.
#[derive(Clone, Debug)]
pub(super) struct Solver {
    gains: Vec<Gain>,
    changes: Vec<Vector2<f64>>,
    spare: Trajectory,
}

impl Solver {
    pub fn new() -> Solver {
        Solver {
            gains: vec![Gain::zeros(); STEPS],
            changes: vec![Vector2::zeros(); STEPS],
            spare: Trajectory::new(),
        }
    }

    /// The scratch trajectory, for use by the caller.
    pub fn spare(&mut self) -> &mut Trajectory {
        &mut self.spare
    }

    /// Swaps `trajectory` with the scratch trajectory.
    pub fn swap(&mut self, trajectory: &mut Trajectory) {
        std::mem::swap(&mut self.spare, trajectory);
    }

    /// Makes one iteration from `plan`, which has the trajectory `trajectory` and the cost `cost`. Returns the first plan of the
    /// line search with a lower cost, and that cost. If there is none, returns `plan` and `cost`. Sets `trajectory` to the
    /// trajectory of the returned plan.
    pub fn iterate(
        &mut self,
        problem: &Problem,
        plan: [Surfaces; STEPS],
        cost: f64,
        trajectory: &mut Trajectory,
    ) -> ([Surfaces; STEPS], f64) {
        if self.back(problem, &plan, trajectory).is_none() {
            return (plan, cost);
        }
        for part in PARTS {
            let (gains, changes) = (&self.gains, &self.changes);
            let (better, found) = problem.fly_with(&mut self.spare, |step, now| {
                let answer = changes[step] * part + gains[step] * now.less(trajectory, step);
                [plan[step][0] + answer[0], plan[step][1] + answer[1]]
            });
            if found < cost {
                self.swap(trajectory);
                return (better, found);
            }
        }
        (plan, cost)
    }

    /// Backward pass: computes the feedback gains and the changes of the commands. `None` if a step has no finite solution.
    fn back(
        &mut self,
        problem: &Problem,
        plan: &[Surfaces; STEPS],
        trajectory: &Trajectory,
    ) -> Option<()> {
        let (mut slope, curvature) = problem.stage_terms(trajectory, STEPS);
        let mut value = Square::from_diagonal(&curvature);
        let weight = problem.move_weight();
        for step in (0..STEPS).rev() {
            let transition = problem.linear(trajectory, step);
            let va = transition.after(&value);
            let vb = transition.after_commands(&value);
            let mut q_x: Vector = transition.before(&slope);
            let mut q_u: Vector2<f64> = transition.before_commands(&slope);
            let mut q_xx: Square = transition.before(&va);
            let mut q_ux: Gain = transition.before_commands(&va);
            let mut q_uu: Matrix2<f64> = transition.before_commands(&vb);
            if let Some((cost, n)) = problem.load_terms(trajectory, step, &transition) {
                q_x += n * cost.slope;
                q_xx.ger(cost.curvature, &n, &n, 1.0);
            }
            // cost of the change of each command from the previous command, which is one of the states
            let x = trajectory.at(step);
            for (c, (at, unit)) in problem.last_commands(&x).into_iter().enumerate() {
                let moved = plan[step][c] - x[at] / unit;
                q_u[c] += weight * moved;
                q_uu[(c, c)] += weight;
                q_x[at] -= weight * moved / unit;
                q_xx[(at, at)] += weight / (unit * unit);
                q_ux[(c, at)] -= weight / unit;
            }
            let (change, gain) = limited(&q_u, &q_uu, &q_ux, plan[step])?;
            if step > 0 {
                let (stage, curvature) = problem.stage_terms(trajectory, step);
                let answered = q_uu * change + q_u;
                slope = q_x + stage + gain.tr_mul(&answered) + q_ux.tr_mul(&change);
                value = reduced(q_xx, &q_uu, &q_ux, &gain);
                for i in 0..STATES {
                    value[(i, i)] += curvature[i];
                }
            }
            (self.gains[step], self.changes[step]) = (gain, change);
        }
        Some(())
    }
}

/// Hessian Q_xx + Kᵀ Q_uu K + Kᵀ Q_ux + Q_uxᵀ K of the cost from a step on, under the feedback δu = K δx.
fn reduced(q_xx: Square, q_uu: &Matrix2<f64>, q_ux: &Gain, gain: &Gain) -> Square {
    // computed column by column, without temporary 16 × 16 matrices
    let mut value = q_xx;
    let answered = q_uu * gain + q_ux;
    let (by, across) = (gain.transpose(), q_ux.transpose());
    for j in 0..STATES {
        let [a, b, c, d] = [answered[(0, j)], answered[(1, j)], gain[(0, j)], gain[(1, j)]];
        for i in 0..STATES {
            value[(i, j)] +=
                by[(i, 0)] * a + by[(i, 1)] * b + across[(i, 0)] * c + across[(i, 1)] * d;
        }
    }
    value
}

/// Change of the two commands that minimises a quadratic cost with the commands limited to −1..1, and the feedback gain (Tassa
/// et al. 2014). The cost has the gradient `slope` and the Hessian `curvature`; `cross` is its mixed derivative with the state.
/// `now` has the commands before the change. A command at its limit has the gain zero. If a limit is active, every combination
/// of limits is tried. `None` if `curvature` is singular or no solution is finite.
fn limited(
    slope: &Vector2<f64>,
    curvature: &Matrix2<f64>,
    cross: &Gain,
    now: Surfaces,
) -> Option<(Vector2<f64>, Gain)> {
    let inverse = curvature.try_inverse()?;
    let (free, gain) = (-(inverse * slope), -(inverse * cross));
    if !free.iter().chain(gain.iter()).all(|x| x.is_finite()) {
        return None;
    }
    if (0..2).all(|c| (now[c] + free[c]).abs() <= 1.0) {
        return Some((free, gain));
    }
    let cost = |d: &Vector2<f64>| (0.5 * d.transpose() * curvature * d)[0] + slope.dot(d);
    let mut best = (f64::INFINITY, Vector2::zeros(), Gain::zeros());
    for (fixed, limit) in [(0, -1.0), (0, 1.0), (1, -1.0), (1, 1.0)] {
        let open = 1 - fixed;
        let bent = curvature[(open, open)];
        let mut change = Vector2::zeros();
        change[fixed] = limit - now[fixed];
        let wanted = -(slope[open] + curvature[(open, fixed)] * change[fixed]) / bent;
        change[open] = wanted.clamp(-1.0 - now[open], 1.0 - now[open]);
        let mut gain = Gain::zeros();
        if change[open] == wanted {
            gain.row_mut(open).copy_from(&(-cross.row(open) / bent));
        }
        let cost = cost(&change);
        if cost < best.0 {
            best = (cost, change, gain);
        }
    }
    best.0.is_finite().then_some((best.1, best.2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_reduced_curvature_is_the_sum_of_its_products() {
        let q_xx = Square::from_fn(|i, j| ((i * j) as f64).cos());
        let q_uu = Matrix2::new(2.0, 0.6, 0.6, 1.0);
        let q_ux = Gain::from_fn(|i, j| (3.0 * i as f64 + j as f64).sin());
        let gain = Gain::from_fn(|i, j| (i as f64 - 2.0 * j as f64).sin());
        let cross = gain.transpose() * q_ux;
        let sum = q_xx + gain.transpose() * q_uu * gain + cross + cross.transpose();
        assert!((reduced(q_xx, &q_uu, &q_ux, &gain) - sum).amax() < 1e-12);
    }

    /// The cost of the result is compared with the lowest cost on a grid of commands within the limits.
    #[test]
    fn limits_are_kept_at_the_least_cost() {
        let curvature = Matrix2::new(2.0, 0.6, 0.6, 1.0);
        for slope in [[0.5, -0.3], [6.0, -0.3], [6.0, 8.0], [-5.0, 0.1]] {
            let slope = Vector2::from(slope);
            let now = [0.2, -0.4];
            let (change, _) = limited(&slope, &curvature, &Gain::zeros(), now).unwrap();
            let cost = |d: &Vector2<f64>| (0.5 * (d.transpose() * curvature * d))[0] + slope.dot(d);
            let grid = (0..=200).flat_map(|i| (0..=200).map(move |j| (i, j)));
            let least = grid
                .map(|(i, j)| {
                    let at = |k: i32| f64::from(k) * 0.01 - 1.0;
                    cost(&Vector2::new(at(i) - now[0], at(j) - now[1]))
                })
                .fold(f64::INFINITY, f64::min);
            assert!(cost(&change) <= least + 1e-3, "{slope:?} {change:?}");
            assert!((0..2).all(|c| (now[c] + change[c]).abs() <= 1.0 + 1e-12));
        }
    }
}
