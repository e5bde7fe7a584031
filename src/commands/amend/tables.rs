//! Output of `greylag amend` on the terminal. The command re-estimates a model's coefficients from flights, adds effects that
//! the model lacks, and computes the error on held-out flights, which were not used for the estimation.

use comfy_table::Table;

use crate::commands::terminal::{NORMAL_95, noted, print_answer, table, whole_names};
use crate::sysid::amend::{Amendment, FittedFlight, Parameter};
use crate::sysid::compare::{Answer, HorizonScore};

/// Prints the answer (the reduction of the error in a few lines), then tables of errors and estimates, then the findings in
/// sentences, then notes.
pub fn print(story: &Amendment, answer: &Answer) {
    print_answer(answer);
    println!("{}\n{}", error_table(story), whole_names(parameter_table(&story.parameters)));
    if story.flights.iter().any(|f| !f.own.is_empty()) {
        println!("{}", own_table(&story.flights));
    }
    story.sentences.iter().for_each(|sentence| println!("{sentence}"));
    story.notes.iter().for_each(|note| println!("{}", noted(note)));
}

fn parameter_table(parameters: &[Parameter]) -> Table {
    let mut table = table(["coefficient", "before", "fitted", "95 % from", "to", ""], 1);
    for p in parameters {
        let before = if p.added { "–".into() } else { number(p.prior) };
        let remark = match (p.at_bound, p.added) {
            (true, _) => "at its bound",
            (_, true) => "added",
            _ => "",
        };
        // the standard deviation at a bound is that of a fit without bounds
        let [low, high] = if p.at_bound { [f64::NAN; 2] } else { p.ci95 };
        let row =
            [p.name.clone(), before, number(p.value), number(low), number(high), remark.into()];
        table.add_row(row);
    }
    table
}

/// Table of the constants that were estimated for each flight separately. Angles are in degrees.
fn own_table(flights: &[FittedFlight]) -> Table {
    let mut table =
        table(["flight", "its own", "value", "± 95 %", "minus the flights' mean", "± 95 %"], 1);
    for f in flights {
        for c in &f.own {
            let (factor, unit) = own_unit(c.name);
            let show = |x: f64| format!("{}{unit}", number(factor * x));
            let half = |sd: f64| show(NORMAL_95 * sd);
            let beside = c.beside_mean.map(|[by, sd]| [show(by), half(sd)]);
            let [by, of] = beside.unwrap_or_else(|| ["–".into(), "–".into()]);
            table.add_row([f.flight.clone(), c.name.into(), show(c.value), half(c.sd), by, of]);
        }
    }
    table
}

/// The factor that converts the constant `name` to its display unit, and this unit.
fn own_unit(name: &str) -> (f64, &'static str) {
    match name {
        name if name.starts_with("askew") => (1f64.to_degrees(), "°"),
        "thrust_share" => (100.0, " %"),
        _ => (1.0, ""),
    }
}

/// Table of the NRMSE of open-loop simulations ("free runs") on the held-out flights, for the model as given, re-estimated
/// ("tuned"), and with the added effects ("amended"). Columns are the lengths of the simulations, s.
fn error_table(story: &Amendment) -> Table {
    let header = ["NRMSE on held-out flights", "1 s", "2 s", "5 s", "10 s", "diverged"];
    let mut table = table(header, 1);
    let rows = [("as given", &story.given), ("tuned", &story.before), ("amended", &story.after)];
    for (name, scores) in rows {
        let mut row = vec![name.to_string()];
        row.extend(scores.iter().map(error));
        let last = scores.iter().rfind(|s| s.runs > 0);
        row.push(last.map_or("–".into(), |s| format!("{}/{}", s.diverged, s.runs)));
        table.add_row(row);
    }
    table
}

fn error(score: &HorizonScore) -> String {
    if score.runs > 0 { format!("{:.5}", score.rmse_scaled) } else { "–".into() }
}

/// Formats `x` with four significant figures.
fn number(x: f64) -> String {
    match x.abs() {
        0.0 => "0".into(),
        size if !size.is_finite() => "–".into(),
        size if size < 1e-5 => format!("{x:.2e}"),
        size => {
            let places = (3 - size.log10().floor() as i32).clamp(0, 8) as usize;
            format!("{x:.places$}")
        }
    }
}
