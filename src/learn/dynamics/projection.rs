//! Joint training by variable projection (Golub and Pereyra, SIAM J. Numer. Anal. 10, 1973).
//!
//! Prior and residual are learned together, and the prior's state rates F_p are linear in its coefficients θ. For a
//! given residual, the best coefficients leave no part of the residual in the span of ∂F_p/∂θ. They follow from a
//! linear regression of the residual on these derivatives, over the samples of the flights. The gradient of the
//! rollouts approaches the same condition in the mean square. In the mean square, a stall outside the prior's
//! structure dominates the residual and biases the coefficients. Tukey's weights exclude the stall.

use nalgebra::DVector;
use rayon::prelude::*;

use crate::dynamics::basis::{Basis, columns};
use crate::dynamics::equation_error::{CHANNELS, Fit, Row, Weighting, solve};
use crate::dynamics::windows::{Track, regular};
use greylag_model::{GreyBox, Residual};

/// Largest number of samples used.
const SAMPLES: usize = 8192;

/// Number of reweighting iterations.
const PASSES: usize = 8;

/// Step of the coordinates of `basis` that moves the part of `residual` in the span of ∂F_p/∂θ into the coefficients
/// of `prior`. `None` if the regression has no finite solution.
pub(super) fn step(
    prior: &GreyBox,
    residual: &Residual,
    basis: &Basis,
    tracks: &[Track],
    weighting: Weighting,
) -> Option<Vec<f64>> {
    let fit = Fit::new(prior, basis);
    let count = fit.count();
    let places = tracks.iter().flat_map(|t| (0..t.states.len()).map(move |k| (t, k)));
    let places: Vec<(&Track, usize)> = places.filter(|(t, k)| regular(&t.states[*k])).collect();
    let every = places.len().div_ceil(SAMPLES).max(1);
    let mut rows: Vec<Row> = places
        .par_iter()
        .step_by(every)
        .map(|(track, k)| fit.sample(prior, residual, track, *k))
        .collect();
    let mut sum = DVector::zeros(count);
    for _ in 0..PASSES {
        let step = solve(&rows, count, weighting, None)?;
        sum += &step;
        rows.iter_mut().for_each(|row| row.advance(&step));
    }
    let own: Vec<f64> = sum.iter().take(basis.len()).copied().collect();
    own.iter().all(|x| x.is_finite()).then_some(own)
}

impl Fit<'_> {
    /// Regression row of sample `k`: the residual's state rates, and the derivatives of the prior's state rates.
    fn sample(&self, prior: &GreyBox, residual: &Residual, track: &Track, k: usize) -> Row {
        let (state, controls) = (&track.states[k], &track.controls[k]);
        let scale = prior.scale();
        let added = residual.rate(state, controls).to_array();
        let of_theta = columns(prior, track, k);
        let lacking = self.rates_along(prior, state, track.altitude[k]);
        let unit = |rate: &[f64; 8]| CHANNELS.map(|c| rate[c] / scale[c]);
        let own = (0..self.basis.len()).map(|j| {
            let mut rate = [0.0; 8];
            for (place, turn) in self.basis.places.iter().zip(self.basis.column(j)) {
                rate.iter_mut().zip(of_theta[*place]).for_each(|(sum, x)| *sum += turn * x);
            }
            unit(&rate)
        });
        Row { error: unit(&added), slopes: own.chain(lacking.iter().map(unit)).collect() }
    }
}
