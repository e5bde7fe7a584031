//! A linear residual of a fitted model: its rates are corrected by a linear function of states and deflections.
//!
//! It is the smallest learned residual of a model, a network without hidden layers: ẋ = ẋ_model + x_c ∘ (W u + b), where x_c is the
//! characteristic scale of each state and u are the scaled inputs V, p, q, r, α, β, δa, δe and δt of
//! [`Residual`]. W and b minimise the squares of the model's one-step errors, divided by x_c and the sampling interval, with a
//! ridge (Hoerl and Kennard, Ridge Regression, Technometrics 12, 1970). The ridge is chosen by cross-validation. Roll and pitch
//! angle get no correction, because their equations are exact.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::compare::HorizonScore;
use crate::compare::arx::ridge_regression;
use crate::compare::free_run::{self, error};
use crate::per_flight::known::KnownFlight;
use crate::weak_form::prepared::Prepared;
use greylag_model::residual::{INPUTS, OUTPUTS, Scales};
use greylag_model::{GreyBox, Memory, Residual};
use greylag_num::Dense;
use greylag_num::statistics::mean;
use greylag_physics::{Controls, State};

/// Number of regressors: the scaled inputs of a residual, and 1.
const REGRESSORS: usize = INPUTS + 1;
/// Index of the first state with a correction. The states before it are roll and pitch angle.
const CORRECTED_FROM: usize = 2;
/// Number of free numbers of a linear residual.
pub const FREE: usize = REGRESSORS * (OUTPUTS - CORRECTED_FROM);
/// Ridges that are tried, dimensionless: numbers that are added to the diagonal of the normal equations after they were scaled to
/// a unit diagonal.
pub const RIDGES: [f64; 6] = [1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0];
/// Smallest relative decrease of the error for which a residual is used.
const CLEARLY: f64 = 0.01;
/// Smaller scaled errors are replaced by this value (dimensionless), because they may differ by rounding only.
const LEAST_ERROR: f64 = 1e-6;

/// A model with a linear residual.
#[derive(Clone, Debug)]
pub struct Corrected {
    /// The model with its residual.
    pub model: GreyBox,
    /// The ridge that was chosen from [`RIDGES`].
    pub ridge: f64,
}

/// Fits a linear residual of `model` to `parts`: flights, or parts of one flight.
///
/// Each part is predicted with the residual that is fitted to the others. The ridge with the smallest error of free runs over
/// `horizons_s` (s) is chosen. `None` if no ridge lowers the error by at least 1 %, if fewer than two parts are given, or if
/// the model has a residual already. The coefficients of `model` are not fitted again without the part.
pub fn fit(model: &GreyBox, parts: &[Prepared], horizons_s: &[f64]) -> Option<Corrected> {
    if parts.len() < 2 || model.residual.is_some() {
        return None;
    }
    let sums: Vec<Sums> = parts.par_iter().map(|part| Sums::of(model, part)).collect();
    let without = |_: usize| Some(model.clone());
    let alone = error_left_out(parts, horizons_s, without)?;
    let errors = RIDGES.iter().filter_map(|&ridge| {
        let with = |left: usize| with_residual(model, parts, &sums, Some(left), ridge);
        Some((ridge, error_left_out(parts, horizons_s, with)?))
    });
    let (ridge, error) = errors.min_by(|a, b| a.1.total_cmp(&b.1))?;
    if !lower(error, alone) {
        return None;
    }
    Some(Corrected { model: with_residual(model, parts, &sums, None, ridge)?, ridge })
}

/// Whether a residual that changes the error from `before` to `after` is used: it must lower the error by at least 1 %.
pub fn lower(after: f64, before: f64) -> bool {
    after < (1.0 - CLEARLY) * before
}

/// Geometric mean of the scaled errors over all horizons that a run reaches; `None` if no run reaches one.
pub fn overall(scores: &[HorizonScore]) -> Option<f64> {
    let reached = scores.iter().filter(|s| s.runs > 0);
    let logs: Vec<f64> = reached.map(|s| s.rmse_scaled.max(LEAST_ERROR).ln()).collect();
    (!logs.is_empty()).then(|| mean(&logs).exp())
}

/// Mean over `parts` of the error of each part, predicted by the model that `without` returns for its index. `None` if a model
/// is missing or no part is as long as the shortest horizon.
fn error_left_out(
    parts: &[Prepared],
    horizons_s: &[f64],
    without: impl Fn(usize) -> Option<GreyBox> + Sync,
) -> Option<f64> {
    let one = |left: usize| {
        let model = without(left)?;
        let (runs, _) = free_run::fly(&model, &parts[left..=left], horizons_s);
        Some(overall(&horizons_s.iter().map(|h| runs.score(*h)).collect::<Vec<_>>()))
    };
    let errors: Vec<Option<f64>> =
        (0..parts.len()).into_par_iter().map(one).collect::<Option<_>>()?;
    let errors: Vec<f64> = errors.into_iter().flatten().collect();
    (!errors.is_empty()).then(|| mean(&errors))
}

/// `model` with the residual that is fitted to all parts except the one with the index `left`. `sums` holds the sums over each
/// part. `None` if the equations have no finite solution.
fn with_residual(
    model: &GreyBox,
    parts: &[Prepared],
    sums: &[Sums],
    left: Option<usize>,
    ridge: f64,
) -> Option<GreyBox> {
    let used = |k: &usize| left != Some(*k);
    let mut total = Sums::none();
    (0..sums.len()).filter(used).for_each(|k| total.add(&sums[k]));
    let network = Dense::new(&[INPUTS, OUTPUTS], total.parameters(ridge)?).ok()?;
    let residual = Residual::new(network, &model.airframe, model.scale()).ok()?;
    let seen = (0..parts.len()).filter(used).flat_map(|k| parts[k].segments.iter().flatten());
    let residual = residual.trained_on(seen.map(|at| (&at.state, &at.controls)));
    Some(having(model, residual))
}

