//! Fit of the constants of a form, with its coefficient eliminated (variable projection). A form is a formula that may describe a
//! missing effect, such as tanh(v/c) with the constant c. Its coefficient multiplies it. The form is fitted to the residual of
//! one channel (a force or a moment).

use nalgebra::{DMatrix, DVector};

use super::grammar::Free;
use super::samples::Samples;
use super::screen::Screen;
use crate::diagnose::regression::projected::scaled_inverse;

/// Largest number of Gauss–Newton steps.
const STEPS: usize = 6;
/// Largest number of attempts for a step. The step is halved after each attempt without improvement.
const HALVINGS: usize = 4;
/// Finite-difference step of a constant, as a fraction of its value.
const MOVED: f64 = 0.01;
/// Largest change of a constant in one step, as a fraction of its value.
const REACH: f64 = 0.5;
/// The fit ends if a step increases the reduction of the sum of squares by no more than this fraction of the reduction.
const RELATIVE_TOLERANCE: f64 = 1e-4;

/// The data of a channel to which a form is fitted.
pub struct Place<'a> {
    /// Whitened data of the channel: filtered so that their noise is white.
    pub screen: &'a Screen<'a>,
    /// The variables of the form at every sample.
    pub samples: &'a Samples,
    /// Factor by which the form is multiplied at every sample, such as the dynamic pressure.
    pub factor: &'a [f64],
}

impl Place<'_> {
    /// The regressor of the form `free` with `constants`, whitened, and with the nuisance parameters (coefficients of the model,
    /// sensor errors) projected out.
    pub fn column(&self, free: &Free, constants: &[f64]) -> DVector<f64> {
        let mut values = self.samples.of(&free.expression, constants);
        values.iter_mut().zip(self.factor).for_each(|(x, f)| *x *= f);
        self.screen.projected(&DVector::from_vec(self.screen.column(values)))
    }

    /// Fits the constants of `free` so that its regressor explains as much as possible of `target`. Returns the form with the
    /// fitted constants, and the reduction of the sum of squares of `target`.
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

    /// Gauss–Newton step of the constants with Kaufman's approximation: of the derivatives, only the part orthogonal to the
    /// regressor `column` is used. `None` if the form has no constants or the step is not finite.
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

/// Reduction of the sum of squares of `target` by the projected regressor `column`; zero if it is not finite.
fn taken(column: &DVector<f64>, target: &DVector<f64>) -> f64 {
    let fall = column.dot(target).powi(2) / column.norm_squared();
    if fall.is_finite() { fall } else { 0.0 }
}
