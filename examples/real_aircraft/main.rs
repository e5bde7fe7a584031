//! Free-run error 1, 2 and 5 s ahead on flights held out, of every real aircraft in `tests/data`, beside what a model must beat:
//! `cargo run --release --ignore-rust-version --features sitl --example real_aircraft > results/real-aircraft.txt`.
//!
//! A flight (of the A430), or a half of a flight (of the others), is held out in turn. All choices are made without it: the
//! structure of the fit and the order of ARX by leaving out one of the flights fitted, or one of three parts of each where there
//! are fewer than three.
//!
//! The fitted model is also combined with the held and the mean state (`combined.rs`), with weights from what is left out. To be
//! fair, so is ARX, and the held and the mean state are combined without a model.
//!
//! `-- --only NAME` judges the aircraft whose heading has this name, in small letters. With
//! `-- --learning-curve > results/real-learning-curve.txt` the same is done with less and less training data
//! (`learning_curve.rs`). With `-- --cuts` the same training data are fitted whole and cut (`cuts.rs`). With
//! `-- --outside [SETS] > results/outside.txt` models that were fitted inside an envelope are judged outside of it (`outside.rs`).

mod aircraft;
mod combined;
mod corrected;
mod cuts;
mod learning_curve;
mod least_squares;
mod outside;
mod outside_flights;
mod ratios;

use anyhow::{Context, Result, bail};
use greylag::model::GreyBox;
use greylag::sysid::amend::leave_one_out::{
    Effort, Fitted, Scored, Structure, alternatives, leave_one_out,
};
use greylag::sysid::amend::{Options, Prior, Refused, amend, widened};
use greylag::sysid::compare::arx::{self, Arx, Choice};
use greylag::sysid::compare::{HorizonScore, forecast, scores};
use greylag::sysid::flight_path::reconstruction::Reconstruction;
use greylag::sysid::per_flight::{PerFlight, SensorErrors};
use greylag::sysid::progress::ignore_progress;
use greylag::sysid::weak_form::prepared::Prepared;

use aircraft::{numbered, pieces};
use corrected::Kind;
use least_squares::least_squares;

/// Horizons of the free runs, s.
const HORIZONS_S: [f64; 3] = [1.0, 2.0, 5.0];
/// What is judged, in the order of the table.
const WAYS: [&str; 11] = [
    "from geometry",
    "fitted",
    "fitted, corrected",
    "least squares",
    "hold the state",
    "straight on",
    "ARX of order 1",
    "ARX, order chosen",
    "fitted, combined",
    "no model, combined",
    "ARX, combined",
];
/// Place of the fitted model in [`WAYS`].
const FITTED: usize = 1;
/// Place of the fitted model with the correction of its free runs in [`WAYS`].
const CORRECTED: usize = 2;
/// Place of least squares in [`WAYS`].
const LEAST_SQUARES: usize = 3;
/// Place of the first forecast without aerodynamics in [`WAYS`].
const HOLD: usize = 4;
/// Place of the ARX forecast in [`WAYS`] whose order is chosen.
const CHOSEN_ARX: usize = 7;
/// Place of the combination of the fitted model in [`WAYS`]. That without a model and that of ARX follow.
const COMBINED: usize = 8;
/// Place of the structure among those of [`structures`] that is fitted where the data are too short for a choice.
const TUNED: usize = 1;

/// Scaled free-run errors (dimensionless) of one way at every horizon; NaN where no run gets there.
type Row = [f64; HORIZONS_S.len()];
/// Scaled free-run errors (dimensionless) of every way.
type Errors = [Row; WAYS.len()];

/// What all ways reach on a flight held out.
struct Judged {
    /// The errors of all ways.
    errors: Errors,
    /// Structure of the fitted model, in words.
    structure: String,
    /// Order and ridge of the ARX forecast whose order is chosen, in words.
    arx: String,
    /// Mean weights in the combinations of the fitted model and of ARX, in words.
    weights: String,
}

