//! The errors-in-variables bias. The residual and the regressors (columns) contain the same sensor noise. The expected values of
//! their scalar products are therefore not zero, even if the model is right. This bias is estimated by adding simulated noise to
//! the flights.

use crate::diagnose::regression::shared;
use rayon::prelude::*;

use super::known::known;
use super::{Problem, place};
use crate::diagnose::regression::catalogue::{self, Columns, Entry};
use crate::diagnose::regression::cells::{Cells, Placed};
use crate::diagnose::regression::columns::Ready;
use crate::diagnose::regression::noise::Noise;
use greylag_model::GreyBox;

/// Number of draws of the noise over which the bias is averaged. With a single draw, the evidence (test statistic) for an inertia
/// error that did not exist was 3, 11 or 19, depending on the seed.
const DRAWS: usize = 8;

/// Flights, model and candidates (physical effects that the model may lack) of a round. In a round of the search, the model is
/// linearised over all flights and the candidates are ranked.
pub(super) struct Setting<'a> {
    pub(super) problem: &'a Problem,
    pub(super) model: &'a GreyBox,
    pub(super) entries: &'a [Entry],
    pub(super) accelerating: Option<&'a GreyBox>,
}

/// The elementwise sum of lists of equal length.
pub(super) fn sum(lists: &[Vec<f64>]) -> Vec<f64> {
    let count = lists.first().map_or(0, Vec::len);
    (0..count).map(|k| lists.iter().map(|list| list[k]).sum()).collect()
}

/// The flights with simulated noise added, and with the predictions of the model. `draw` is the number of the draw.
pub(super) fn disturbed(of: &Setting, draw: usize) -> Vec<Ready> {
    let flights = of.problem.flights.par_iter().zip(&of.problem.path).enumerate();
    flights
        .map(|(k, (f, path))| {
            let flight = shared::disturbed(f, path, of.problem.seed, [k, draw]);
            Ready::new(of.model, &flight).accelerating_as(of.accelerating)
        })
        .collect()
}

/// For each flight and each column, the bias of the scalar product with the residual. The columns are those of the nuisance
/// parameters (coefficients of the model, sensor errors) and of the linear candidates.
///
/// `before` has the columns without added noise, with the residual at the index `last`. The bias is the mean over [`DRAWS`]
/// draws, or a single draw if there are no candidates. The second result has the columns with the noise of the first draw.
pub(super) fn shared(
    of: &Setting,
    cells: &Cells,
    before: &[Placed],
    last: usize,
    noise: &Noise,
) -> (Vec<Vec<f64>>, Vec<Placed>) {
    let straight: Vec<Entry> =
        of.entries.iter().filter(|e| catalogue::straight(e)).copied().collect();
    let models = catalogue::with_all(of.model, &straight);
    let count = of.model.coefficients().len();
    let drawn = |draw: usize| {
        let flights = disturbed(of, draw);
        // the columns of the model's and the candidates' coefficients are computed together
        let all = |flight: &Ready| {
            let mut own = Vec::new();
            for (place, (with, _)) in models.iter().enumerate() {
                let first = if place == 0 { 0 } else { count };
                own.extend(flight.linear(with, first..with.coefficients().len()));
            }
            let candidates = own.split_off(count);
            (own, candidates)
        };
        let (columns, candidates) = flights.par_iter().map(all).unzip();
        let (known, _, mut after) = known(of.problem, of.model, &flights, columns);
        let made = Columns { trials: Vec::new(), columns: candidates };
        let end = place(&mut after, known.len(), &made, &flights);
        // the residual gets the index that it has in `before`
        for list in &mut after {
            list.iter_mut().filter(|(p, _)| *p == end).for_each(|(p, _)| *p = last);
        }
        (shared::products(cells, before, &after, last, noise), after)
    };
    let draws = if of.entries.is_empty() { 1 } else { DRAWS };
    let (mut mean, first) = drawn(0);
    let others: Vec<Vec<Vec<f64>>> = (1..draws).into_par_iter().map(|draw| drawn(draw).0).collect();
    for (k, flight) in mean.iter_mut().enumerate() {
        for (place, sum) in flight.iter_mut().enumerate() {
            *sum += others.iter().map(|of| of[k][place]).sum::<f64>();
            *sum /= draws as f64;
        }
    }
    (mean, first)
}
