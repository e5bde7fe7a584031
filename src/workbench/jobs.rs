//! Jobs of the workbench: long computations in the background, with progress and cancellation.

use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use serde::Serialize;

use super::bench::{Bench, Inner};
use super::error::WorkbenchError;
use super::fly::Part;
use super::roles::Divided;
use greylag_report::write_over;
use greylag_sysid::amend::tune;
use greylag_sysid::diagnose::{Options, diagnose};
use greylag_sysid::progress::{FirstLook, Progress, Stage, part};

/// Name of the field of a stored diagnosis that lists the user's effect files it has tried.
pub(super) const TRIED: &str = "tried";

/// The kind of a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Work {
    /// Diagnosis: which effects (groups of model terms) does the model lack?
    Diagnosis,
    /// Fit of the model with the accepted effects, and with the next one that the diagnosis asserts.
    Fit,
    /// Search for a formula for the residual that no effect explains.
    Proposal,
    /// Design of a flight schedule that distinguishes two effects.
    Schedule,
}

/// A job as the page in the browser shows it.
#[derive(Clone, Debug, Serialize)]
pub struct Job {
    /// Id of the job.
    pub id: u64,
    /// The kind of the job.
    pub work: Work,
    /// Key computed from the inputs of the job. No second job with the same key is started while this one runs.
    #[serde(skip)]
    pub key: String,
    /// Current stage of the job.
    pub doing: String,
    /// Fraction of the work done, 0 to 1.
    pub fraction: f64,
    /// Present ranking of the candidate effects in a diagnosis; otherwise empty.
    pub ranking: Vec<FirstLook>,
    #[serde(skip)]
    pub(super) stop: Stop,
}

/// A request to cancel a job or a flight. The computation stops at its next stage.
#[derive(Clone, Debug, Default)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    /// Requests the cancellation of the computation.
    pub fn stop(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// `Break` if the cancellation was requested, otherwise `Continue`.
    pub fn answer(&self) -> ControlFlow<()> {
        match self.0.load(Ordering::Relaxed) {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    }
}

/// An event that is sent to all connected pages.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Event {
    /// A job has made progress.
    Progress {
        /// The job in its present state.
        job: Job,
    },
    /// A flight has new points.
    Flight {
        /// The new part of the flight.
        part: Part,
    },
    /// The session (model, logs, accepted effects) or its results have changed. A page must read the state again.
    Changed {
        /// Present revision of the session.
        revision: u64,
    },
}

impl Inner {
    /// Removes all jobs of the kind `work` from the list and requests their cancellation.
    pub(super) fn supersede(&mut self, work: Work) {
        self.jobs.iter().filter(|job| job.work == work).for_each(|job| job.stop.stop());
        self.jobs.retain(|job| job.work != work);
    }

    /// Whether all fits of [`Inner::stacks`] exist.
    fn fitted(&self) -> bool {
        self.stacks().iter().all(|effects| self.fits.contains_key(&self.key("fit", effects)))
    }
}

/// Runs `work` and returns its result. A panic becomes an error, because otherwise the job would appear to run forever.
fn outcome(work: impl FnOnce() -> Result<(), WorkbenchError>) -> Result<(), WorkbenchError> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| {
        let said = panic.downcast_ref::<&str>().map(ToString::to_string);
        let said = said.or_else(|| panic.downcast_ref::<String>().cloned());
        Err(WorkbenchError::Fault(said.unwrap_or_else(|| "a panic without a word".into())))
    })
}

impl Bench {
    /// Notifies the pages that results have changed.
    pub(super) fn changed(&self) {
        (self.on_event)(Event::Changed { revision: self.revision() });
    }

    /// Starts a job of the kind `work`. Does nothing if a job with the same key is running, or if all fits exist already.
    pub(super) fn start(self: &Arc<Self>, work: Work) {
        let (id, stop) = {
            let mut inner = self.lock();
            let effects = if work == Work::Fit { &inner.session.effects[..] } else { &[] };
            let mut key = inner.key(work.word(), effects);
            if let (Work::Schedule, Some(between)) = (work, &inner.between) {
                key += &between.join("-");
            }
            let there = work == Work::Fit && inner.fitted();
            if there || inner.jobs.iter().any(|job| job.key == key) {
                return;
            }
            inner.supersede(work);
            inner.failures.remove(&key);
            let (id, stop) = (inner.next_job, Stop::default());
            inner.next_job += 1;
            let doing = "waiting".into();
            inner.jobs.push(Job {
                id,
                work,
                key,
                doing,
                fraction: 0.0,
                ranking: Vec::new(),
                stop: stop.clone(),
            });
            (id, stop)
        };
        self.changed();
        let bench = self.clone();
        std::thread::spawn(move || bench.work(id, work, &stop));
    }