/// `model` with `residual`.
fn having(model: &GreyBox, residual: Residual) -> GreyBox {
    let mut with = model.clone();
    with.residual = Some(residual);
    with
}

/// Sums over steps from which the least-squares fit follows.
struct Sums {
    /// Sums of the products of two regressors.
    gram: DMatrix<f64>,
    /// Sums of the products of a regressor (row) and the missing rate of a state (column), in units of x_c per second.
    moments: DMatrix<f64>,
}

impl Sums {
    fn none() -> Sums {
        Sums {
            gram: DMatrix::zeros(REGRESSORS, REGRESSORS),
            moments: DMatrix::zeros(REGRESSORS, OUTPUTS),
        }
    }

    /// Sums over all steps of `flight` from one sample to the next. Constants of the flight in the file of `model` are applied.
    fn of(model: &GreyBox, flight: &Prepared) -> Sums {
        let known = KnownFlight::of(model, flight);
        let (model, flight) = known.as_ref().map_or((model, flight), |k| (&k.model, &k.flight));
        let flight = &*flight.acting(model);
        let (model, scale) = (flight.stepping(model), model.scale());
        let scales = Scales::new(&model.airframe, scale);
        let mut sums = Sums::none();
        for segment in &flight.segments {
            let mut memory = Memory::default();
            for pair in segment.windows(2) {
                let from = pair[0].state;
                let next = flight.advance(&model, from, [&pair[0], &pair[1]], &mut memory);
                let missing = error(&next.to_array(), &pair[1].state.to_array());
                let rates = std::array::from_fn(|k| missing[k] / (scale[k] * flight.dt));
                sums.step(&scales, &from, &pair[0].controls, rates);
            }
        }
        sums
    }

    /// Adds one step with the missing `rates`, in units of x_c per second. A step with a number that is not finite is left out.
    fn step(&mut self, scales: &Scales, state: &State, controls: &Controls, rates: [f64; OUTPUTS]) {
        let inputs = scales.inputs(state, controls);
        let row = DVector::from_iterator(REGRESSORS, inputs.into_iter().chain([1.0]));
        let rates = DVector::from_row_slice(&rates);
        if row.iter().chain(rates.iter()).all(|x| x.is_finite()) {
            self.gram.ger(1.0, &row, &row, 1.0);
            self.moments.ger(1.0, &row, &rates, 1.0);
        }
    }

    fn add(&mut self, other: &Sums) {
        self.gram += &other.gram;
        self.moments += &other.moments;
    }

    /// Parameters of the network, as [`Dense`] orders them: weights `[in, out]`, then biases. `None` if there is no step or a
    /// number is not finite.
    fn parameters(&self, ridge: f64) -> Option<Vec<f32>> {
        let solution = ridge_regression(&self.gram, &self.moments, ridge)?;
        let column = |k: usize, row: usize| match k < CORRECTED_FROM {
            true => 0.0,
            false => solution[(row, k)] as f32,
        };
        // the rows of the inputs, then that of the constant: the order of the network's parameters
        let all: Vec<f32> = (0..REGRESSORS)
            .flat_map(|row| (0..OUTPUTS).map(move |k| (k, row)))
            .map(|(k, row)| column(k, row))
            .collect();
        all.iter().all(|x| x.is_finite()).then_some(all)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::amend::sample;

    /// A flight of 20 s of `model` with sinusoidal deflections.
    fn flown(model: &GreyBox, name: &str, phase: f64) -> Prepared {
        Prepared::new(&sample::flight(model, name, 2000, phase), 8.0).unwrap()
    }

    #[test]
    fn a_planted_linear_residual_is_found_and_helps_on_another_flight() {
        let model = sample::model();
        let mut weights = vec![0.0_f32; REGRESSORS * OUTPUTS];
        weights[4 * OUTPUTS + 4] = -0.05; // pitch acceleration with the angle of attack
        weights[INPUTS * OUTPUTS + 3] = 0.004; // a constant roll acceleration
        let network = Dense::new(&[INPUTS, OUTPUTS], weights).unwrap();
        let planted = Residual::new(network, &model.airframe, model.scale()).unwrap();
        let truth = having(&model, planted);
        let parts = [flown(&truth, "a", 0.0), flown(&truth, "b", 1.0)];
        let found = fit(&model, &parts, &[1.0, 2.0]).unwrap();
        assert_eq!(found.ridge, RIDGES[0], "without noise the smallest ridge is best");
        let test = [flown(&truth, "c", 2.0)];
        let at = |m: &GreyBox| overall(&[free_run::fly(m, &test, &[2.0]).0.score(2.0)]).unwrap();
        let [before, after] = [at(&model), at(&found.model)];
        assert!(after < 0.2 * before, "{before} to {after}");
    }

    #[test]
    fn an_exact_model_gets_no_residual() {
        let model = sample::model();
        let parts = [flown(&model, "a", 0.0), flown(&model, "b", 1.0)];
        assert!(fit(&model, &parts, &[1.0, 2.0]).is_none());
        assert!(fit(&model, &parts[..1], &[1.0]).is_none(), "one part leaves none to predict");
    }
}
