//! Spurious products from noise that columns and residual share, estimated with simulated noise.

use crate::diagnose::regression::shared;
use rayon::prelude::*;

use super::known::known;
use super::{Problem, place};
use crate::diagnose::regression::catalogue::{self, Columns, Entry};
use crate::diagnose::regression::cells::{Cells, Placed};
use crate::diagnose::regression::columns::Ready;
use crate::diagnose::regression::noise::Noise;
use greylag_model::GreyBox;

/// Number of draws over which the product of shared noise is averaged. With a single draw, a non-existent inertia error
/// reached an evidence of 3, 11 or 19, depending on the seed.
const DRAWS: usize = 8;

/// Inputs of a round.
pub(super) struct Setting<'a> {
    pub(super) problem: &'a Problem,
    pub(super) model: &'a GreyBox,
    pub(super) entries: &'a [Entry],
    pub(super) accelerating: Option<&'a GreyBox>,
}

/// Elementwise sum of lists of equal length.
pub(super) fn sum(lists: &[Vec<f64>]) -> Vec<f64> {
    let count = lists.first().map_or(0, Vec::len);
    (0..count).map(|k| lists.iter().map(|list| list[k]).sum()).collect()
}

/// The flights with additional simulated noise of draw number `draw`.
pub(super) fn disturbed(of: &Setting, draw: usize) -> Vec<Ready> {
    let flights = of.problem.flights.par_iter().zip(&of.problem.path).enumerate();
    flights
        .map(|(k, (f, path))| {
            let flight = shared::disturbed(f, path, of.problem.seed, [k, draw]);
            Ready::new(of.model, &flight).accelerating_as(of.accelerating)
        })
        .collect()
}

/// Spurious products from shared noise, by flight and column, for the nuisance parameters and then the linear candidates.
///
/// The products are means of `DRAWS` draws if there are candidates, else of one draw. Also returns the columns with the noise
/// of the first draw.
pub(super) fn shared(
    of: &Setting,
    cells: &Cells,
    before: &[Placed],
    last: usize,
    noise: &Noise,
) -> (Vec<Vec<f64>>, Vec<Placed>) {
    let straight: Vec<Entry> =
        of.entries.iter().filter(|e| catalogue::straight(e)).copied().collect();
    let everything = catalogue::with_all(of.model, &straight).0;
    let drawn = |draw: usize| {
        let flights = disturbed(of, draw);
        // columns of the model and of the candidates in one pass
        let all = |flight: &Ready| {
            let mut own = flight.linear(&everything, 0..everything.coefficients().len());
            let candidates = own.split_off(of.model.coefficients().len());
            (own, candidates)
        };
        let (columns, candidates) = flights.par_iter().map(all).unzip();
        let (known, _, mut after) = known(of.problem, of.model, &flights, columns);
        let made = Columns { trials: Vec::new(), columns: candidates };
        let end = place(&mut after, known.len(), &made, &flights);
        // the residual keeps its index in `before`
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
