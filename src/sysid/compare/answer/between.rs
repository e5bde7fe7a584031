//! Answer of a comparison: free-run error of the first model, and of each other model relative to the first.

use super::{ANSWER_S, Answer, Seen, Stage, Subject, Way};
use crate::compare::forecast::ForecastResult;
use crate::compare::result::ModelResult;
use crate::weak_form::prepared::Prepared;

/// The answer about `models` over `flights`. The best forecast without aerodynamics is the baseline.
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
    // error at the longest horizon up to ANSWER_S that a run reaches
    let error = |f: &ForecastResult| {
        let reached = f.free_run.iter().filter(|s| s.runs > 0 && s.horizon_s <= ANSWER_S);
        let last = reached.max_by(|a, b| a.horizon_s.total_cmp(&b.horizon_s));
        last.map_or(f64::INFINITY, |s| s.rmse_scaled)
    };
    let best = forecasts.iter().min_by(|a, b| error(a).total_cmp(&error(b)));
    Answer::of(&Subject {
        stages: stages.collect(),
        flights: flights.iter().map(|f| f.name.clone()).collect(),
        seen: Seen::Unknown,
        effects: Vec::new(),
        baseline: best.map(|f| (f.name, &f.free_run[..])),
    })
}
