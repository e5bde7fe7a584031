//! Combination of forecasts: what a model, the state at the start and the mean state predict together.
//!
//! The combined forecast of a state at the horizon h is x̂(h) = x₀ + w(h) (x_m(h) − x₀) + v(h) (x_2(h) − x₀) + c(h) (x̄ − x₀). x₀ is
//! the state at the start of the run, x_m(h) the model's prediction, x_2(h) that of a second forecast, if there is one, and x̄ the
//! mean state of the flights to which the model was fitted. w is the weight of the model, v that of the second forecast, c that of
//! the mean state, and 1 − w − v − c that of the held state. The weights are not negative. A small w says that the model is not to
//! be trusted over this time.
//!
//! Sources: Bates and Granger, The combination of forecasts, Operational Research Quarterly 20, 1969; weights from predictions of
//! parts that the model was not fitted to: Wolpert, Stacked generalization, Neural Networks 5, 1992; shrinkage towards equal weights:
//! Diebold and Pauly, The use of prior information in forecast combination, International Journal of Forecasting 6, 1990.

mod weights;

use super::arx::{Arx, ArxError};
use super::correction::Correction;
use super::forecast::{self, Forecast};
use super::free_run::{self, error, scaled};
use super::result::HorizonScore;
use super::runs::{Ahead, Runs};
use crate::weak_form::prepared::Prepared;
use greylag_model::GreyBox;
use greylag_num::statistics::mean;
use weights::{FORECASTS, Sums, equal};

/// Time between the starts of the runs from which weights follow, s. With that between the runs of a comparison there would be few.
pub const EVERY_S: f64 = 0.5;
/// Smaller scaled errors are replaced by this value (dimensionless), because they may differ by rounding only.
const LEAST_ERROR: f64 = 1e-6;
/// A forecast diverges if its error exceeds that of holding the state at the start by this factor.
const DIVERGED: f64 = 10.0;
/// Smallest relative decrease of the error for which a more complex forecast is taken.
const CLEARLY: f64 = 0.01;
/// Shrinkages that are tried. See [`Choice::runs`].
const SHRINKAGES: [f64; 4] = [1.0, 10.0, 100.0, 1e6];

/// Runs of a forecast along one flight. They end where the predicted state is far from its start (a scaled distance of 1). The
/// last state before that is then held.
#[derive(Clone, Debug)]
pub struct Forecasts {
    horizons_s: Vec<f64>,
    runs: Vec<Ahead>,
    /// Runs of a second forecast from the same starts.
    second: Option<Vec<Ahead>>,
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
    /// For each horizon and state the weights of the model, of the second forecast and of the mean state, 0 to 1, dimensionless.
    pub weights: Vec<[[f64; FORECASTS]; 8]>,
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
        let (scale, second) = (model.scale(), None);
        Forecasts { horizons_s: horizons_s.to_vec(), runs, second, scale, mean_state }
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
        Ok(Forecasts { horizons_s: horizons_s.to_vec(), runs, second: None, scale, mean_state })
    }

    /// The same runs of a forecast that holds the state at the start.
    pub fn held(&self) -> Forecasts {
        let mut held = Forecasts { second: None, ..self.clone() };
        for run in &mut held.runs {
            run.pairs.iter_mut().for_each(|pair| pair[1] = run.from);
            let errors = run.pairs.iter().map(|[measured, _]| error(measured, &run.from));
            run.unheld = errors.map(|error| scaled(&error, &self.scale)).collect();
        }
        held
    }

    /// These runs together with those of `second`, another forecast of the same flight to the same horizons. `None` if the runs do
    /// not correspond.
    pub fn beside(self, second: &Forecasts) -> Option<Forecasts> {
        let lengths = |runs: &[Ahead]| runs.iter().map(|run| run.pairs.len()).collect::<Vec<_>>();
        let same = lengths(&self.runs) == lengths(&second.runs);
        same.then(|| Forecasts { second: Some(second.runs.clone()), ..self })
    }

    /// Whether a forecast diverges along this flight: at a horizon, the root mean square of its errors, without the hold of runs
    /// that end early, is not finite or more than ten times that of holding the state at the start.
    pub fn diverges(&self) -> bool {
        let square = |x: f64| x * x;
        let beyond = |runs: &[Ahead], h: usize| {
            let (mut own, mut hold) = (0.0, 0.0);
            for run in runs.iter().filter(|run| run.pairs.len() > h) {
                own += square(run.unheld[h]);
                hold += square(scaled(&error(&run.pairs[h][0], &run.from), &self.scale));
            }
            !own.is_finite() || own > square(DIVERGED) * hold
        };
        let mut all = [Some(&self.runs), self.second.as_ref()].into_iter().flatten();
        all.any(|runs| (0..self.horizons_s.len()).any(|h| beyond(runs, h)))
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
    /// Equal weights of model, mean state and held state at `horizons` horizons (number).
    pub fn equal(horizons: usize) -> Combination {
        Combination { weights: vec![[equal(&[]); 8]; horizons] }
    }

    /// The whole weight on the model at `horizons` horizons (number).
    fn whole(horizons: usize) -> Combination {
        Combination { weights: vec![[[1.0, 0.0, 0.0]; 8]; horizons] }
    }

    /// The weights with the smallest sum of squared scaled errors over the runs of `parts`, plus the shrinkage. A horizon that no
    /// run reaches has those of the horizon before it, or equal weights.
    pub fn fit(parts: &[&Forecasts], choice: Choice) -> Combination {
        let horizons = parts.first().map_or(0, |p| p.horizons_s.len());
        let equal = equal(parts);
        let mut weights: Vec<[[f64; FORECASTS]; 8]> = Vec::with_capacity(horizons);
        for h in 0..horizons {
            let runs = parts.iter().map(|p| p.runs.iter().filter(|r| r.pairs.len() > h).count());
            if runs.sum::<usize>() == 0 {
                weights.push(weights.last().copied().unwrap_or([equal; 8]));
                continue;
            }
            let mut at = [equal; 8];
            for group in choice.pooled.groups() {
                let found = Sums::of(parts, h, group).weights(choice.runs, &equal);
                group.iter().for_each(|k| at[*k] = found);
            }
            weights.push(at);
        }
        Combination { weights }
    }

    /// Errors of the combined forecast on the flight of `forecasts`, one for each horizon.
    pub fn scores(&self, forecasts: &Forecasts) -> Vec<HorizonScore> {
        let Forecasts { horizons_s, runs, scale, .. } = forecasts;
        let one = |(number, run): (usize, &Ahead)| {
            let of = |(h, weights): (usize, &[[f64; FORECASTS]; 8])| {
                let measured = run.pairs.get(h)?[0];
                let away = forecasts.departures(number, h);
                let combined = |k: usize| {
                    run.from[k] + (0..FORECASTS).map(|f| weights[k][f] * away[f][k]).sum::<f64>()
                };
                Some([measured, std::array::from_fn(combined)])
            };
            let reached = self.weights.iter().enumerate().take(run.pairs.len());
            reached.map(of).collect()
        };
        let runs = runs.iter().enumerate().map(one).collect();
        let runs = Runs::new(horizons_s.clone(), runs, *scale);
        horizons_s.iter().map(|h| runs.score(*h)).collect()
    }

    /// Mean over the states of the model's weight at each horizon, 0 to 1.
    pub fn of_model(&self) -> Vec<f64> {
        let one = |at: &[[f64; FORECASTS]; 8]| at.iter().map(|w| w[0]).sum::<f64>() / 8.0;
        self.weights.iter().map(one).collect()
    }
}

