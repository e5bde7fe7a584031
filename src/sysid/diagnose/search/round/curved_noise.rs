//! The errors-in-variables bias of nonlinear candidates. A candidate is a physical effect that the model may lack. Its columns
//! (regressors) at a point of linearisation hold the same sensor noise as the residual, as those of linear candidates do.
//!
//! Without their own bias, such columns would get that of the model's columns that are projected out of them, with the wrong sign.

use rayon::prelude::*;

use super::shared_noise::{Setting, disturbed};
use crate::diagnose::regression::catalogue::{Entry, curved_columns};
use crate::diagnose::regression::cells::{Cells, Placed};
use crate::diagnose::regression::columns::Ready;
use crate::diagnose::regression::noise::Noise;
use crate::diagnose::regression::rank::Trial;
use crate::diagnose::regression::shared;

/// Number of draws of the noise over which the bias is averaged. They are the first draws of those for linear candidates.
const DRAWS: usize = 4;

/// A point at which a nonlinear candidate is linearised.
pub(super) struct Site {
    entry: Entry,
    /// Values of the candidate's coefficients.
    values: Vec<f64>,
    /// Index of the contribution among all columns. The derivatives with respect to the free coefficients follow.
    first: usize,
}

/// The points of `trials` at which nonlinear candidates on the air are linearised. Input effects are left out: the recorded
/// deflections hold no noise of the path. So are the points that a candidate has in `before`. `count` is the number of nuisance
/// parameters, whose columns come first.
pub(super) fn sites(
    trials: &[Trial],
    before: &[Trial],
    entries: &[Entry],
    count: usize,
) -> Vec<Site> {
    let mut sites = Vec::new();
    for trial in trials {
        let Some(entry) = entries.iter().find(|e| e.about.id == trial.id && !e.operator) else {
            continue;
        };
        let old = before.iter().find(|t| t.id == trial.id).map_or(0, |t| t.points.len());
        for point in trial.points.iter().skip(old) {
            if let Some(own) = point.contribution {
                sites.push(Site {
                    entry: *entry,
                    values: point.values.clone(),
                    first: count + own,
                });
            }
        }
    }
    sites
}

/// Adds the bias of the columns of `sites` to `bias`, which has a list for each flight. `placed` has the columns without added
/// noise, with the residual at the index `last`.
pub(super) fn add(
    of: &Setting,
    cells: &Cells,
    placed: &[Placed],
    last: usize,
    noise: &Noise,
    sites: &[Site],
    bias: &mut [Vec<f64>],
) {
    bias.iter_mut().for_each(|list| list.resize(last, 0.0));
    if sites.is_empty() {
        return;
    }
    let drawn = |draw: usize| {
        let flights = disturbed(of, draw);
        let mut after: Vec<Placed> =
            flights.iter().map(|f| vec![(last, f.residual.clone())]).collect();
        sites.iter().for_each(|site| place(&mut after, of, &flights, site));
        shared::products(cells, placed, &after, last, noise)
    };
    let all: Vec<Vec<Vec<f64>>> = (0..DRAWS).into_par_iter().map(drawn).collect();
    for (flight, list) in bias.iter_mut().enumerate() {
        for (place, sum) in list.iter_mut().enumerate() {
            *sum += all.iter().map(|of| of[flight][place]).sum::<f64>() / DRAWS as f64;
        }
    }
}

/// Appends the columns of `site` for `flights` to `after`.
fn place(after: &mut [Placed], of: &Setting, flights: &[Ready], site: &Site) {
    let made = curved_columns(of.model, flights, &site.entry, &site.values);
    for (list, own) in after.iter_mut().zip(made.unwrap_or_default()) {
        list.extend(own.into_iter().enumerate().map(|(k, column)| (site.first + k, column)));
    }
}

/// The bias `bias` of the columns of `before`, with the indices that the same columns have in `after`. The columns of nuisance
/// parameters and linear candidates keep their indices. Columns that only `after` has get zero. `count` is the number of nuisance
/// parameters, and `width` the number of columns without the residual.
pub(super) fn carried(
    bias: &[Vec<f64>],
    [before, after]: [&[Trial]; 2],
    count: usize,
    width: usize,
) -> Vec<Vec<f64>> {
    let columns = |t: &Trial, k: usize| -> Vec<usize> {
        let point = &t.points[k];
        point.free.iter().map(|f| f.1).chain(point.contribution).map(|c| count + c).collect()
    };
    let of = |own: &Vec<f64>| {
        let mut moved = vec![0.0; width];
        moved[..count].copy_from_slice(&own[..count]);
        for trial in after {
            let Some(old) = before.iter().find(|t| t.id == trial.id) else { continue };
            for k in 0..old.points.len().min(trial.points.len()) {
                for (from, to) in columns(old, k).into_iter().zip(columns(trial, k)) {
                    moved[to] = own.get(from).copied().unwrap_or(0.0);
                }
            }
        }
        moved
    };
    bias.iter().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::regression::rank::Point;

    fn trial(id: &'static str, firsts: &[usize], curved: bool) -> Trial {
        let point = |first: &usize| Point {
            values: vec![1.0],
            contribution: curved.then_some(*first),
            free: vec![(0, first + usize::from(curved), [0.0, 1.0])],
        };
        let points = firsts.iter().map(point).collect();
        Trial { id, points, support: 10.0, channels: [true; 6] }
    }

    #[test]
    fn the_bias_follows_the_columns_when_a_candidate_gets_a_further_point() {
        // two nuisance parameters, a linear candidate, and two nonlinear ones with two columns a point
        let before = [trial("a", &[0], false), trial("b", &[1], true), trial("c", &[3], true)];
        let after = [trial("a", &[0], false), trial("b", &[1, 3], true), trial("c", &[5], true)];
        let bias = [vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]];
        let moved = carried(&bias, [&before, &after], 2, 9);
        assert_eq!(moved, [[1.0, 2.0, 3.0, 4.0, 5.0, 0.0, 0.0, 6.0, 7.0]]);
    }
}
