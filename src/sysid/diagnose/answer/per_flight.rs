//! Constants of each flight that are estimated together with the aerodynamics: trims, and misalignment angles of the sensors.
//!
//! A round is a linearisation of the model over all flights. Its nuisance parameters are the model's coefficients, the
//! constants of the flights and the sensor errors.

use std::collections::HashSet;

use nalgebra::DMatrix;

use crate::diagnose::answer::result::{FlightTrim, Measurement};
use crate::diagnose::answer::sentences::INTERVAL;
use crate::diagnose::search::round::Round;
use crate::per_flight::{Constant, askew};
use crate::text::figures;
use greylag_num::statistics::correlation_length;

/// A constant is significant if it differs from its reference by more than this number of standard deviations. The reference is
/// zero for an angle, and the mean over the flights for a trim.
const CLEARLY: f64 = 4.0;
/// A constant is implausible if it differs from zero by more than this number of prior standard deviations. It then
/// probably compensates for a missing effect.
const BELIEVED: f64 = 3.0;
/// Largest misalignment within the accuracy of mounting, rad.
const MOUNTED: f64 = 0.5 * std::f64::consts::PI / 180.0;
/// Smallest standard deviation of a misalignment angle, rad. In simulated flights with aligned axes, the estimates were wrong
/// by 0.05°; in a fit together with a misaligned flight, by up to 0.34°.
const LEAST: f64 = 0.15 * std::f64::consts::PI / 180.0;
/// A trim is negligible if it differs from the mean over the flights by less than this fraction of its prior standard
/// deviation.
const MATTERS: f64 = 0.2;

/// Estimated misalignment angles of each flight in `round`, rad, beyond those by which its axes were already rotated back. Zeros
/// unless they were estimated.
pub fn further_angles(round: &Round) -> Vec<[f64; askew::NAMES.len()]> {
    let (first, count) = (round.coefficients.len(), round.per_flight.constants().len());
    let angles = round.per_flight.angles();
    let angle = |flight: usize, axis: usize| match axis < angles {
        true => round.projected.tuned[first + flight * count + axis],
        false => 0.0,
    };
    let of = |flight: usize| std::array::from_fn(|axis| angle(flight, axis));
    (0..round.flights.len()).map(of).collect()
}

/// Misalignment angles of each flight in `round`; empty unless they were estimated.
pub fn angles(round: &Round) -> Vec<Measurement> {
    let angles = round.per_flight.angles();
    let all = fitted(round);
    let astray = astray(&all);
    let fitted = all.into_iter().filter(|f| f.which < angles);
    fitted
        .map(|f| {
            let (size, sd) = (f.value.abs(), f.sd.hypot(LEAST));
            let believed = !astray.contains(&f.flight);
            Measurement {
                flight: f.flight,
                id: askew::ID.into(),
                name: f.constant.name.into(),
                value: f.value,
                sd,
                unit: "rad".into(),
                asserted: believed && size > MOUNTED.max(CLEARLY * sd),
            }
        })
        .collect()
}

/// Trims of each flight in `round`; empty unless they were estimated.
pub fn trims(round: &Round) -> Vec<FlightTrim> {
    let angles = round.per_flight.angles();
    let all = fitted(round);
    let astray = astray(&all);
    let fitted = all.into_iter().filter(|f| f.which >= angles);
    let clear = |[by, sd]: [f64; 2], width: f64| {
        (CLEARLY * sd).max(MATTERS * width) < by.abs() && by.abs() < BELIEVED * width
    };
    fitted
        .map(|f| FlightTrim {
            asserted: !astray.contains(&f.flight)
                && f.beside_mean.is_some_and(|beside| clear(beside, f.constant.width)),
            flight: f.flight,
            name: f.constant.name.into(),
            prior_sd: f.constant.width,
            value: f.value,
            sd: f.sd,
            beside_mean: f.beside_mean,
        })
        .collect()
}

/// Estimate of one constant of one flight.
struct Fitted {
    flight: String,
    /// Index among the flight's constants.
    which: usize,
    constant: Constant,
    value: f64,
    sd: f64,
    beside_mean: Option<[f64; 2]>,
}

impl Fitted {
    /// Whether the constant is implausibly far from zero.
    fn is_implausible(&self) -> bool {
        self.value.abs() > BELIEVED * self.constant.width
    }
}

/// Flights with an implausible constant. No constant of these flights is asserted: the implausible constant probably
/// compensates for another cause, and the constants correlated with it are not reliable.
fn astray(fitted: &[Fitted]) -> HashSet<String> {
    fitted.iter().filter(|f| f.is_implausible()).map(|f| f.flight.clone()).collect()
}

fn fitted(round: &Round) -> Vec<Fitted> {
    let constants = round.per_flight.constants();
    let (p, flights) = (&round.projected, round.flights.len());
    let place =
        |flight: usize, which: usize| round.coefficients.len() + flight * constants.len() + which;
    if constants.is_empty() {
        return Vec::new();
    }
    let robust = sandwich(round);
    let angles = round.per_flight.angles();
    let one = |flight: usize, which: usize| {
        let measured = &round.flights[flight].measured;
        let turned = if which < angles { measured.turned[which] } else { 0.0 };
        let misfit = misfit(round, flight);
        let places: Vec<usize> = (0..flights).map(|k| place(k, which)).collect();
        let own = places[flight];
        let share = 1.0 / flights as f64;
        // the mean over all flights is confounded with the model's coefficient, so that differences from this mean are more
        // certain
        let weights: Vec<f64> =
            (0..flights).map(|k| f64::from(u8::from(k == flight)) - share).collect();
        let pairs = places.iter().zip(&weights);
        let beside: f64 = pairs.clone().map(|(k, w)| w * p.tuned[*k]).sum();
        let of = |covariance: &DMatrix<f64>| {
            let row = |a: usize| pairs.clone().map(|(b, w)| w * covariance[(a, *b)]).sum::<f64>();
            pairs.clone().map(|(a, w)| w * row(*a)).sum::<f64>()
        };
        let sd = |white: f64, robust: f64| (misfit * misfit * white).max(robust).max(0.0).sqrt();
        Fitted {
            flight: measured.name.clone(),
            which,
            constant: constants[which],
            value: turned + p.tuned[own],
            sd: sd(p.covariance[(own, own)], robust[(own, own)]),
            beside_mean: (flights > 1).then(|| [beside, sd(of(&p.covariance), of(&robust))]),
        }
    };
    (0..flights)
        .flat_map(|k| (0..constants.len()).map(move |i| (k, i)))
        .map(|(k, i)| one(k, i))
        .collect()
}