fn main() -> Result<()> {
    let asked: Vec<String> = std::env::args().skip(1).collect();
    let asked: Vec<&str> = asked.iter().map(String::as_str).collect();
    match asked[..] {
        [] => table(""),
        ["--only", name] => table(name),
        ["--learning-curve"] => learning_curve::print(),
        ["--cuts"] => cuts::print(),
        ["--outside"] => outside::print(outside::SETS),
        ["--outside", sets] => {
            let wrong = || format!("{sets}: write the number of sets after --outside");
            outside::print(sets.parse().with_context(wrong)?)
        }
        _ => {
            let asked = asked.join(" ");
            bail!(
                "give nothing, --only NAME, --learning-curve, --cuts or --outside [SETS], not {asked}"
            )
        }
    }
}

/// Prints the errors, with all of their training data, of all aircraft whose heading has `only` in small letters.
fn table(only: &str) -> Result<()> {
    println!(
        "Scaled error of free runs on flights held out: mean over those held out ± its standard error"
    );
    for aircraft in aircraft::all()?.into_iter().filter(|a| a.name.to_lowercase().contains(only)) {
        println!("\n{}", aircraft.name);
        let mut all = Vec::new();
        for left in 0..aircraft.flights.len() {
            let (fit, test) = aircraft.held_out(left);
            let judged = judged(&aircraft.model, &fit, &test, Corrections::Tried)?;
            let Judged { errors, structure, arx, weights } = judged;
            println!("  held out {}: {structure}; {arx}; {weights}", test.name);
            all.push(errors);
        }
        print_errors(&all);
        ratios::print(&all);
    }
    Ok(())
}

/// Prints a table of `all`, the errors on each flight held out: mean and standard error of every way.
fn print_errors(all: &[Errors]) {
    println!("  {:<20}{:>20}{:>20}{:>20}", "", "1 s", "2 s", "5 s");
    for (k, way) in WAYS.iter().enumerate() {
        print_row(way, &all.iter().map(|e| e[k]).collect::<Vec<_>>());
    }
}

/// Prints a line of a table: `name`, then mean and standard error at every horizon of `all`, one entry a flight held out.
fn print_row(name: &str, all: &[Row]) {
    let at = |h: usize| cell(&all.iter().map(|row| row[h]).collect::<Vec<_>>());
    println!("  {name:<18}{:>20}{:>20}{:>20}", at(0), at(1), at(2));
}

/// Mean and standard error of the `errors` that are known, and their number.
fn cell(errors: &[f64]) -> String {
    let known: Vec<f64> = errors.iter().copied().filter(|x| x.is_finite()).collect();
    let n = known.len() as f64;
    let mean = known.iter().sum::<f64>() / n;
    let spread = known.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0);
    match known.len() {
        0 => "-".into(),
        1 => format!("{mean:.3} (1)"),
        n => format!("{mean:.3} ± {:.3} ({n})", (spread / n as f64).sqrt()),
    }
}

/// Whether corrections of the fitted model's free runs are tried. This takes longer than all fits.
#[derive(Clone, Copy, PartialEq)]
enum Corrections {
    Tried,
    Skipped,
}

