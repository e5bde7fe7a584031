//! Fit of a form's constants with its coefficient eliminated (variable projection).

use nalgebra::{DMatrix, DVector};

use super::grammar::Free;
use super::samples::Samples;
use super::screen::Screen;
use crate::diagnose::regression::projected::scaled_inverse;

/// Largest number of Gauss–Newton steps.
const STEPS: usize = 6;
/// Largest number of attempts for a step. The step is halved after each failed attempt.
const HALVINGS: usize = 4;
/// Finite-difference step of a constant, as a share of its value.
const MOVED: f64 = 0.01;
/// Largest change of a constant in one step, as a share of its value.
const REACH: f64 = 0.5;
/// Convergence tolerance: the fit ends if a step increases the reduction of the residual by less than this share.
const RELATIVE_TOLERANCE: f64 = 1e-4;

/// Data of a channel, and the factor of a form.
pub struct Place<'a> {
    /// Whitened data of the channel.
    pub screen: &'a Screen<'a>,
    /// Variables at every sample.
    pub samples: &'a Samples,
    /// Factor of the form at every sample.
    pub factor: &'a [f64],
}

impl Place<'_> {
    /// Whitened and projected regressor of the form `free` with `constants`.
    pub fn column(&self, free: &Free, constants: &[f64]) -> DVector<f64> {
        let mut values = self.samples.of(&free.expression, constants);
        values.iter_mut().zip(self.factor).for_each(|(x, f)| *x *= f);
        self.screen.projected(&DVector::from_vec(self.screen.column(values)))
    }

    /// Fits the constants of `free` so that its regressor explains as much as possible of `target`. Returns the form
    /// and the reduction of the sum of squares.
    pub fn refined(&self, free: &Free, target: &DVector<f64>) -> (Free, f64) {
        let mut best = free.constants.clone();
        let mut column = self.column(free, &best);
        let mut fall = taken(&column, target);
        for _ in 0..STEPS {
            let Some(step) = self.step(free, &best, &column, target) else { break };
            let before = fall;
            for halving in 0..HALVINGS {
                let share = 0.5_f64.powi(halving as i32);
                let moved: Vec<f64> = best
                    .iter()
                    .zip(step.iter())
                    .map(|(c, d)| c + (share * d).clamp(-REACH * c.abs(), REACH * c.abs()))
                    .collect();
                let other = self.column(free, &moved);
                let reached = taken(&other, target);
                if reached > fall {
                    (best, column, fall) = (moved, other, reached);
                    break;
                }
            }
            if fall - before <= RELATIVE_TOLERANCE * before {
                break;
            }
        }
        (Free { expression: free.expression.clone(), constants: best }, fall)
    }

    /// Gauss–Newton step of the constants with Kaufman's approximation: the derivatives are projected orthogonally to
    /// the regressor `column`. `None` if the form has no constants or the step is not finite.
    fn step(
        &self,
        free: &Free,
        constants: &[f64],
        column: &DVector<f64>,
        target: &DVector<f64>,
    ) -> Option<DVector<f64>> {
        let square = column.norm_squared();
        let amount = column.dot(target) / square;
        if constants.is_empty() || !amount.is_finite() {
            return None;
        }
        let mut slopes = DMatrix::zeros(target.len(), constants.len());
        for k in 0..constants.len() {
            let by = MOVED * constants[k].abs();
            let at = |sign: f64| {
                let mut moved = constants.to_vec();
                moved[k] += sign * by;
                self.column(free, &moved)
            };
            let mut slope = (at(1.0) - at(-1.0)) * (amount / (2.0 * by));
            slope -= column * (column.dot(&slope) / square);
            slopes.set_column(k, &slope);
        }
        let left = target - column * amount;
        let step = scaled_inverse(&slopes.tr_mul(&slopes))? * slopes.tr_mul(&left);
        step.iter().all(|x| x.is_finite()).then_some(step)
    }
}

/// Reduction of the sum of squares of `target` by a projected regressor.
fn taken(column: &DVector<f64>, target: &DVector<f64>) -> f64 {
    let fall = column.dot(target).powi(2) / column.norm_squared();
    if fall.is_finite() { fall } else { 0.0 }
}
