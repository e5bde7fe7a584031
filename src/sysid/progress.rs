//! Progress reports of a long task to a listener. The listener can cancel the task.

use std::ops::ControlFlow;

/// A stage of a long task.
#[derive(Clone, Copy, Debug)]
pub struct Stage<'a> {
    /// Current activity, in words for the user.
    pub doing: &'a str,
    /// Estimated share of the whole task that is done, 0 to 1. It may fall, for example when a search repeats a step.
    pub fraction: f64,
    /// Candidates of a diagnosis (effects that the model may lack), best first. It is empty in all stages but that after the
    /// first ranking.
    pub ranking: &'a [FirstLook],
}

impl<'a> Stage<'a> {
    /// A stage without a ranking.
    pub fn new(doing: &'a str, fraction: f64) -> Stage<'a> {
        Stage { doing, fraction, ranking: &[] }
    }
}

/// A candidate effect in the first ranking, before any effect has been added to the model.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct FirstLook {
    /// Identifier of the effect.
    pub id: &'static str,
    /// Evidence for the effect, dimensionless: the smaller of the penalised likelihood gain (as in the BIC) and the
    /// Wald statistic.
    pub evidence: f64,
    /// Critical value of the evidence, dimensionless. If no effect is missing, the best candidate exceeds it with the
    /// probability of the significance level.
    pub threshold: f64,
}

/// Function that a long task calls at each stage. If it returns `Break`, the task is cancelled.
pub type Progress<'a> = dyn Fn(Stage<'_>) -> ControlFlow<()> + Sync + 'a;

/// Ignores the stage and never cancels the task.
pub fn ignore_progress(_: Stage<'_>) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// Error of a task that its progress listener cancelled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("cancelled")]
pub struct Cancelled;

/// Reports a stage without a ranking. `doing` is the current activity in words, `fraction` the share of the task that
/// is done, 0 to 1.
///
/// # Errors
/// [`Cancelled`] if the listener answered `Break`.
pub fn report(progress: &Progress, doing: &str, fraction: f64) -> Result<(), Cancelled> {
    not_cancelled(progress(Stage::new(doing, fraction)))
}

/// Converts a listener's answer to a result. `Break` becomes the error [`Cancelled`].
pub fn not_cancelled(answer: ControlFlow<()>) -> Result<(), Cancelled> {
    match answer {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(Cancelled),
    }
}

/// Returns a listener for a part of a task. It maps the fractions 0 to 1 of this part to the range `from` to `to` of
/// the whole task and forwards the stages to `progress`.
pub fn part<'a>(
    progress: &'a Progress<'a>,
    [from, to]: [f64; 2],
) -> impl Fn(Stage<'_>) -> ControlFlow<()> + Sync + 'a {
    move |stage| progress(Stage { fraction: from + (to - from) * stage.fraction, ..stage })
}
