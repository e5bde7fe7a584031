//! Joint training of prior and residual by variable projection (Golub and Pereyra, SIAM J. Numer. Anal. 10, 1973). The prior is
//! the physical part of the model. The residual is the neural network that is added to the prior's state rates F_p.
//!
//! F_p is linear in the prior's coefficients θ. The part of the residual that lies in the span of ∂F_p/∂θ belongs to the prior.
//! A linear regression of the residual on ∂F_p/∂θ over the samples of the flights finds this part, and the coefficients take it
//! over. Least squares would let a stall, which the prior cannot represent, dominate the regression and bias the coefficients.
//! Tukey's weights exclude such samples.

use nalgebra::DVector;
use rayon::prelude::*;

use crate::dynamics::basis::{Basis, columns};
use crate::dynamics::equation_error::{CHANNELS, Fit, Row, Weighting, solve};
use crate::dynamics::windows::{Track, regular};
use greylag_model::{GreyBox, Residual};

/// Largest number of samples used.
const SAMPLES: usize = 8192;

/// Number of iterations in which the samples are weighted anew.
const PASSES: usize = 8;

/// Change of the coefficients of `prior`, in the coordinates of `basis`, by which they take over the part of `residual` in the
/// span of ∂F_p/∂θ. `None` if the regression has no finite solution.
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
    /// Regression row of sample `k` of `track`: the residual's state rates, and the derivatives of the prior's state rates with
    /// respect to the coordinates and the nuisance coefficients.
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
