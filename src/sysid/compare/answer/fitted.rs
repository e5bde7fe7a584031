//! What an answer says about the fit of a model: the advice after a fit in vain.

use super::{Answer, Numbers, words};

impl Answer {
    /// This answer, of a fit from scratch. It does not advise such a fit.
    pub fn from_scratch(self) -> Answer {
        let numbers = Numbers { from_scratch: true, ..self.numbers };
        Answer { error: words::error(&numbers), numbers, ..self }
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
