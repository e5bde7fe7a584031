//! Computes errors of open-loop simulations over 1, 2 and 5 s on held-out flights of every real aircraft in `tests/data`. Simple
//! forecasts are included for comparison:
//! `cargo run --release --ignore-rust-version --features sitl --example real_aircraft > results/real-aircraft.txt`.
//!
//! Each flight of the A430, and each half of the single flight of the other aircraft, is held out in turn. All choices are
//! made without it. The structure of the fit is chosen by cross-validation over the other flights, or over three parts of a
//! single flight.

use std::path::Path;

use anyhow::Result;
use greylag::logs;
use greylag::logs::mapping::Mapping;
use greylag::logs::phases::Flying;
use greylag::model::GreyBox;
use greylag::model::textbook::{Measures, Tail};
use greylag::sysid::amend::leave_one_out::{Fitted, Structure, leave_one_out};
use greylag::sysid::amend::{Options, amend};
use greylag::sysid::compare::{forecast, scores};
use greylag::sysid::flight_path::reconstruction::{Reconstruction, Segment};
use greylag::sysid::flight_path::{self, ActuatorClock, reconstruct};
use greylag::sysid::per_flight::PerFlight;
use greylag::sysid::progress::ignore_progress;
use greylag::sysid::weak_form::prepared::Prepared;
use greylag::sysid::weak_form::windows;
use nalgebra::{DMatrix, DVector};

const HORIZONS_S: [f64; 3] = [1.0, 2.0, 5.0];
/// Singular values below this fraction of the largest count as zero.
const RANK: f64 = 1e-6;
/// The compared models and forecasts, in the order of the table.
const WAYS: [&str; 6] =
    ["from geometry", "fitted", "least squares", "hold the state", "straight on", "ARX"];

/// Errors of every model and forecast at every horizon; NaN if no simulation is long enough.
type Errors = [[f64; HORIZONS_S.len()]; WAYS.len()];

struct Aircraft {
    name: &'static str,
    model: GreyBox,
    flights: Vec<Reconstruction>,
}

fn main() -> Result<()> {
    println!(
        "Scaled error of free runs on flights held out: mean over those held out ± its standard error"
    );
    for aircraft in [a430()?, dawn_one()?, thor()?, proto()?] {
        let Aircraft { name, model, flights } = aircraft;
        println!("\n{name}");
        let mut all = Vec::new();
        for left in 0..flights.len() {
            let mut fit = flights.clone();
            let test = [fit.remove(left)];
            let (errors, chosen) = judged(&model, &fit, &test)?;
            println!("  held out {}: {chosen}", test[0].name);
            all.push(errors);
        }
        print(&all);
    }
    Ok(())
}

fn print(all: &[Errors]) {
    println!("  {:<16}{:>20}{:>20}{:>20}", "", "1 s", "2 s", "5 s");
    for (k, way) in WAYS.iter().enumerate() {
        let cells: Vec<String> = (0..HORIZONS_S.len())
            .map(|h| cell(&all.iter().map(|e| e[k][h]).collect::<Vec<_>>()))
            .collect();
        println!("  {way:<16}{:>20}{:>20}{:>20}", cells[0], cells[1], cells[2]);
    }
}

/// Mean and standard error of the finite values, as text.
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

/// Errors on `test` of all models and forecasts, which are fitted to `fit` alone, and the chosen structure.
fn judged(
    model: &GreyBox,
    fit: &[Reconstruction],
    test: &[Reconstruction],
) -> Result<(Errors, String)> {
    let (fitted, chosen) = fitted(model, fit)?;
    let slowest = model.airframe.envelope.flying_from_mps();
    let ready = |all: &[Reconstruction]| {
        all.iter().map(|f| Prepared::new(f, slowest)).collect::<Result<Vec<_>, _>>()
    };
    let (seen, unseen) = (ready(fit)?, ready(test)?);
    let mut errors = [[f64::NAN; HORIZONS_S.len()]; WAYS.len()];
    for (row, model) in errors.iter_mut().zip([model, &fitted, &least_squares(model, &seen)]) {
        for (x, score) in row.iter_mut().zip(scores(model, test, &HORIZONS_S)?) {
            *x = score.rmse_scaled;
        }
    }
    let forecasts = forecast::on_unseen(&seen, &unseen, model.scale(), &HORIZONS_S);
    for (row, forecast) in errors[3..].iter_mut().zip(forecasts) {
        for (x, score) in row.iter_mut().zip(forecast.free_run) {
            *x = score.rmse_scaled;
        }
    }
    Ok((errors, chosen))
}

