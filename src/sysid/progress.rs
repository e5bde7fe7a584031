//! Progress reports of a long task, and cancellation by their listener.

use std::ops::ControlFlow;

/// A stage of a long task.
#[derive(Clone, Copy, Debug)]
pub struct Stage<'a> {
    /// Current activity, in words for the user.
    pub doing: &'a str,
    /// Estimated share of the whole task that is done, 0 to 1. It may fall, for example when a search removes an
    /// effect.
    pub fraction: f64,
    /// Candidates of a diagnosis in the current ranking, the best first. Empty before the ranking and in other tasks.
    pub ranking: &'a [FirstLook],
}

impl<'a> Stage<'a> {
    /// A stage without a ranking.
    pub fn new(doing: &'a str, fraction: f64) -> Stage<'a> {
        Stage { doing, fraction, ranking: &[] }
    }
}

/// A candidate effect in the first ranking, before tuning.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct FirstLook {
    /// Identifier of the effect.
    pub id: &'static str,
    /// Evidence for the effect: the smaller of the penalised gain in likelihood and the Wald statistic, dimensionless.
    pub evidence: f64,
    /// Evidence that the best candidate reaches by chance if no effect is missing, dimensionless.
    pub threshold: f64,
}

/// Listener to the stages of a long task; `Break` cancels the task at the next stage.
pub type Progress<'a> = dyn Fn(Stage<'_>) -> ControlFlow<()> + Sync + 'a;

/// Discards progress and never cancels.
pub fn ignore_progress(_: Stage<'_>) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// Error of a task that its progress listener cancelled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("cancelled")]
pub struct Cancelled;

/// Reports a stage.
///
/// # Errors
/// [`Cancelled`] if the listener answered `Break`.
pub fn report(progress: &Progress, doing: &str, fraction: f64) -> Result<(), Cancelled> {
    not_cancelled(progress(Stage::new(doing, fraction)))
}

/// Converts a listener's answer: `Break` to [`Cancelled`].
pub fn not_cancelled(answer: ControlFlow<()>) -> Result<(), Cancelled> {
    match answer {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(Cancelled),
    }
}

/// Listener for a part of a task: maps the fractions 0 to 1 of the part to the range `from` to `to` of the whole task.
pub fn part<'a>(
    progress: &'a Progress<'a>,
    [from, to]: [f64; 2],
) -> impl Fn(Stage<'_>) -> ControlFlow<()> + Sync + 'a {
    move |stage| progress(Stage { fraction: from + (to - from) * stage.fraction, ..stage })
}
