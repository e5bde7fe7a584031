//! Weights of combined forecasts by least squares, with non-negative weights whose sum is at most one.

use nalgebra::{Matrix4, Vector4};

use super::{Forecasts, error};

/// Number of forecasts with a weight: the model, a second forecast, and the mean state.
pub(super) const FORECASTS: usize = 3;
/// Number of subsets of the forecasts.
const SUBSETS: usize = 1 << FORECASTS;
/// Index of the second forecast.
const SECOND: usize = 1;
/// Violation of a limit of the weights that counts as rounding.
const ROUNDING: f64 = 1e-12;

/// Equal weights of all forecasts of `parts` and of the held state. A second forecast that `parts` lack has the weight zero.
pub(super) fn equal(parts: &[&Forecasts]) -> [f64; FORECASTS] {
    match parts.iter().any(|part| part.second.is_some()) {
        true => [0.25; FORECASTS],
        false => std::array::from_fn(|f| if f == SECOND { 0.0 } else { 1.0 / 3.0 }),
    }
}

/// Sums over runs and states from which the weights follow. Departures from the start are divided by the scale.
pub(super) struct Sums {
    /// Sums of the products of two predicted departures.
    gram: [[f64; FORECASTS]; FORECASTS],
    /// Sums of the products of a predicted departure and the measured one.
    moments: [f64; FORECASTS],
    /// Number of runs.
    runs: f64,
}

impl Sums {
    /// Sums over the runs of `parts` that reach horizon number `h`, and over the states `group`.
    pub fn of(parts: &[&Forecasts], h: usize, group: &[usize]) -> Sums {
        let none = [0.0; FORECASTS];
        let mut sums = Sums { gram: [none; FORECASTS], moments: none, runs: 0.0 };
        for part in parts {
            for (number, run) in part.runs.iter().enumerate() {
                let Some([measured, _]) = run.pairs.get(h) else { continue };
                let (measured, away) = (error(&run.from, measured), part.departures(number, h));
                for &k in group {
                    let predicted = away.map(|departure| departure[k] / part.scale[k]);
                    sums.add(&predicted, measured[k] / part.scale[k]);
                }
                sums.runs += 1.0;
            }
        }
        sums
    }

    fn add(&mut self, predicted: &[f64; FORECASTS], measured: f64) {
        for (f, x) in predicted.iter().enumerate() {
            self.gram[f].iter_mut().zip(predicted).for_each(|(sum, y)| *sum += x * y);
            self.moments[f] += x * measured;
        }
    }

    /// The weights, shrunk by `shrinkage` runs towards the weights `equal`.
    ///
    /// The cost is convex, so its least value is that of a stationary point on the inside, a face, an edge or a corner of the
    /// permitted weights. There are few of these, so all are tried.
    pub fn weights(&self, shrinkage: f64, equal: &[f64; FORECASTS]) -> [f64; FORECASTS] {
        let share = shrinkage / self.runs.max(1.0);
        let (mut gram, mut moments) = (self.gram, self.moments);
        for (f, equal) in equal.iter().enumerate() {
            moments[f] += share * gram[f][f] * equal;
            gram[f][f] *= 1.0 + share;
        }
        let cost = |w: &[f64; FORECASTS]| {
            let of = |f: usize| {
                let along: f64 = gram[f].iter().zip(w).map(|(x, w)| x * w).sum();
                w[f] * (along - 2.0 * moments[f])
            };
            (0..FORECASTS).map(of).sum::<f64>()
        };
        let subsets = (0..SUBSETS).map(|bits| -> [bool; FORECASTS] {
            std::array::from_fn(|f| (bits >> f) & 1 == 1 && gram[f][f] > 0.0)
        });
        let both = subsets.flat_map(|used| [false, true].map(|whole| (used, whole)));
        let points = both.filter_map(|(used, whole)| stationary(&gram, &moments, used, whole));
        let permitted = points.filter(|w| {
            w.iter().all(|x| *x >= -ROUNDING) && w.iter().sum::<f64>() <= 1.0 + ROUNDING
        });
        let best = permitted.min_by(|a, b| cost(a).total_cmp(&cost(b)));
        best.map_or(*equal, |w| w.map(|x| x.max(0.0)))
    }
}

/// Weights of the forecasts `used` at which the cost is stationary, with a sum of one if they are to have the `whole` weight. The
/// others have none. `None` if there is no such point or more than one.
fn stationary(
    gram: &[[f64; FORECASTS]; FORECASTS],
    moments: &[f64; FORECASTS],
    used: [bool; FORECASTS],
    whole: bool,
) -> Option<[f64; FORECASTS]> {
    // the last unknown is the multiplier of the sum
    let (mut matrix, mut right) = (Matrix4::<f64>::identity(), Vector4::<f64>::zeros());
    for i in (0..FORECASTS).filter(|i| used[*i]) {
        (0..FORECASTS).filter(|j| used[*j]).for_each(|j| matrix[(i, j)] = gram[i][j]);
        right[i] = moments[i];
        if whole {
            (matrix[(i, FORECASTS)], matrix[(FORECASTS, i)]) = (1.0, 1.0);
        }
    }
    if whole {
        (matrix[(FORECASTS, FORECASTS)], right[FORECASTS]) = (0.0, 1.0);
    }
    let solved = matrix.lu().solve(&right)?;
    Some(std::array::from_fn(|f| solved[f]))
}
