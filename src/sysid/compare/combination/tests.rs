//! Tests of the combination of forecasts.

use super::*;
use crate::amend::sample;
use crate::compare::free_run::START_EVERY_S;
use greylag_physics::State;

const SCALE: [f64; 8] = [1.0, 1.0, 15.0, 10.0, 10.0, 10.0, 1.0, 1.0];
const FREE: Choice = Choice { pooled: Pooled::Each, runs: 1e-9 };

/// Runs from random-like states whose measured states are `truth` of start, prediction and mean state.
fn flight(from: usize, truth: impl Fn(f64, f64, f64) -> f64) -> Forecasts {
    let state = |seed: f64| -> [f64; 8] {
        std::array::from_fn(|k| 0.3 * SCALE[k] * (seed * (1.7 + k as f64)).sin())
    };
    let mean_state = state(0.3);
    let run = |n: usize| {
        let start = state(1.0 + n as f64);
        let pair = |ahead: f64| {
            let predicted = state(50.0 + ahead + n as f64);
            [std::array::from_fn(|k| truth(start[k], predicted[k], mean_state[k])), predicted]
        };
        Ahead { from: start, pairs: vec![pair(0.0), pair(20.0)], unheld: vec![0.1; 2] }
    };
    let runs = (from..from + 20).map(run).collect();
    Forecasts { horizons_s: vec![1.0, 2.0], runs, second: None, scale: SCALE, mean_state }
}

#[test]
fn the_weights_of_a_truth_that_is_a_combination_are_found() {
    let truth = |from: f64, model: f64, mean: f64| 0.3 * from + 0.5 * model + 0.2 * mean;
    let parts = [flight(0, truth), flight(40, truth)];
    let chosen = choose(&parts).unwrap();
    let free = Combination::fit(&[&parts[0], &parts[1]], FREE);
    for [model, second, mean] in free.weights.iter().flatten() {
        assert!((model - 0.5).abs() < 1e-6 && (mean - 0.2).abs() < 1e-6, "{model} {mean}");
        assert_eq!(*second, 0.0);
    }
    assert!(free.scores(&parts[0])[1].rmse_scaled < 1e-6);
    // one run of equal weights against twenty leaves a small error
    assert!(chosen.error < 0.1 * chosen.alone, "{chosen:?}");
}

#[test]
fn weights_stay_between_nothing_and_one() {
    let opposite = |from: f64, model: f64, _: f64| from - 0.5 * (model - from);
    let beyond = |from: f64, model: f64, mean: f64| model + mean - from;
    for part in [flight(0, opposite), flight(0, beyond)] {
        for weights in Combination::fit(&[&part], FREE).weights.iter().flatten() {
            assert!(weights.iter().all(|w| *w >= 0.0), "{weights:?}");
            assert!(weights.iter().sum::<f64>() < 1.0 + 1e-9, "{weights:?}");
        }
    }
    let exact = Combination::fit(&[&flight(0, |_, model, _| model)], FREE);
    let weights = exact.weights.iter().flatten();
    assert!(weights.clone().all(|[model, _, mean]| *model > 1.0 - 1e-6 && *mean < 1e-6));
}

/// The flight of [`flight`] whose measured states are a combination of start, model, mean state and a second forecast, with the
/// weights 0.2, 0.4, 0.1 and 0.3; without and with the second forecast.
fn of_two(from: usize) -> [Forecasts; 2] {
    let mut first = flight(from, |from, model, mean| 0.5 * from + 0.4 * model + 0.1 * mean);
    let mut second = flight(from + 200, |from, _, _| from);
    for (a, b) in first.runs.iter_mut().zip(&mut second.runs) {
        b.from = a.from;
        for (own, other) in a.pairs.iter_mut().zip(&mut b.pairs) {
            let away = error(&a.from, &other[1]);
            own[0].iter_mut().zip(away).for_each(|(x, by)| *x += 0.3 * by);
            other[0] = own[0];
        }
    }
    let both = first.clone().beside(&second).unwrap();
    [first, both]
}

#[test]
fn a_second_forecast_has_a_weight_of_its_own() {
    let parts = [0, 40].map(of_two);
    let free = Combination::fit(&[&parts[0][1], &parts[1][1]], FREE);
    for weights in free.weights.iter().flatten() {
        for (found, truth) in weights.iter().zip([0.4, 0.3, 0.1]) {
            assert!((found - truth).abs() < 1e-6, "{weights:?}");
        }
    }
    let shorter = Forecasts { runs: Vec::new(), ..parts[0][0].clone() };
    assert!(parts[0][0].clone().beside(&shorter).is_none());
    let few = Forecasts { runs: Vec::new(), ..parts[0][1].clone() };
    assert_eq!(Combination::fit(&[&few], FREE).weights[0][0], [0.25; 3]);
}