/// `model` fitted to all of `fit`, and the name of the structure of the fit. It is the structure with the smallest
/// cross-validation error on parts of `fit`.
fn fitted(model: &GreyBox, fit: &[Reconstruction]) -> Result<(GreyBox, String)> {
    let of = |per_flight: PerFlight| Fitted::Coefficients { effects: Vec::new(), per_flight };
    let axes = PerFlight { askew_deg: Some(3.0), ..PerFlight::default() };
    let trims = PerFlight { trims: Some(1.0), ..PerFlight::default() };
    let structures = [
        ("as given", Fitted::Nothing),
        ("tuned", of(PerFlight::default())),
        ("tuned, axes of each flight", of(axes)),
        ("tuned, trims of each flight", of(trims)),
    ];
    let structures = structures.map(|(name, fitted)| Structure { name: name.into(), fitted });
    let parts = if fit.len() > 2 { fit.to_vec() } else { fit.iter().flat_map(thirds).collect() };
    let scored = leave_one_out(model, &parts, &structures, &HORIZONS_S, &ignore_progress)?;
    let chosen = scored.iter().position(|s| s.chosen).unwrap_or(0);
    let options = match &structures[chosen].fitted {
        Fitted::Coefficients { per_flight, .. } => {
            Options { per_flight: *per_flight, ..Options::default() }
        }
        _ => return Ok((model.clone(), structures[chosen].name.clone())),
    };
    let amended = amend(model, fit, fit, &options, &ignore_progress)?;
    Ok((amended.model, structures[chosen].name.clone()))
}

/// Splits a flight into three parts of equal duration.
fn thirds(flight: &Reconstruction) -> Vec<Reconstruction> {
    let all: usize = flight.segments.iter().map(|s| s.instants.len()).sum();
    let mut parts = vec![Vec::new(); 3];
    let mut before = 0;
    for segment in &flight.segments {
        for (k, part) in parts.iter_mut().enumerate() {
            let edge = |k: usize| (k * all / 3).clamp(before, before + segment.instants.len());
            let piece = &segment.instants[edge(k) - before..edge(k + 1) - before];
            if !piece.is_empty() {
                part.push(Segment { instants: piece.to_vec() });
            }
        }
        before += segment.instants.len();
    }
    let named = parts.into_iter().enumerate();
    named
        .map(|(k, segments)| Reconstruction {
            name: format!("{}, part {}", flight.name, k + 1),
            segments,
            ..flight.clone()
        })
        .collect()
}

/// `model` with coefficients from ordinary least squares on forces and moments over windows of 0.37 s, without a prior. The
/// channels are weighted with the inverse rms residual of the given model. The coefficients are limited to their bounds.
fn least_squares(model: &GreyBox, flights: &[Prepared]) -> GreyBox {
    let count = model.coefficients().len();
    let (mut rows, mut right) = (Vec::new(), Vec::new());
    for flight in flights {
        let columns = windows::columns(model, flight).values;
        for (w, left) in windows::force_and_moment_residuals(model, flight).iter().enumerate() {
            for (channel, left) in left.iter().enumerate().filter(|(_, x)| x.is_finite()) {
                rows.push((channel, columns.iter().map(|c| c[channel][w]).collect::<Vec<_>>()));
                right.push(*left);
            }
        }
    }
    let mut square = [(0.0, 0.0); 6];
    for ((channel, _), y) in rows.iter().zip(&right) {
        square[*channel].0 += y * y;
        square[*channel].1 += 1.0;
    }
    let weight = square.map(|(sum, n): (f64, f64)| (n / sum.max(f64::MIN_POSITIVE)).sqrt());
    let a = DMatrix::from_fn(rows.len(), count, |i, j| weight[rows[i].0] * rows[i].1[j]);
    let y = DVector::from_fn(right.len(), |i, _| weight[rows[i].0] * right[i]);
    let size: Vec<f64> = a.column_iter().map(|c| c.norm().max(f64::MIN_POSITIVE)).collect();
    let scaled = DMatrix::from_fn(rows.len(), count, |i, j| a[(i, j)] / size[j]);
    let Ok(solved) = scaled.svd(true, true).solve(&y, RANK) else { return model.clone() };
    let moved = model.coefficients().iter().enumerate().map(|(k, c)| c.value + solved[k] / size[k]);
    let values: Vec<f64> = moved.collect();
    let mut fitted = model.clone();
    fitted.set_coefficients(&values);
    fitted
}

