//! What each flight has of its own, as fitted beside the aerodynamics: its trims, how its measured axes stand.

use crate::sysid::diagnose::answer::result::{FlightTrim, Measurement};
use crate::sysid::diagnose::answer::sentences::figures;
use crate::sysid::diagnose::search::round::Round;
use crate::sysid::per_flight::Constant;

/// Id of the angles among the errors of the measurement.
pub const ASKEW: &str = "axes_askew";
/// Standard deviations beyond which a constant is clearly not zero.
const CLEARLY: f64 = 4.0;
/// Prior standard deviations beyond which a constant is not believed: something that acts like it is missing.
const BELIEVED: f64 = 3.0;
/// Angle under which axes are mounted as well as can be, rad.
const MOUNTED: f64 = 0.5 * std::f64::consts::PI / 180.0;
/// Least standard deviation of an angle, rad: in simulated flights whose axes are the body's it came out 0.05° off, beside
/// a flight whose axes stand askew up to 0.34°.
const LEAST: f64 = 0.15 * std::f64::consts::PI / 180.0;
/// Share of its usual standard deviation under which a trim does not matter.
const MATTERS: f64 = 0.2;

/// The angles of each flight's axes in `round`; empty if they were not asked for.
pub fn askew(round: &Round) -> Vec<Measurement> {
    let angles = round.per_flight.angles();
    let fitted = fitted(round).into_iter().filter(|f| f.which < angles);
    fitted
        .map(|f| {
            let (size, sd) = (f.value.abs(), f.sd.hypot(LEAST));
            Measurement {
                flight: f.flight,
                id: ASKEW.into(),
                name: f.constant.name.into(),
                value: f.value,
                sd,
                unit: "rad".into(),
                asserted: size > MOUNTED.max(CLEARLY * sd) && size < BELIEVED * f.constant.width,
            }
        })
        .collect()
}

/// The trims of each flight in `round`; empty if they were not asked for.
pub fn trims(round: &Round) -> Vec<FlightTrim> {
    let angles = round.per_flight.angles();
    let fitted = fitted(round).into_iter().filter(|f| f.which >= angles);
    let clear = |[by, sd]: [f64; 2], width: f64| {
        (CLEARLY * sd).max(MATTERS * width) < by.abs() && by.abs() < BELIEVED * width
    };
    fitted
        .map(|f| FlightTrim {
            flight: f.flight,
            name: f.constant.name.into(),
            prior_sd: f.constant.width,
            value: f.value,
            sd: f.sd,
            beside_mean: f.beside_mean,
            asserted: f.beside_mean.is_some_and(|beside| clear(beside, f.constant.width)),
        })
        .collect()
}

/// A constant of a flight as fitted.
struct Fitted {
    flight: String,
    /// Its place among the flight's constants.
    which: usize,
    constant: Constant,
    value: f64,
    sd: f64,
    beside_mean: Option<[f64; 2]>,
}

fn fitted(round: &Round) -> Vec<Fitted> {
    let constants = round.per_flight.constants();
    let (p, flights) = (&round.projected, round.flights.len());
    let place =
        |flight: usize, which: usize| round.coefficients.len() + flight * constants.len() + which;
    let one = |flight: usize, which: usize| {
        let misfit = misfit(round, flight);
        let sd = |variance: f64| misfit * variance.max(0.0).sqrt();
        let places: Vec<usize> = (0..flights).map(|k| place(k, which)).collect();
        let own = places[flight];
        let share = 1.0 / flights as f64;
        // the mean of all flights is as well in the model's coefficient, so that what tells them apart is known better
        let weights: Vec<f64> =
            (0..flights).map(|k| f64::from(u8::from(k == flight)) - share).collect();
        let pairs = places.iter().zip(&weights);
        let beside: f64 = pairs.clone().map(|(k, w)| w * p.tuned[*k]).sum();
        let row = |a: usize| pairs.clone().map(|(b, w)| w * p.covariance[(a, *b)]).sum::<f64>();
        let variance: f64 = pairs.clone().map(|(a, w)| w * row(*a)).sum();
        Fitted {
            flight: round.flights[flight].measured.name.clone(),
            which,
            constant: constants[which],
            value: p.tuned[own],
            sd: sd(p.covariance[(own, own)]),
            beside_mean: (flights > 1).then(|| [beside, sd(variance)]),
        }
    };
    (0..flights)
        .flat_map(|k| (0..constants.len()).map(move |i| (k, i)))
        .map(|(k, i)| one(k, i))
        .collect()
}

/// By how much what a flight leaves exceeds its noise, at least 1: where something is missing, nothing is known as well as
/// noise alone would have it.
fn misfit(round: &Round, flight: usize) -> f64 {
    let of = round.projected.by_channel.iter().zip(&round.cells.flight_of_block);
    let own = of.filter(|(_, of)| **of == flight).flat_map(|(channels, _)| channels);
    let (square, rows) = own.fold((0.0, 0), |(s, n), (square, rows)| (s + square, n + rows));
    (square / rows.max(1) as f64).max(1.0).sqrt()
}

/// What is clearly so, a sentence for each flight.
pub fn sentences(measurement: &[Measurement], trims: &[FlightTrim]) -> Vec<String> {
    let mut said: Vec<String> = Vec::new();
    let askew = measurement.iter().filter(|m| m.id == ASKEW && m.asserted).map(|m| {
        let about = m.name.trim_start_matches("askew_");
        let [value, sd] = [m.value, m.sd].map(f64::to_degrees);
        (m.flight.as_str(), format!("{about} {value:.1} ± {sd:.1}°"))
    });
    for (flight, all) in by_flight(askew) {
        said.push(format!("{flight}: the measured axes stand askew, {all} ({ASKEW}), fitted beside the aerodynamics."));
    }
    let trims = trims.iter().filter(|t| t.asserted).filter_map(|t| {
        let [by, sd] = t.beside_mean?;
        let sign = if by < 0.0 { "−" } else { "+" };
        Some((
            t.flight.as_str(),
            format!("{} {sign}{} ± {}", t.name, figures(by.abs()), figures(sd)),
        ))
    });
    for (flight, all) in by_flight(trims) {
        said.push(format!(
            "{flight}: its trim differs from the mean of the flights, {all} (flight_trims)."
        ));
    }
    said
}

/// Neighbours of one flight joined.
fn by_flight<'a>(all: impl Iterator<Item = (&'a str, String)>) -> Vec<(&'a str, String)> {
    let mut joined: Vec<(&str, String)> = Vec::new();
    for (flight, words) in all {
        match joined.last_mut() {
            Some((last, text)) if *last == flight => *text += &format!(", {words}"),
            _ => joined.push((flight, words)),
        }
    }
    joined
}

/// Constants that strain their prior, in words.
pub fn notes(round: &Round) -> Vec<String> {
    let far = fitted(round).into_iter().filter(|f| f.value.abs() > BELIEVED * f.constant.width);
    far.map(|f| {
        format!(
            "{} of {} lies {:+.1} prior standard deviations from zero: the prior is too narrow, or something that acts \
             like it is missing.",
            f.constant.name,
            f.flight,
            f.value / f.constant.width
        )
    })
    .collect()
}
