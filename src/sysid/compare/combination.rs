//! Combination of forecasts: what a model, the state at the start and the mean state predict together.
//!
//! The combined forecast of a state at the horizon h is x̂(h) = x₀ + w(h) (x_m(h) − x₀) + c(h) (x̄ − x₀). x₀ is the state at the
//! start of the run, x_m(h) the model's prediction, and x̄ the mean state of the flights to which the model was fitted. w is the
//! weight of the model, c that of the mean state, and 1 − w − c that of the held state. The three weights are not negative. A small
//! w says that the model is not to be trusted over this time.
//!
//! Sources: Bates and Granger, The combination of forecasts, Operational Research Quarterly 20, 1969; weights from predictions of
//! parts that the model was not fitted to: Wolpert, Stacked generalization, Neural Networks 5, 1992; shrinkage towards equal weights:
//! Diebold and Pauly, The use of prior information in forecast combination, International Journal of Forecasting 6, 1990.

use super::arx::{Arx, ArxError};
use super::correction::Correction;
use super::forecast::{self, Forecast};
use super::free_run::{self, error};
use super::result::HorizonScore;
use super::runs::{Ahead, Runs};
use crate::weak_form::prepared::Prepared;
use greylag_model::GreyBox;
use greylag_num::statistics::mean;

/// Time between the starts of the runs from which weights follow, s. With that between the runs of a comparison there would be few.
pub const EVERY_S: f64 = 0.5;
/// Smaller scaled errors are replaced by this value (dimensionless), because they may differ by rounding only.
const LEAST_ERROR: f64 = 1e-6;
/// Equal weights of model, mean state and held state.
const EQUAL: [f64; 2] = [1.0 / 3.0; 2];
/// Shrinkages that are tried. See [`Choice::runs`].
const SHRINKAGES: [f64; 4] = [1.0, 10.0, 100.0, 1e6];

/// Runs of a forecast along one flight. They end where the predicted state is far from its start (a scaled distance of 1). The
/// last state before that is then held.
#[derive(Clone, Debug)]
pub struct Forecasts {
    horizons_s: Vec<f64>,
    runs: Vec<Ahead>,
    scale: [f64; 8],
    mean_state: [f64; 8],
}

/// Which states have the same weights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pooled {
    /// None: each state has its own.
    Each,
    /// Attitude angles; airspeed; body rates; angle of attack and sideslip.
    Kinds,
    /// All.
    All,
}

/// How weights are fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    /// Which states have the same weights.
    pub pooled: Pooled,
    /// Shrinkage towards equal weights: the number of runs to which the equal weights correspond.
    pub runs: f64,
}

/// Weights of the forecasts that are combined.
#[derive(Clone, Debug, PartialEq)]
pub struct Combination {
    /// For each horizon and state the weights of model and mean state, 0 to 1, dimensionless.
    pub weights: Vec<[[f64; 2]; 8]>,
}

/// A combination that was chosen by cross-validation.
#[derive(Clone, Debug)]
pub struct Chosen {
    /// The combination with weights from all parts.
    pub combination: Combination,
    /// How its weights were fitted.
    pub choice: Choice,
    /// Scaled error (dimensionless) of the combination on parts left out: geometric mean over the horizons of the mean over parts.
    pub error: f64,
    /// The same error of the forecast alone.
    pub alone: f64,
}

impl Forecasts {
    /// Free runs of `model` along `flight` from starts every `every_s` (s) to each of `horizons_s` (s, ascending), with its rates
    /// corrected by `correction`. `mean_state` is the mean of the eight states (units of the state) of other flights.
    pub fn of_model(
        model: &GreyBox,
        flight: &Prepared,
        horizons_s: &[f64],
        every_s: f64,
        correction: Option<Correction>,
        mean_state: [f64; 8],
    ) -> Forecasts {
        let runs = free_run::ahead(model, flight, horizons_s, every_s, correction);
        Forecasts { horizons_s: horizons_s.to_vec(), runs, scale: model.scale(), mean_state }
    }

    /// Runs of an ARX forecast, as [`Forecasts::of_model`]. `scale` divides distances and has the units of the state.
    ///
    /// # Errors
    /// If the sample time of the flight is not that of the fit.
    pub fn of_arx(
        arx: &Arx,
        flight: &Prepared,
        horizons_s: &[f64],
        every_s: f64,
        [scale, mean_state]: [[f64; 8]; 2],
    ) -> Result<Forecasts, ArxError> {
        arx.sampled_as(flight)?;
        let forecast = Forecast::Linear(arx.clone());
        let runs = forecast::ahead(&forecast, flight, scale, horizons_s, every_s);
        Ok(Forecasts { horizons_s: horizons_s.to_vec(), runs, scale, mean_state })
    }