/// Errors on the flight `test` of all ways, made of the flights `fit` alone, and what was chosen.
fn judged(
    model: &GreyBox,
    fit: &[Reconstruction],
    test: &Reconstruction,
    corrections: Corrections,
) -> Result<Judged> {
    let test = std::slice::from_ref(test);
    let slowest = model.airframe.envelope.flying_from_mps();
    let ready = |all: &[Reconstruction]| {
        all.iter().map(|f| Prepared::new(f, slowest)).collect::<Result<Vec<_>, _>>()
    };
    let parts = parts(fit);
    let (seen, seen_parts, unseen) = (ready(fit)?, ready(&parts[..])?, ready(test)?);
    let folds = combined::folds(&seen_parts);
    let (scored, first, mut named) = chosen_structure(model, &parts);
    let fitted = fitted(model, fit, first);
    let mut errors = [[f64::NAN; HORIZONS_S.len()]; WAYS.len()];
    for (place, model) in
        [(0, model), (FITTED, &fitted), (LEAST_SQUARES, &least_squares(model, &seen))]
    {
        errors[place] = scaled(&scores(model, test, &HORIZONS_S)?);
    }
    let kinds = if corrections == Corrections::Tried { Kind::all() } else { Kind::pulls() };
    let (arx, of_arx) = chosen_arx(&seen, &seen_parts, model.scale());
    let best =
        combined::best(&scored, first, &folds, &kinds, arx.as_ref().map(|(_, choice)| *choice));
    if corrections == Corrections::Tried {
        errors[CORRECTED] = corrected::errors(&fitted, fit, test, best.alone)?;
        named = format!("{named}, {}", best.alone.in_words());
    }
    let of = &best.combined;
    let together =
        if of.structure == first { fitted } else { self::fitted(model, fit, of.structure) };
    let own = arx.as_ref().map(|(arx, _)| arx);
    errors[COMBINED] = combined::errors(&together, own, &seen, &unseen[0], of);
    named = format!("{named}; combined: {}", of.in_words(&structures(model)[of.structure].name));
    let mut weights = of.weights();
    let forecasts = forecast::on_unseen(&seen, &unseen, model.scale(), &HORIZONS_S);
    for (row, forecast) in errors[HOLD..].iter_mut().zip(forecasts) {
        *row = scaled(&forecast.free_run);
    }
    if let Some((arx, choice)) = &arx {
        errors[CHOSEN_ARX] = scaled(&arx.scores(&unseen, model.scale(), &HORIZONS_S)?);
        let flights = [&seen[..], &unseen[..]];
        let (rows, of_arx) = combined::without_model(arx, *choice, &folds, flights, model.scale())?;
        errors[COMBINED + 1..].copy_from_slice(&rows);
        weights = format!("{weights}; ARX: {of_arx}");
    }
    Ok(Judged { errors, structure: named, arx: of_arx, weights })
}

/// The scaled errors of `scores`, one for each horizon.
fn scaled(scores: &[HorizonScore]) -> Row {
    std::array::from_fn(|h| scores[h].rmse_scaled)
}

/// What is left out in turn to choose a structure or an order: the flights `fit`, or three parts of each where there are fewer
/// than three.
fn parts(fit: &[Reconstruction]) -> Vec<Reconstruction> {
    match fit.len() {
        0..=2 => fit.iter().flat_map(|f| numbered(pieces(std::slice::from_ref(f), 3))).collect(),
        _ => fit.to_vec(),
    }
}

/// The structures of a fit of `model` that are tried, with their names. Wider priors and effects of the catalogue are screened first.
fn structures(model: &GreyBox) -> Vec<Structure> {
    let of = |per_flight: PerFlight| Fitted::Coefficients { effects: Vec::new(), per_flight };
    let tuned = PerFlight { sensors: SensorErrors::Dropped, ..PerFlight::default() };
    let sensors = PerFlight { sensors: SensorErrors::Kept, ..tuned };
    let axes = PerFlight { askew_deg: Some(3.0), ..tuned };
    let trims = PerFlight { trims: Some(1.0), ..tuned };
    let complete = [
        ("as given", Fitted::Nothing),
        ("tuned", of(tuned)),
        ("tuned, sensor errors of the installation", of(sensors)),
        ("tuned, axes of each flight", of(axes)),
        ("tuned, trims of each flight", of(trims)),
        ("from scratch", Fitted::FromScratch),
    ];
    let of = |(name, fitted): (&str, _)| Structure {
        name: name.into(),
        fitted,
        effort: Effort::Complete,
    };
    let widened = |factor: f64| format!("tuned, prior widths × {factor}");
    let screened = alternatives(model, &[], widened, |id| format!("tuned, with {id}"));
    complete.into_iter().map(of).chain(screened).collect()
}

