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
use crate::ratios::{self, RIVALS};
use crate::{COMBINED, Corrections, Errors, FITTED, WAYS, judged, print_errors};

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

/// Prints the learning curve of every aircraft; what is being done goes to the standard error stream.
pub fn print() -> Result<()> {
    println!(
        "Learning curve: scaled error of free runs on flights held out, all choices and fits by a share of the training data.\n\
         Errors are averaged over the training sets of a share, then over the flights held out; ± is the standard error over the \
         latter.\n\
         The ratio is that of the error of the fitted model, alone or combined, to the lowest error of the others: least squares, hold \
         the state, straight on, ARX of a chosen order."
    );
    for aircraft in aircraft::all()? {
        let points =
            SHARES.iter().map(|share| point(&aircraft, share)).collect::<Result<Vec<_>>>()?;
        println!("\n{}", aircraft.name);
        println!("  error / lowest error of the others");
        println!("  {:<36}{:>6}{:>10}{:>34}{:>34}{:>34}", "", "sets", "each", "1 s", "2 s", "5 s");
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

/// Prints the lines of `point` in the table of ratios.
fn print_ratios(point: &Point) {
    let mean_s = point.durations_s.iter().sum::<f64>() / point.durations_s.len() as f64;
    let sets = point.durations_s.len() / point.errors.len();
    let each = format!("{mean_s:.0} s");
    for (way, rivals) in [(FITTED, RIVALS), (COMBINED, RIVALS)] {
        let name = format!("{}, {}", point.name, WAYS[way]);
        let [a, b, c] = ratios::cells(&point.errors, way, &rivals);
        println!("  {name:<36}{sets:>6}{each:>10}{a:>34}{b:>34}{c:>34}");
    }
}