#[test]
fn a_more_complex_forecast_must_be_clearly_better_and_must_not_diverge() {
    let parts = [0, 40].map(of_two);
    let [model, both] = [0, 1].map(|k| parts.clone().map(|part| part[k].clone()).to_vec());
    let held: Vec<Forecasts> = model.iter().map(Forecasts::held).collect();
    let place = |candidates: &[Vec<Forecasts>]| simplest(candidates).unwrap().0;
    let [h, m, b] = [&held, &model, &both].map(|parts: &Vec<Forecasts>| parts.clone());
    assert_eq!(place(&[h.clone(), m.clone(), b.clone()]), 2);
    assert_eq!(place(&[h.clone(), m.clone(), m.clone()]), 1, "the same again is no better");
    let mut wild = m.clone();
    wild[1].runs[3].unheld[1] = f64::NAN;
    assert_eq!(place(&[h.clone(), wild.clone()]), 0);
    wild[1].runs[3].unheld[1] = 1e3;
    assert_eq!(place(&[h.clone(), wild.clone()]), 0);
    assert!(error_alone(&wild).is_none() && error_alone(&m).is_some_and(f64::is_finite));
    // so does a second forecast
    let mut wild = b;
    wild[0].second.as_mut().unwrap()[0].unheld[0] = f64::INFINITY;
    assert_eq!(place(&[h, m, wild]), 1);
}

#[test]
fn with_few_runs_the_weights_are_equal() {
    let none = Forecasts { runs: Vec::new(), ..flight(0, |from, _, _| from) };
    assert_eq!(Combination::fit(&[&none], FREE), Combination::equal(2));
    assert!(choose(&[none.clone(), flight(0, |from, _, _| from)]).is_none());
    let shrunk = Choice { pooled: Pooled::All, runs: 1e9 };
    let part = flight(0, |_, model, _| model);
    let one = Combination::fit(&[&part], shrunk).weights[0][0];
    assert!([one[0], one[2]].iter().all(|w| (w - 1.0 / 3.0).abs() < 0.02), "{one:?}");
}

#[test]
fn the_mean_of_roll_angles_beside_a_half_turn_is_a_half_turn() {
    let instant = |k: usize| {
        let roll = if k.is_multiple_of(2) { 3.1 } else { -3.1 };
        sample::instant(0.01 * k as f64, State { roll, ..State::NEUTRAL })
    };
    let flight = sample::reconstruction("f", (0..200).map(instant).collect());
    let roll = mean_state([&Prepared::new(&flight, 5.0).unwrap()])[0];
    assert!((roll.abs() - std::f64::consts::PI).abs() < 1e-9, "{roll}");
}

#[test]
fn with_its_whole_weight_a_model_has_the_errors_of_its_free_runs() {
    let model = sample::model();
    let flight = Prepared::new(&sample::flight(&model, "f", 1200, 0.0), 8.0).unwrap();
    let mut other = model.clone();
    let clp = model.coefficients().iter().find(|c| c.name == "roll_linear.Clp").unwrap().value;
    assert!(other.set_coefficient("roll_linear.Clp", 1.3 * clp));
    let horizons_s = [1.0, 2.0, 5.0];
    let runs = Forecasts::of_model(&other, &flight, &horizons_s, START_EVERY_S, None, [0.0; 8]);
    let whole = Combination::whole(3);
    assert!(!runs.diverges());
    let (plain, _) = free_run::fly(&other, std::slice::from_ref(&flight), &horizons_s);
    for (score, horizon_s) in whole.scores(&runs).iter().zip(horizons_s) {
        let plain = plain.score(horizon_s);
        assert_eq!(score.runs, plain.runs);
        assert!(plain.rmse_scaled > 1e-4 && plain.diverged == 0, "{plain:?}");
        assert!((score.rmse_scaled / plain.rmse_scaled - 1.0).abs() < 1e-9, "{score:?} {plain:?}");
    }
}

#[test]
fn a_run_far_from_its_start_is_held_there() {
    let mut model = sample::model();
    let flight = Prepared::new(&sample::flight(&model, "f", 1200, 0.0), 8.0).unwrap();
    // an unstable roll: the rate grows without bound
    model.set_coefficient("roll_linear.Clp", 5.0);
    let runs = Forecasts::of_model(&model, &flight, &[5.0], START_EVERY_S, None, [0.0; 8]);
    assert!(!runs.runs.is_empty());
    for run in runs.runs.iter().filter(|run| !run.pairs.is_empty()) {
        let away = error(&run.from, &run.pairs[0][1]);
        let away = (0..8).map(|k| (away[k] / runs.scale[k]).powi(2)).sum::<f64>() / 8.0;
        assert!(away.is_finite() && away.sqrt() <= 1.0, "{run:?}");
    }
    assert!(runs.diverges() && !runs.held().diverges());
}
