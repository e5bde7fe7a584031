//! How far a long task has come, and whether it shall go on.

use std::ops::ControlFlow;

/// What a long task is doing.
#[derive(Clone, Copy, Debug)]
pub struct Stage<'a> {
    /// What is being done, in words.
    pub doing: &'a str,
    /// Share of the whole task that is done, 0 to 1; it never falls.
    pub fraction: f64,
    /// The candidates of a diagnosis as ranked so far, the best first; empty before that and elsewhere.
    pub ranking: &'a [FirstLook],
}

impl<'a> Stage<'a> {
    /// A stage that ranks nothing.
    pub fn new(doing: &'a str, fraction: f64) -> Stage<'a> {
        Stage { doing, fraction, ranking: &[] }
    }
}

/// A candidate effect as the first ranking has it, before anything has settled.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct FirstLook {
    /// Its id.
    pub id: &'static str,
    /// Evidence for it: the smaller of the penalised gain in likelihood and the Wald statistic, no unit.
    pub evidence: f64,
    /// Evidence that the best candidate reaches by chance where nothing is missing.
    pub threshold: f64,
}

/// Hears the stages of a long task; `Break` ends it at the next one.
pub type Progress<'a> = dyn Fn(Stage<'_>) -> ControlFlow<()> + Sync + 'a;

/// Hears nothing, and lets the task go on.
pub fn unheard(_: Stage<'_>) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// A long task that was ended by whoever listened to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("cancelled")]
pub struct Cancelled;

/// Says a stage; an error if the task shall end.
pub fn say(progress: &Progress, doing: &str, fraction: f64) -> Result<(), Cancelled> {
    said(progress(Stage::new(doing, fraction)))
}

/// An error for a `Break`.
pub fn said(answer: ControlFlow<()>) -> Result<(), Cancelled> {
    match answer {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(Cancelled),
    }
}

/// Hears the stages of a part of a task as stages of the whole, from one share of it to another.
pub fn part<'a>(
    progress: &'a Progress<'a>,
    [from, to]: [f64; 2],
) -> impl Fn(Stage<'_>) -> ControlFlow<()> + Sync + 'a {
    move |stage| progress(Stage { fraction: from + (to - from) * stage.fraction, ..stage })
}
