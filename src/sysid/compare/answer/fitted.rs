//! What an answer says about the fit of a model: the advice after a fit in vain, and a small gain over a forecast without
//! aerodynamics.

use super::words::{number, percent};
use super::{Answer, Baseline, Numbers, words};

/// A fitted model that errs less than a forecast without aerodynamics by less than this, %, has a small gain. How far the error
/// fell from that of the model as given then says little.
const SMALL_GAIN: f64 = 50.0;
/// A gain below this, %, is none.
const NO_GAIN: f64 = 10.0;

/// Change from the error of the forecast to that of the fitted model as text, and the forecast; `None` unless the gain is small.
pub fn small_gain(n: &Numbers) -> Option<(String, &Baseline)> {
    let beside = n.beside_baseline_percent.filter(|p| *p > -SMALL_GAIN)?;
    Some((percent(beside), n.baseline.as_ref()?))
}

/// Sentence on a small gain over a forecast without aerodynamics, with a leading space; empty otherwise.
pub fn gain(n: &Numbers) -> String {
    let Some((change, Baseline { name, error })) = small_gain(n) else { return String::new() };
    let forecast = match n.better_baseline() {
        Some(_) => "that forecast".into(),
        None => format!("a forecast without aerodynamics ({name}, {})", number(*error)),
    };
    format!(" Relative to {forecast} the error changes by {change}.")
}

impl Answer {
    /// This answer, of a fit from scratch. It does not advise such a fit.
    pub fn from_scratch(self) -> Answer {
        let numbers = Numbers { from_scratch: true, ..self.numbers };
        Answer { error: words::error(&numbers), numbers, ..self }
    }

    /// Whether the fitted model hardly errs less than a forecast without aerodynamics, or more.
    pub fn gains_nothing(&self) -> bool {
        self.numbers.beside_baseline_percent.is_some_and(|p| p > -NO_GAIN)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compare::answer::{Seen, Stage, Subject, Way};
    use crate::compare::result::HorizonScore;

    /// The answer for a model with the error `given`, and `tuned` after the fit, beside a forecast with the error `straight`.
    fn answer(given: f64, tuned: f64, straight: f64) -> Answer {
        let at = |error| [HorizonScore::of_three(5.0, error)];
        let (given, tuned, straight) = (at(given), at(tuned), at(straight));
        let stage = |way, scores| Stage { way, model: "m", scores };
        Answer::of(&Subject {
            stages: vec![stage(Way::Given, &given[..]), stage(Way::Tuned, &tuned[..])],
            flights: vec!["a".into()],
            seen: Seen::Of(0),
            effects: Vec::new(),
            baseline: Some(("fly straight on", &straight[..])),
        })
    }

    #[test]
    fn a_small_gain_over_straight_flight_is_no_success() {
        let little = answer(0.752, 0.139, 0.142);
        let end = "(−82 %). Relative to that forecast the error changes by −2.1 %.";
        assert!(little.error.ends_with(end), "{}", little.error);
        let better = answer(0.14, 0.139, 0.142).error;
        let end = "Relative to a forecast without aerodynamics (fly straight on, 0.142) the error changes by −2.1 %.";
        assert!(better.ends_with(end), "{better}");
        let summary = "error at 5 s 0.752 → 0.139 (−82 %; −2.1 % relative to \"fly straight on\")";
        assert_eq!(little.summary(), summary);
        assert!(little.gains_nothing());
        let clear = answer(0.752, 0.02, 0.142);
        assert!(clear.error.ends_with("(−97 %)."), "{}", clear.error);
        assert!(!clear.summary().contains("straight") && !clear.gains_nothing());
    }

    #[test]
    fn a_fit_from_scratch_is_not_advised_again() {
        let first = answer(0.5, 0.4, 0.3);
        assert!(first.error.ends_with("or fit it from scratch."), "{}", first.error);
        let again = first.from_scratch();
        assert!(
            again.error.ends_with("logs, or fly more and richer manoeuvres."),
            "{}",
            again.error
        );
    }
}