/// The errors of all structures on `parts` left out, the place of the one that predicts them best, and what that is. Where the parts
/// are too short for a choice, the coefficients alone are fitted.
fn chosen_structure(model: &GreyBox, parts: &[Reconstruction]) -> (Vec<Scored>, usize, String) {
    let structures = structures(model);
    let of = |some: &[Structure]| leave_one_out(model, parts, some, &HORIZONS_S, &ignore_progress);
    match of(&structures) {
        Ok(scored) => {
            let chosen = scored.iter().position(|s| s.chosen).unwrap_or(0);
            for s in &scored {
                let remark = match (s.chosen, s.screened) {
                    (true, _) => "chosen",
                    (_, true) => "screened",
                    _ => "",
                };
                let Scored { structure, mean, standard_error, .. } = s;
                eprintln!("  LOO {structure:<40} {mean:.4} ± {standard_error:.4} {remark}");
            }
            (scored, chosen, structures[chosen].name.clone())
        }
        Err(why) => {
            eprintln!("  no choice of the structure: {why}");
            // the model as given can be combined where no part is long enough for a fit
            let given = of(&structures[..1]).unwrap_or_default();
            (given, TUNED, "tuned, without a choice".into())
        }
    }
}

/// `model` fitted to all of `fit` with the structure number `place`; as given if no fit is possible.
fn fitted(model: &GreyBox, fit: &[Reconstruction], place: usize) -> GreyBox {
    let usual = PerFlight { sensors: SensorErrors::Dropped, ..PerFlight::default() };
    let usual = Options { per_flight: usual, ..Options::default() };
    let (start, options) = match &structures(model)[place].fitted {
        Fitted::Nothing | Fitted::LinearResidual => return model.clone(),
        Fitted::FromScratch => (model.clone(), Options { prior: Prior::Bounds, ..usual }),
        Fitted::Widened(factor) => (widened(model, *factor), usual),
        Fitted::Coefficients { effects, per_flight } => {
            let (effects, per_flight) = (effects.clone(), *per_flight);
            (model.clone(), Options { effects, refused: Refused::Kept, per_flight, ..usual })
        }
    };
    match amend(&start, fit, fit, &options, &ignore_progress) {
        Ok(amended) => amended.model,
        Err(why) => {
            eprintln!("  no fit: {why}");
            model.clone()
        }
    }
}

/// `model` with its coefficients fitted to `flights`, with the constants `per_flight`; as given if these are `None`. `None` if no
/// fit is possible.
fn tuned(
    model: &GreyBox,
    flights: &[Reconstruction],
    per_flight: Option<PerFlight>,
) -> Option<GreyBox> {
    let Some(per_flight) = per_flight else { return Some(model.clone()) };
    let options = Options { per_flight, ..Options::default() };
    match amend(model, flights, flights, &options, &ignore_progress) {
        Ok(amended) => Some(amended.model),
        Err(why) => {
            eprintln!("  no fit: {why}");
            None
        }
    }
}

/// An ARX forecast fitted to `seen`, with the order and the ridge that predict each of `parts` best from the others, and what
/// these are. `scale` has the reference values of the states, in their units.
fn chosen_arx(
    seen: &[Prepared],
    parts: &[Prepared],
    scale: [f64; 8],
) -> (Option<(Arx, Choice)>, String) {
    let choice = arx::choose(parts, scale, &HORIZONS_S).unwrap_or_else(|why| {
        eprintln!("  no choice of the order: {why}");
        Choice { order: 1, ridge: 0.0 }
    });
    match Arx::fit(seen, choice) {
        Ok(arx) => (
            Some((arx, choice)),
            format!("ARX of order {}, ridge {:?}", choice.order, choice.ridge),
        ),
        Err(why) => {
            eprintln!("  no ARX: {why}");
            (None, "no ARX".into())
        }
    }
}