/// Robust covariance of the nuisance parameters by a sandwich estimate. Each row of the regression is weighted by the mean
/// square of the residual times its correlation length, both for the same flight and channel.
///
/// The noise of a channel is whitened in the same way in all flights. In a flight with a larger or slower residual than the
/// others, the plain covariance would therefore underestimate the uncertainty.
fn sandwich(round: &Round) -> DMatrix<f64> {
    let p = &round.projected;
    let count = round.known.len();
    let mut meat = DMatrix::zeros(count, count);
    for (k, known) in round.known.iter().enumerate().filter(|(_, of)| of.width.is_finite()) {
        meat[(k, k)] = known.width.powi(-2);
    }
    for (cell, rows) in round.cells.list.iter().zip(&p.rows) {
        let left: Vec<f64> = rows.column(rows.ncols() - 1).iter().copied().collect();
        let mut from = 0;
        let runs: Vec<Vec<f64>> = cell
            .runs
            .iter()
            .map(|&to| left[std::mem::replace(&mut from, to)..to].to_vec())
            .collect();
        let square = left.iter().map(|x| x * x).sum::<f64>() / left.len().max(1) as f64;
        let weight = square * correlation_length(&runs);
        let whitener = &round.noise.whiteners[cell.channel];
        let (places, z) = cell.matrix(&round.placed[cell.flight], whitener);
        let known = places.iter().take_while(|place| **place < count).count();
        let own = z.columns(0, known);
        let gram = own.tr_mul(&own);
        for (i, a) in places[..known].iter().enumerate() {
            for (j, b) in places[..known].iter().enumerate() {
                meat[(*a, *b)] += weight.max(1.0) * gram[(i, j)];
            }
        }
    }
    &p.covariance * meat * &p.covariance
}

/// Root mean square of the flight's whitened residual, at least 1, which is the value for noise. If an effect is missing, the
/// estimates are less certain than the noise suggests.
fn misfit(round: &Round, flight: usize) -> f64 {
    let of = round.projected.by_channel.iter().zip(&round.cells.flight_of_block);
    let own = of.filter(|(_, of)| **of == flight).flat_map(|(channels, _)| channels);
    let (square, rows) = own.fold((0.0, 0), |(s, n), (square, rows)| (s + square, n + rows));
    (square / rows.max(1) as f64).max(1.0).sqrt()
}

/// Sentences on significant misalignment angles, one for each flight.
pub fn askew_sentences(measurement: &[Measurement]) -> Vec<String> {
    let turned = measurement.iter().filter(|m| m.id == askew::ID && m.asserted).map(|m| {
        let about = m.name.trim_start_matches("askew_");
        let [value, half] = [m.value, INTERVAL * m.sd].map(f64::to_degrees);
        (m.flight.as_str(), format!("{about} {value:.2} ± {half:.2}°"))
    });
    let one = |(flight, all): (&str, String)| {
        format!(
            "{flight}: the measured axes are misaligned, {all} (95 %; {}), fitted together with the aerodynamics.",
            askew::ID
        )
    };
    by_flight(turned).into_iter().map(one).collect()
}

/// Sentences on trims that differ significantly between flights, one for each flight.
pub fn trim_sentences(trims: &[FlightTrim]) -> Vec<String> {
    let trims = trims.iter().filter(|t| t.asserted).filter_map(|t| {
        let [by, sd] = t.beside_mean?;
        let sign = if by < 0.0 { "−" } else { "+" };
        Some((
            t.flight.as_str(),
            format!("{} {sign}{} ± {}", t.name, figures(by.abs()), figures(INTERVAL * sd)),
        ))
    });
    let one = |(flight, all): (&str, String)| {
        format!(
            "{flight}: its trim differs from the mean of the flights, {all} (95 %; flight_trims)."
        )
    };
    by_flight(trims).into_iter().map(one).collect()
}

/// Joins the texts of consecutive entries of the same flight.
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

/// Notes on constants far outside their prior, in words.
pub fn notes(round: &Round) -> Vec<String> {
    let far = fitted(round).into_iter().filter(Fitted::is_implausible);
    far.map(|f| {
        format!(
            "{} of {} lies {:+.1} prior standard deviations from zero: the prior is too narrow, or something that acts \
             like it is missing. Nothing is asserted of this flight's trims and axes.",
            f.constant.name,
            f.flight,
            f.value / f.constant.width
        )
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_constant_astray_withdraws_the_others_of_its_flight() {
        let of = |flight: &str, value: f64| Fitted {
            flight: flight.into(),
            which: 0,
            constant: Constant { name: "CL0", width: 0.03 },
            value,
            sd: 0.001,
            beside_mean: None,
        };
        let all = [of("a", 0.08), of("b", 0.02), of("a", 0.02), of("b", -0.1), of("c", 0.0)];
        assert_eq!(astray(&all), HashSet::from(["b".to_owned()]));
    }
}
