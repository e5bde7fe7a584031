//! Tests of the selection of a structure.

use super::*;
use crate::amend::sample;
use crate::progress::ignore_progress;
use greylag_physics::State;

/// A flight of 3 s without motion.
fn short(name: &str) -> Reconstruction {
    let instant = |k: usize| sample::instant(0.01 * k as f64, State::NEUTRAL);
    sample::reconstruction(name, (0..301).map(instant).collect())
}

#[test]
fn the_model_as_given_is_not_chosen_where_no_fit_was_possible() {
    let model = sample::model();
    let flights = ["a", "b", "c"].map(short);
    let tuned = Fitted::Coefficients { effects: Vec::new(), per_flight: PerFlight::default() };
    let structures = [("given", Fitted::Nothing), ("tuned", tuned)]
        .map(|(name, fitted)| Structure { name: name.into(), fitted, effort: Effort::Complete });
    let why = leave_one_out(&model, &flights, &structures, &[1.0], &ignore_progress);
    // two flights of 3 s are shorter than the 10 s that a fit needs
    assert!(matches!(why, Err(AmendError::TooLittle { .. })), "{why:?}");
}

fn of(name: &str, free: usize, errors: &[f64]) -> Scored {
    let (fitted, effort) = (Fitted::Nothing, Effort::Complete);
    let structure = Structure { name: name.into(), fitted, effort };
    scored(&structure, free, errors.to_vec())
}

#[test]
fn the_simplest_within_one_standard_error_is_chosen() {
    let mut all = [
        of("given", 0, &[0.5, 0.6, 0.4]),
        of("tuned", 20, &[0.20, 0.31, 0.24]),
        of("more", 30, &[0.21, 0.28, 0.25]),
        of("failed", 5, &[0.1, f64::NAN, 0.1]),
    ];
    choose(&mut all);
    // mean errors 0.2500 and 0.2467: the mean difference of 0.003 has a standard error of 0.014
    assert_eq!(all.map(|s| s.chosen), [false, true, false, false]);
    // significantly better in each flight, although the errors differ much more between the flights than between the
    // structures
    let mut all = [of("tuned", 20, &[0.20, 0.30, 0.40]), of("more", 30, &[0.10, 0.21, 0.29])];
    choose(&mut all);
    assert_eq!(all.map(|s| s.chosen), [false, true]);
}

#[test]
fn a_screened_structure_is_fitted_if_it_may_be_the_best_and_is_not_chosen_without() {
    let screened = |name, errors: &[f64]| Scored { screened: true, ..of(name, 21, errors) };
    let mut all = [
        of("tuned", 20, &[0.20, 0.31, 0.24]),
        screened("best", &[0.10, 0.21, 0.14]),
        screened("worse", &[0.25, 0.36, 0.29]),
        screened("failed", &[f64::NAN, f64::NAN, f64::NAN]),
        screened("level", &[0.20, 0.31, 0.24]),
        screened("third", &[0.15, 0.30, 0.20]),
        screened("second", &[0.12, 0.25, 0.20]),
    ];
    // "level" is within one standard error too, but only three are fitted
    assert_eq!(promising(&all), [1, 6, 5]);
    choose(&mut all);
    assert_eq!(all.map(|s| s.chosen), [true, false, false, false, false, false, false]);
}

#[test]
fn alternatives_are_wider_priors_and_each_effect_that_the_model_lacks() {
    let model = sample::model();
    let lag = Added { id: "actuator_lag".into(), start: None };
    let all = alternatives(&model, &[lag], |factor| format!("× {factor}"), str::to_owned);
    let names: Vec<&str> = all.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(names[..2], ["× 3", "× 10"]);
    assert!(names.contains(&"motor_torque") && !names.contains(&"actuator_lag"), "{names:?}");
    assert!(!names.contains(&"roll_linear"), "the model has it: {names:?}");
    assert!(all.iter().all(Structure::is_screened));
}
