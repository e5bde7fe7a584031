//! Learning curve: the fitted model beside its rivals, all made of less and less training data.
//!
//! The training flights, laid end to end, are cut into one, two, four or eight pieces of the same length. Each piece alone makes
//! and chooses everything. The errors on a flight held out are averaged over the pieces. The standard error is over the flights
//! held out only: pieces that predict the same flight are not independent.
//!
//! A last line fits all of the training data after a cut into eight flights. It has the data of the first line, but each flight
//! of a fit has sensor errors of its own, and each flight in turn is left out to choose structure and order.

use std::collections::BTreeMap;

use anyhow::Result;
use greylag::sysid::flight_path::reconstruction::Reconstruction;

use crate::aircraft::{self, Aircraft, numbered, pieces, seconds};
use crate::{
    CHOSEN_ARX, Corrections, Errors, FITTED, HOLD, HORIZONS_S, LEAST_SQUARES, WAYS, judged,
    print_errors,
};

/// Places in [`WAYS`] of what the fitted model is compared with: least squares, hold, straight on, and ARX of a chosen order.
const RIVALS: [usize; 4] = [LEAST_SQUARES, HOLD, HOLD + 1, CHOSEN_ARX];

/// A share of the training data.
struct Share {
    /// Name of the share, for the table.
    name: &'static str,
    /// Makes the training sets of the training flights.
    sets: fn(&[Reconstruction]) -> Vec<Vec<Reconstruction>>,
}

/// The shares, in the order of the table.
const SHARES: [Share; 5] = [
    Share { name: "all", sets: |fit| vec![fit.to_vec()] },
    Share { name: "a half", sets: |fit| pieces(fit, 2) },
    Share { name: "a quarter", sets: |fit| pieces(fit, 4) },
    Share { name: "an eighth", sets: |fit| pieces(fit, 8) },
    Share { name: "all, cut in eight", sets: |fit| vec![numbered(pieces(fit, 8))] },
];

/// What all ways reach with a share of the training data.
struct Point {
    /// Name of the share.
    name: &'static str,
    /// Errors on each flight held out, averaged over the training sets.
    errors: Vec<Errors>,
    /// How often each structure and each order was chosen.
    chosen: BTreeMap<String, usize>,
    /// Duration of each training set, s, over all flights held out.
    durations_s: Vec<f64>,
}

/// Ratio of the error of the fitted model to that of its best rival.
struct Ratio {
    /// The ratio of the mean errors over the flights held out, dimensionless.
    value: f64,
    /// Standard error of the ratio.
    error: f64,
    /// Number of flights held out.
    flights: usize,
    /// Place of the best rival in [`WAYS`].
    best: usize,
}

/// Prints the learning curve of every aircraft; what is being done goes to the standard error stream.
pub fn print() -> Result<()> {
    println!(
        "Learning curve: scaled error of free runs on flights held out, all choices and fits by a share of the training data.\n\
         Errors are averaged over the training sets of a share, then over the flights held out; ± is the standard error over the \
         latter.\n\
         The ratio is that of the error of the fitted model to the lowest error of the others: least squares, hold the state, straight \
         on, ARX of a chosen order."
    );
    for aircraft in aircraft::all()? {
        let points =
            SHARES.iter().map(|share| point(&aircraft, share)).collect::<Result<Vec<_>>>()?;
        println!("\n{}", aircraft.name);
        println!("  error of the fitted model / lowest error of the others");
        println!("  {:<18}{:>6}{:>10}{:>34}{:>34}{:>34}", "", "sets", "each", "1 s", "2 s", "5 s");
        points.iter().for_each(print_ratios);
        for point in &points {
            println!("\n  {}: scaled errors", point.name);
            print_errors(&point.errors);
            for (what, times) in &point.chosen {
                println!("    {times} x {what}");
            }
        }
    }
    Ok(())
}

/// What all ways reach on the flights of `aircraft`, each held out in turn, with a `share` of the others.
fn point(aircraft: &Aircraft, share: &Share) -> Result<Point> {
    let mut point = Point {
        name: share.name,
        errors: Vec::new(),
        chosen: BTreeMap::new(),
        durations_s: Vec::new(),
    };
    for left in 0..aircraft.flights.len() {
        let (fit, test) = aircraft.held_out(left);
        let sets = (share.sets)(&fit);
        let mut all = Vec::new();
        for (k, set) in sets.iter().enumerate() {
            eprintln!(
                "{}; held out: {}; {}, set {} of {}",
                aircraft.name,
                test.name,
                share.name,
                k + 1,
                sets.len()
            );
            let judged = judged(&aircraft.model, set, &test, Corrections::Skipped)?;
            for what in [judged.structure, judged.arx] {
                *point.chosen.entry(what).or_insert(0) += 1;
            }
            point.durations_s.push(seconds(set));
            all.push(judged.errors);
        }
        point.errors.push(averaged(&all));
    }
    Ok(point)
}

/// Mean over the training sets of the errors that are known; NaN where none is.
fn averaged(all: &[Errors]) -> Errors {
    let mean = |way: usize, horizon: usize| {
        let known = all.iter().map(|e| e[way][horizon]).filter(|x| x.is_finite());
        let known: Vec<f64> = known.collect();
        known.iter().sum::<f64>() / known.len() as f64
    };
    std::array::from_fn(|way| std::array::from_fn(|horizon| mean(way, horizon)))
}

/// Prints the line of `point` in the table of ratios.
fn print_ratios(point: &Point) {
    let cells: Vec<String> = (0..HORIZONS_S.len())
        .map(|horizon| match ratio(&point.errors, horizon) {
            None => "-".into(),
            Some(Ratio { value, flights: 1, best, .. }) => format!("{value:.2} (1) {}", WAYS[best]),
            Some(Ratio { value, error, flights, best }) => {
                format!("{value:.2} ± {error:.2} ({flights}) {}", WAYS[best])
            }
        })
        .collect();
    let mean_s = point.durations_s.iter().sum::<f64>() / point.durations_s.len() as f64;
    let each = format!("{mean_s:.0} s");
    let sets = point.durations_s.len() / point.errors.len();
    println!(
        "  {:<18}{sets:>6}{each:>10}{:>34}{:>34}{:>34}",
        point.name, cells[0], cells[1], cells[2]
    );
}

/// The ratio at number `horizon` of [`HORIZONS_S`]; `None` if no flight held out is long enough.
///
/// The best rival is the one with the lowest mean over the flights held out. It is chosen after the fact, in favour of the
/// rivals.
fn ratio(errors: &[Errors], horizon: usize) -> Option<Ratio> {
    let known: Vec<&Errors> = errors.iter().filter(|e| e[FITTED][horizon].is_finite()).collect();
    let n = known.len() as f64;
    let mean = |way: usize| known.iter().map(|e| e[way][horizon]).sum::<f64>() / n;
    // the mean of a rival that is missing for one of the flights is NaN
    let rivals = RIVALS.into_iter().filter(|way| mean(*way).is_finite());
    let best = rivals.min_by(|a, b| mean(*a).total_cmp(&mean(*b)))?;
    let value = mean(FITTED) / mean(best);
    // to first order, the error of a ratio of two means is that of the mean of these differences, relative to the denominator
    let left = |e: &&Errors| e[FITTED][horizon] - value * e[best][horizon];
    let spread = known.iter().map(|e| left(e).powi(2)).sum::<f64>() / (n - 1.0);
    let error = (spread / n).sqrt() / mean(best);
    Some(Ratio { value, error, flights: known.len(), best })
}
