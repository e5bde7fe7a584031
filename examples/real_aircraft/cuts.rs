//! Why training data that are cut into parts fit otherwise than whole: the structure is held, and one thing is changed at a time.
//!
//! All fits tune the coefficients only. A cut into eight segments of one flight ends the fit's shots at the cuts. A cut into eight
//! flights also gives each part sensor errors of its own (delay, airspeed, body rates, α, β), each with the prior of a whole
//! flight. A fit estimates these errors beside the coefficients, but its model does not keep them. The second line of each cut
//! gives the model the mean of those of airspeed, α and β back, as errors of the installation: the flight held out has the same
//! sensors.

use std::sync::Arc;

use anyhow::Result;
use greylag::model::{FlightConstants, GreyBox};
use greylag::sysid::amend::{FittedFlight, Options, amend};
use greylag::sysid::compare::scores;
use greylag::sysid::flight_path::reconstruction::Reconstruction;
use greylag::sysid::per_flight::{PerFlight, SensorErrors};
use greylag::sysid::progress::ignore_progress;

use crate::aircraft::{self, Aircraft, numbered, pieces};
use crate::{HORIZONS_S, print_row, scaled};

/// Number of parts.
const PARTS: usize = 8;

/// A way to cut the training flights.
struct Cut {
    /// Name of the cut, for the table.
    name: &'static str,
    /// Makes the flights of the fit of the training flights.
    flights: fn(&[Reconstruction]) -> Vec<Reconstruction>,
}

/// The cuts, in the order of the table.
const CUTS: [Cut; 3] = [
    Cut { name: "whole", flights: |fit| fit.to_vec() },
    Cut { name: "8 segments", flights: in_segments },
    Cut { name: "8 flights", flights: |fit| numbered(pieces(fit, PARTS)) },
];

/// Prints, for every aircraft and cut, the errors on the flights held out and the estimated sensor errors.
pub fn print() -> Result<()> {
    println!(
        "Scaled error of free runs on flights held out, of models whose coefficients alone were tuned, by the cut of the training data"
    );
    for aircraft in aircraft::all()? {
        println!("\n{}", aircraft.name);
        println!("  {:<18}{:>20}{:>20}{:>20}", "", "1 s", "2 s", "5 s");
        for cut in CUTS {
            print_cut(&aircraft, &cut)?;
        }
    }
    Ok(())
}

/// Prints the lines of one cut.
fn print_cut(aircraft: &Aircraft, cut: &Cut) -> Result<()> {
    let (mut without, mut with, mut said) = (Vec::new(), Vec::new(), Vec::new());
    for left in 0..aircraft.flights.len() {
        let (fit, test) = aircraft.held_out(left);
        eprintln!("{}; held out: {}; {}", aircraft.name, test.name, cut.name);
        let flights = (cut.flights)(&fit);
        let per_flight = PerFlight { sensors: SensorErrors::Dropped, ..PerFlight::default() };
        let options = Options { per_flight, ..Options::default() };
        let amended = match amend(&aircraft.model, &flights, &flights, &options, &ignore_progress) {
            Ok(amended) => amended,
            Err(why) => {
                eprintln!("  no fit: {why}");
                continue;
            }
        };
        let of = &amended.amendment.flights;
        let test = std::slice::from_ref(&test);
        without.push(scaled(&scores(&amended.model, test, &HORIZONS_S)?));
        with.push(scaled(&scores(&with_sensors(&amended.model, of), test, &HORIZONS_S)?));
        said.push(format!("    held out {}: {}", test[0].name, in_words(of)));
    }
    print_row(cut.name, &without);
    print_row("  with sensors", &with);
    said.iter().for_each(|line| println!("{line}"));
    Ok(())
}

/// `fit` with its flights cut into the segments that [`pieces`] makes of them.
fn in_segments(fit: &[Reconstruction]) -> Vec<Reconstruction> {
    let pieces = pieces(fit, PARTS);
    let one = |flight: &Reconstruction| {
        let own = pieces.iter().flatten().filter(|part| part.name == flight.name);
        let segments = own.flat_map(|part| part.segments.clone()).collect();
        Reconstruction { segments, ..flight.clone() }
    };
    fit.iter().map(one).collect()
}

/// Errors of airspeed (relative), α and β (rad) that the fit has estimated for a flight.
fn sensors(flight: &FittedFlight) -> [f64; 3] {
    [flight.airspeed_scale[0], flight.alpha_bias_rad[0], flight.beta_bias_rad[0]]
}

/// Mean of each of [`sensors`] over the flights of a fit, and standard deviation over them.
fn over_flights(flights: &[FittedFlight]) -> [[f64; 2]; 3] {
    let n = flights.len() as f64;
    std::array::from_fn(|k| {
        let of = |f: &FittedFlight| sensors(f)[k];
        let mean = flights.iter().map(of).sum::<f64>() / n;
        let square = flights.iter().map(|f| (of(f) - mean).powi(2)).sum::<f64>();
        [mean, (square / n).sqrt()]
    })
}

/// `model` with the mean sensor errors of `flights` as those of its installation.
fn with_sensors(model: &GreyBox, flights: &[FittedFlight]) -> GreyBox {
    let [airspeed, alpha, beta] = over_flights(flights).map(|[mean, _]| mean);
    let sensors = Some([airspeed, 0.0, 0.0, 0.0, alpha, beta]);
    let installation = FlightConstants { sensors, ..FlightConstants::default() };
    let mut with = model.clone();
    Arc::make_mut(&mut with.known).installation = Some(installation);
    with
}

/// The sensor errors of `flights` in words: mean and standard deviation over the flights.
fn in_words(flights: &[FittedFlight]) -> String {
    let [airspeed, alpha, beta] = over_flights(flights);
    let [airspeed, alpha, beta] =
        [airspeed.map(|x| 100.0 * x), alpha.map(f64::to_degrees), beta.map(f64::to_degrees)];
    let of = |name: &str, [mean, sd]: [f64; 2], unit: &str| {
        format!("{name} {mean:.2} (spread {sd:.2}){unit}")
    };
    [of("airspeed", airspeed, " %"), of("α", alpha, "°"), of("β", beta, "°")].join(", ")
}
