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
        .map(|(name, fitted)| Structure { name: name.into(), fitted });
    let why = leave_one_out(&model, &flights, &structures, &[1.0], &ignore_progress);
    // two flights of 3 s are shorter than the 10 s that a fit needs
    assert!(matches!(why, Err(AmendError::TooLittle { .. })), "{why:?}");
}

fn of(name: &str, free: usize, errors: &[f64]) -> Scored {
    let structure = Structure { name: name.into(), fitted: Fitted::Nothing };
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