    /// Removes the job `id` from the list and requests its cancellation.
    pub(super) fn cancel(&self, id: u64) {
        let mut inner = self.lock();
        inner.jobs.iter().filter(|job| job.id == id).for_each(|job| job.stop.stop());
        inner.jobs.retain(|job| job.id != id);
        drop(inner);
        self.changed();
    }

    fn work(self: &Arc<Self>, id: u64, work: Work, stop: &Stop) {
        let progress = |stage: Stage<'_>| {
            self.further(id, stage);
            stop.answer()
        };
        let outcome = outcome(|| match work {
            Work::Diagnosis => self.diagnose(&progress),
            Work::Fit => self.fit(&progress),
            Work::Proposal => self.propose(&progress),
            Work::Schedule => self.design(&progress),
        });
        let mut inner = self.lock();
        let job = inner.jobs.iter().position(|job| job.id == id).map(|k| inner.jobs.remove(k));
        let diagnosed = work == Work::Diagnosis && job.is_some() && outcome.is_ok();
        if let (Some(job), Err(error)) = (job, outcome)
            && stop.answer().is_continue()
        {
            inner.failures.insert(job.key, error.to_string());
        }
        drop(inner);
        self.changed();
        if diagnosed {
            // the fit with the first asserted effect follows on its own, so that it does not delay the diagnosis
            self.start(Work::Fit);
        }
    }

    /// Records the progress of a job and sends it to the pages.
    fn further(&self, id: u64, stage: Stage<'_>) {
        let mut inner = self.lock();
        let Some(job) = inner.jobs.iter_mut().find(|job| job.id == id) else { return };
        job.doing = stage.doing.to_owned();
        job.fraction = stage.fraction.max(job.fraction);
        if !stage.ranking.is_empty() {
            job.ranking = stage.ranking.to_vec();
        }
        let job = job.clone();
        drop(inner);
        (self.on_event)(Event::Progress { job });
    }

    /// Diagnoses the given model with the flights that have the role Fit. Then fits its coefficients, as a start for later fits.
    fn diagnose(&self, progress: &Progress) -> Result<(), WorkbenchError> {
        let ([key, tuned_key], model, flights, divided, said, with, tried) = {
            let inner = self.lock();
            let keys = [Work::Diagnosis.word(), "tuned"].map(|what| inner.key(what, &[]));
            (
                keys,
                inner.model.clone(),
                inner.to_fit()?,
                inner.divided(),
                inner.said_of_installation(),
                inner.session.own.clone(),
                inner.tried(),
            )
        };
        let mut diagnosis =
            diagnose(&model, &flights, &Options { with, ..Options::default() }, progress)?;
        diagnosis.notes.splice(0..0, said);
        let mut value = serde_json::to_value(&diagnosis)?;
        value[TRIED] = tried;
        write_over(&self.result_file(&key), value.to_string())?;
        self.lock().diagnosis = Some((key, Arc::new(value)));
        self.changed();
        let there = self.lock().tuned.as_ref().is_some_and(|(of, _)| *of == tuned_key);
        // errors of the fit are not reported here: they occur again, and are shown, when the user accepts an effect
        if let (false, Ok(Divided { fit, .. })) = (there, divided)
            && let Ok(tuned) = tune(&model, &fit, &part(progress, [0.95, 1.0]))
        {
            self.keep_tuned(tuned_key, tuned);
        }
        Ok(())
    }
}

impl Work {
    /// Prefix of the keys of this kind of result.
    pub(super) fn word(self) -> &'static str {
        match self {
            Work::Diagnosis => "diagnosis",
            Work::Fit => "fit",
            Work::Proposal => "proposal",
            Work::Schedule => "schedule",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_job_that_panics_ends_with_an_error() {
        let said =
            |work: fn() -> Result<(), WorkbenchError>| outcome(work).unwrap_err().to_string();
        assert!(said(|| panic!("no such row")).contains("report it: no such row"));
        assert!(said(|| panic!("no row {}", 7)).contains("no row 7"));
        assert!(outcome(|| Ok(())).is_ok());
    }
}