fn read(model: &GreyBox, path: &Path, mapping: Option<&Path>) -> Result<Reconstruction> {
    let mapping = mapping.map(Mapping::load).transpose()?.unwrap_or_default();
    let flies = mapping.flies(Some(Flying::from(model.airframe.envelope.flying_from_mps())));
    let log = logs::load(path, &logs::Options { mapping, flies, ..logs::Options::default() })?;
    let options = flight_path::Options::of(&log.flight.name, model, ActuatorClock::AsRecorded);
    Ok(reconstruct(&log.flight, &options.down_to(log.flies.sustained_s))?)
}

fn a430() -> Result<Aircraft> {
    let data = Path::new("tests/data/a430");
    let model = GreyBox::load(Path::new("params/a430/prior.toml"))?;
    let mut paths: Vec<_> =
        std::fs::read_dir(data)?.map(|entry| Ok(entry?.path())).collect::<Result<_>>()?;
    paths.retain(|p| p.extension().is_some_and(|e| e == "csv"));
    paths.sort();
    let mapping = data.join("mapping.toml");
    let flights = paths.iter().map(|p| read(&model, p, Some(&mapping))).collect::<Result<_>>()?;
    Ok(Aircraft { name: "A430, 0.1 kg, motion capture: 7 flights of 2.5 to 7 s", model, flights })
}

fn dawn_one() -> Result<Aircraft> {
    let thrust = Some([35.0, 20.0]);
    of_halves(
        "Dawn One, 9.5 kg, no vanes: 2 halves of one flight",
        "dawn_one",
        [9.5, 4.0, 1.499],
        thrust,
    )
}

fn thor() -> Result<Aircraft> {
    let measures = [1.959, 1.257, 0.3093];
    of_halves("Ultra Stick 25e (thor), 2 kg, vanes: 2 parts of one flight", "thor", measures, None)
}

fn proto() -> Result<Aircraft> {
    of_halves(
        "Proto, mass and area guessed, loiters: 2 parts of one flight",
        "proto",
        [3.0, 2.0, 0.36],
        None,
    )
}

/// An aircraft with its flights `fit.csv` and `test.csv`. Only mass (kg), span (m) and area (m²) are known, and for some
/// aircraft the static thrust (N) and the pitch speed of the propeller (m/s).
fn of_halves(
    name: &'static str,
    folder: &str,
    [mass, span, area]: [f64; 3],
    thrust: Option<[f64; 2]>,
) -> Result<Aircraft> {
    let weight = 9.80665 * mass;
    // as in `greylag aircraft new`: half of the weight, and twice the airspeed of level flight at a lift coefficient of 0.6
    let guess = [0.5 * weight, 2.0 * (2.0 * weight / (1.225 * area * 0.6)).sqrt()];
    let [static_thrust, pitch_speed] = thrust.unwrap_or(guess);
    let travel = 25f64.to_radians();
    let (name_of, tail, rudder) = (folder.to_owned(), Tail::Conventional, Some(travel));
    let measures = Measures {
        name: name_of,
        mass,
        span,
        area,
        tail,
        rudder,
        travel,
        static_thrust,
        pitch_speed,
    };
    let scratch = tempfile::tempdir()?;
    std::fs::write(scratch.path().join("airframe.toml"), measures.airframe())?;
    std::fs::write(scratch.path().join("model.toml"), measures.model())?;
    let model = GreyBox::load(&scratch.path().join("model.toml"))?;
    let data = Path::new("tests/data").join(folder);
    let flights = ["fit.csv", "test.csv"].map(|file| read(&model, &data.join(file), None));
    let flights = flights.into_iter().collect::<Result<_>>()?;
    Ok(Aircraft { name, model, flights })
}