    /// The same runs of a forecast that holds the state at the start.
    pub fn held(&self) -> Forecasts {
        let mut held = self.clone();
        for run in &mut held.runs {
            run.pairs.iter_mut().for_each(|pair| pair[1] = run.from);
        }
        held
    }
}

/// Mean over all samples of `flights` of the eight states, in their units; the roll angle's is that of the mean direction. NaN
/// without samples.
pub fn mean_state<'a>(flights: impl IntoIterator<Item = &'a Prepared>) -> [f64; 8] {
    let all: Vec<[f64; 8]> = flights
        .into_iter()
        .flat_map(|f| f.segments.iter().flatten())
        .map(|at| at.state.to_array())
        .collect();
    let over = |of: &dyn Fn(&[f64; 8]) -> f64| mean(&all.iter().map(of).collect::<Vec<_>>());
    let mut mean_state = std::array::from_fn(|k| over(&|state| state[k]));
    mean_state[0] = over(&|state| state[0].sin()).atan2(over(&|state| state[0].cos()));
    mean_state
}

impl Pooled {
    /// The states, as indices, that have the same weights.
    fn groups(self) -> &'static [&'static [usize]] {
        match self {
            Pooled::Each => &[&[0], &[1], &[2], &[3], &[4], &[5], &[6], &[7]],
            Pooled::Kinds => &[&[0, 1], &[2], &[3, 4, 5], &[6, 7]],
            Pooled::All => &[&[0, 1, 2, 3, 4, 5, 6, 7]],
        }
    }
}

impl Combination {
    /// Equal weights at `horizons` horizons (number).
    pub fn equal(horizons: usize) -> Combination {
        Combination { weights: vec![[EQUAL; 8]; horizons] }
    }

    /// The weights with the smallest sum of squared scaled errors over the runs of `parts`, plus the shrinkage. A horizon that no
    /// run reaches has those of the horizon before it, or equal weights.
    pub fn fit(parts: &[&Forecasts], choice: Choice) -> Combination {
        let horizons = parts.first().map_or(0, |p| p.horizons_s.len());
        let mut weights: Vec<[[f64; 2]; 8]> = Vec::with_capacity(horizons);
        for h in 0..horizons {
            let runs = parts.iter().map(|p| p.runs.iter().filter(|r| r.pairs.len() > h).count());
            if runs.sum::<usize>() == 0 {
                weights.push(weights.last().copied().unwrap_or([EQUAL; 8]));
                continue;
            }
            let mut at = [EQUAL; 8];
            for group in choice.pooled.groups() {
                let found = Sums::of(parts, h, group).weights(choice.runs);
                group.iter().for_each(|k| at[*k] = found);
            }
            weights.push(at);
        }
        Combination { weights }
    }

    /// Errors of the combined forecast on the flight of `forecasts`, one for each horizon.
    pub fn scores(&self, forecasts: &Forecasts) -> Vec<HorizonScore> {
        let Forecasts { horizons_s, runs, scale, mean_state } = forecasts;
        let one = |run: &Ahead| {
            let pairs = run.pairs.iter().zip(&self.weights);
            let of = |(&[measured, predicted], weights): (&[[f64; 8]; 2], &[[f64; 2]; 8])| {
                Some([measured, combined(&run.from, &predicted, mean_state, weights)])
            };
            pairs.map(of).collect()
        };
        let runs = Runs::new(horizons_s.clone(), runs.iter().map(one).collect(), *scale);
        horizons_s.iter().map(|h| runs.score(*h)).collect()
    }

    /// Mean over the states of the model's weight at each horizon, 0 to 1.
    pub fn of_model(&self) -> Vec<f64> {
        let one = |at: &[[f64; 2]; 8]| at.iter().map(|w| w[0]).sum::<f64>() / 8.0;
        self.weights.iter().map(one).collect()
    }
}

/// The combined forecast of a run from the state `from` whose model predicts `predicted`.
fn combined(
    from: &[f64; 8],
    predicted: &[f64; 8],
    mean_state: &[f64; 8],
    weights: &[[f64; 2]; 8],
) -> [f64; 8] {
    let [model, mean] = [predicted, mean_state].map(|to| error(from, to));
    std::array::from_fn(|k| from[k] + weights[k][0] * model[k] + weights[k][1] * mean[k])
}