impl Forecasts {
    /// Departures from the start of run `number` at horizon number `h` that the model, the second forecast and the mean state predict, in
    /// the units of the state. That of a second forecast which does not exist is zero.
    fn departures(&self, number: usize, h: usize) -> [[f64; 8]; FORECASTS] {
        let run = &self.runs[number];
        let second = self.second.as_ref().map_or(&run.from, |all| &all[number].pairs[h][1]);
        [&run.pairs[h][1], second, &self.mean_state].map(|to| error(&run.from, to))
    }
}

/// Those of `parts` that reach the shortest horizon; `None` if they are fewer than two.
fn reached(parts: &[Forecasts]) -> Option<Vec<&Forecasts>> {
    let reached = parts.iter().filter(|p| p.runs.iter().any(|run| !run.pairs.is_empty()));
    let reached: Vec<&Forecasts> = reached.collect();
    (reached.len() >= 2).then_some(reached)
}

/// Scaled error of the model alone on `parts`, as [`Chosen::error`]. `None` if fewer than two parts reach the shortest horizon, or if
/// it diverges along one.
pub fn error_alone(parts: &[Forecasts]) -> Option<f64> {
    if parts.iter().any(Forecasts::diverges) {
        return None;
    }
    reached(parts).map(|parts| alone(&parts))
}

/// Scaled error of the model alone on `parts`, of which there is at least one.
fn alone(parts: &[&Forecasts]) -> f64 {
    let alone = Combination::whole(parts[0].horizons_s.len());
    overall(parts.iter().map(|part| alone.scores(part)))
}

/// Chooses among `candidates`, ways to forecast the same parts in ascending order of complexity. A way is taken in place of a simpler
/// one if it lowers [`Chosen::error`] by more than 1 %. A way that diverges along a part is left out. Returns the index of the way with
/// its combination; `None` if there is none.
pub fn simplest(candidates: &[Vec<Forecasts>]) -> Option<(usize, Chosen)> {
    let mut taken: Option<(usize, Chosen)> = None;
    for (place, parts) in candidates.iter().enumerate() {
        if parts.iter().any(Forecasts::diverges) {
            continue;
        }
        let Some(chosen) = choose(parts) else { continue };
        let least = taken.as_ref().map_or(f64::INFINITY, |(_, simpler)| simpler.error);
        if chosen.error < (1.0 - CLEARLY) * least {
            taken = Some((place, chosen));
        }
    }
    taken
}

/// Chooses which states are pooled and the shrinkage: each of `parts` is predicted with weights from the others. The error is that
/// of [`Chosen::error`]. `None` if fewer than two parts reach the shortest horizon.
///
/// The forecasts of a part must come from a model that was not fitted to it.
pub fn choose(parts: &[Forecasts]) -> Option<Chosen> {
    let reached = reached(parts)?;
    let alone = alone(&reached);
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

#[cfg(test)]
mod tests;
