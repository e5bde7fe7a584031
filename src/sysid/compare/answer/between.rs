//! Summary of a comparison of models. It states the error of the first model in free runs (simulations from recorded states), and
//! the errors of the other models relative to it.

use super::{Answer, Seen, Stage, Subject, Way};
use crate::compare::forecast::{ForecastResult, best};
use crate::compare::result::ModelResult;
use crate::weak_form::prepared::Prepared;

/// The summary of a comparison of `models` on `flights`. The baseline is the forecast of `forecasts` with the smallest error.
/// Forecasts use no aerodynamics.
pub fn between(
    models: &[ModelResult],
    flights: &[Prepared],
    forecasts: &[ForecastResult],
) -> Answer {
    let stages = models.iter().enumerate().map(|(k, model)| Stage {
        way: if k == 0 { Way::Given } else { Way::Other },
        model: &model.name,
        scores: &model.free_run,
    });
    Answer::of(&Subject {
        stages: stages.collect(),
        flights: flights.iter().map(|f| f.name.clone()).collect(),
        seen: Seen::Unknown,
        effects: Vec::new(),
        baseline: best(forecasts).map(|f| (f.name, &f.free_run[..])),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compare::result::HorizonScore;

    #[test]
    fn horizons_beyond_that_of_the_answer_have_a_best_forecast_too() {
        let at = HorizonScore::of_three;
        let model = ModelResult {
            name: "m".into(),
            sentences: Vec::new(),
            free_run: vec![at(10.0, 0.02), at(20.0, 0.05)],
            known: None,
            growth: Vec::new(),
            channels: Vec::new(),
            traces: Vec::new(),
        };
        let forecast =
            |name, error| ForecastResult { name, free_run: vec![at(10.0, error), at(20.0, error)] };
        let all = [forecast("hold", 0.3), forecast("straight", 0.1)];
        let best = between(&[model], &[], &all).numbers.baseline.unwrap();
        assert_eq!((best.name.as_str(), best.error), ("straight", 0.1));
    }
}