/// Chooses which states are pooled and the shrinkage: each of `parts` is predicted with weights from the others. The error is that
/// of [`Chosen::error`]. `None` if fewer than two parts reach the shortest horizon.
///
/// The forecasts of a part must come from a model that was not fitted to it.
pub fn choose(parts: &[Forecasts]) -> Option<Chosen> {
    let reached: Vec<&Forecasts> =
        parts.iter().filter(|p| p.runs.iter().any(|r| !r.pairs.is_empty())).collect();
    if reached.len() < 2 {
        return None;
    }
    let alone = Combination { weights: vec![[[1.0, 0.0]; 8]; reached[0].horizons_s.len()] };
    let alone = overall(reached.iter().map(|part| alone.scores(part)));
    let left_out = |choice: Choice| {
        overall((0..reached.len()).map(|left| {
            let mut others = reached.clone();
            let part = others.remove(left);
            Combination::fit(&others, choice).scores(part)
        }))
    };
    let pooled = [Pooled::All, Pooled::Kinds, Pooled::Each];
    let choices = pooled.iter().flat_map(|&pooled| SHRINKAGES.map(|runs| Choice { pooled, runs }));
    let scored = choices.map(|choice| (choice, left_out(choice)));
    let (choice, error) = scored.min_by(|a, b| a.1.total_cmp(&b.1))?;
    let combination = Combination::fit(&reached, choice);
    Some(Chosen { combination, choice, error, alone })
}

/// Geometric mean over the horizons of the mean over flights of the errors; horizons that no run reaches are left out.
fn overall(scores: impl Iterator<Item = Vec<HorizonScore>>) -> f64 {
    let scores: Vec<Vec<HorizonScore>> = scores.collect();
    let horizons = scores.first().map_or(0, Vec::len);
    let logarithm = |h: usize| {
        let reached = scores.iter().map(|s| &s[h]).filter(|s| s.runs > 0);
        let errors: Vec<f64> = reached.map(|s| s.rmse_scaled).collect();
        (!errors.is_empty()).then(|| mean(&errors).max(LEAST_ERROR).ln())
    };
    mean(&(0..horizons).filter_map(logarithm).collect::<Vec<_>>()).exp()
}

/// Sums over runs and states from which two weights follow. Departures from the start are divided by the scale.
struct Sums {
    /// Sums of the products of two predicted departures: of the model twice, of model and mean state, of the mean state twice.
    gram: [f64; 3],
    /// Sums of the products of a predicted departure and the measured one.
    moments: [f64; 2],
    /// Number of runs.
    runs: f64,
}

impl Sums {
    /// Sums over the runs of `parts` that reach horizon number `h`, and over the states `group`.
    fn of(parts: &[&Forecasts], h: usize, group: &[usize]) -> Sums {
        let mut sums = Sums { gram: [0.0; 3], moments: [0.0; 2], runs: 0.0 };
        for part in parts {
            for run in &part.runs {
                let Some([measured, predicted]) = run.pairs.get(h) else { continue };
                let [measured, model, mean] =
                    [measured, predicted, &part.mean_state].map(|to| error(&run.from, to));
                for &k in group {
                    let [y, m, c] = [measured, model, mean].map(|d| d[k] / part.scale[k]);
                    sums.gram.iter_mut().zip([m * m, m * c, c * c]).for_each(|(s, x)| *s += x);
                    sums.moments.iter_mut().zip([m * y, c * y]).for_each(|(s, x)| *s += x);
                }
                sums.runs += 1.0;
            }
        }
        sums
    }

    /// The weights, shrunk by `shrinkage` runs towards equal weights.
    fn weights(&self, shrinkage: f64) -> [f64; 2] {
        let share = shrinkage / self.runs.max(1.0);
        let [mut a, b, mut d] = self.gram;
        let [more_a, more_d] = [a, d].map(|x| share * x);
        let [e, f] = [self.moments[0] + more_a * EQUAL[0], self.moments[1] + more_d * EQUAL[1]];
        (a, d) = (a + more_a, d + more_d);
        let cost =
            |[w, c]: [f64; 2]| a * w * w + 2.0 * b * w * c + d * c * c - 2.0 * (e * w + f * c);
        let determinant = a * d - b * b;
        let inside = [(d * e - b * f) / determinant, (a * f - b * e) / determinant];
        if inside.iter().all(|x| *x >= 0.0) && inside[0] + inside[1] <= 1.0 {
            return inside;
        }
        // otherwise the minimum is on an edge of the triangle of permitted weights
        let held = |x: f64| if x.is_finite() { x.clamp(0.0, 1.0) } else { EQUAL[0] };
        let along = held((d - b + e - f) / (a - 2.0 * b + d));
        let edges = [[held(e / a), 0.0], [0.0, held(f / d)], [along, 1.0 - along]];
        edges.into_iter().min_by(|x, y| cost(*x).total_cmp(&cost(*y))).unwrap_or(EQUAL)
    }
}

#[cfg(test)]
mod tests;
