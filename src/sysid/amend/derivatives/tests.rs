//! The derivatives beside finite differences of whole residuals.

use super::*;
use crate::amend::sample;
use crate::flight_path::reconstruction::Reconstruction;
use greylag_logs::Sampling;

/// A flight of 3 s of `model` with sinusoidal deflections.
fn flown(model: &GreyBox, sampling: Sampling) -> Flight {
    let flight = sample::flight(model, "a", 301, 0.0);
    Flight::new(&Reconstruction { sampling, ..flight }, 8.0).unwrap()
}

/// Residuals of the second of two shots, after the unknown with number `column` was increased by `by`.
fn moved(
    (base, free): (&GreyBox, &[Free]),
    flights: &[&Flight],
    shot: &Shot,
    place: &Place,
    asked: &PerFlight,
    (column, by): (usize, f64),
) -> Vec<[f64; 8]> {
    let mut place = place.clone();
    let starts = free.len() + SENSORS + asked.constants().len();
    let mut step = vec![0.0; starts - free.len()];
    match column {
        k if k < free.len() => place.theta[k] += by,
        k if k < starts => step[k - free.len()] = by,
        k => place.starts[1][k - starts] += by,
    }
    place.own[0].step(asked, &step);
    let model = parameters::with(base, free, &place.theta);
    let acting = normal::acting(&model, flights, &place);
    normal::run(&model, &acting, flights, shot, &place.own[0], &place.starts[1])
}

#[test]
fn all_columns_agree_with_finite_differences() {
    let model = sample::model();
    let asked = PerFlight { trims: Some(1.0), askew_deg: Some(3.0), ..PerFlight::default() };
    let base = crate::per_flight::trims::joined(&model).unwrap();
    let free = parameters::free(&model, &[]);
    for sampling in [Sampling::Held, Sampling::Instants] {
        let flight = flown(&model, sampling);
        let flights = [&flight];
        let shots = shooting::cut(&flights, 1.0);
        let theta = free.iter().map(|f| 1.02 * f.prior).collect();
        let mut own = Own::of([1e-3; SENSORS]);
        (own.askew, own.trims[4]) = ([0.01, -0.01, 0.005], 1e-3);
        let place = Place { theta, own: vec![own], starts: vec![[1e-4; 8]; shots.len()] };
        let around = Neighbourhood::new(&base, &free, &flights, &place, asked);
        let of = |column: usize, by: f64| {
            let fit = (&base, free.as_slice());
            moved(fit, &flights, &shots[1], &place, &asked, (column, by))
        };
        let here = of(0, 0.0);
        let found = derivatives(&around, &flights, (1, &shots[1]), &place, &here);
        let steps = shots[1].steps;
        for column in 0..found.rows.ncols() {
            let largest = |most: f64, x: &f64| most.max(x.abs());
            let size = found.rows.column(column).iter().fold(0.0, largest);
            let step = 1e-5 / size.max(1e-3);
            let (low, high) = (of(column, -step), of(column, step));
            for (row, x) in found.rows.column(column).iter().enumerate() {
                let slope =
                    (high[row % steps][row / steps] - low[row % steps][row / steps]) / (2.0 * step);
                let error = (x - slope).abs();
                assert!(error < 0.02 * size + 1e-6, "{sampling:?} {column} {row}: {x} {slope}");
            }
        }
        let last = found.rows.ncols() - 1;
        let total: f64 = found.grams.iter().map(|gram| gram[(last, last)]).sum();
        assert!((total / found.rows.column(last).norm_squared() - 1.0).abs() < 1e-10);
    }
}
