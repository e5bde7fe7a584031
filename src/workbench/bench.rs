//! The workbench's session in memory, with the results computed from it. A session is a folder with a model, flight logs and
//! accepted effects. Pages in the browser show the session and edit it.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use serde_json::Value;

use super::error::{WorkbenchError, io};
use super::fit::Fitted;
use super::flights::Loaded;
use super::fly::Flying;
use super::jobs::{Event, Job, Work};
use super::key::fingerprint;
use super::proposal::Designed;
use super::reading::{InUse, Reading};
use super::session::{Claim, LogEntry, Outcome, Role, Session};
use super::tuned::Way;
use greylag_logs as logs;
use greylag_model::GreyBox;
use greylag_sysid::amend::document::{Original, sha256};
use greylag_sysid::amend::{Estimate, Fit};
use greylag_sysid::compare::{self, Comparison, compare};
use greylag_sysid::progress::ignore_progress;

/// Options for opening a workbench.
pub struct Given {
    /// Folder of the session; created if it does not exist.
    pub folder: PathBuf,
    /// Path of the model file; required for a new session.
    pub model: Option<PathBuf>,
    /// Logs to add. A log that the session already contains is skipped. A file that is not a usable log is added as an unused
    /// flight, with its error.
    pub logs: Vec<PathBuf>,
    /// Options for reading logs.
    pub reading: Reading,
    /// Simulates the failsafe scenarios of the page `failsafes`.
    #[cfg(feature = "sitl")]
    pub failsafes: super::failsafe::Failsafes,
}

/// A session with the results computed from it.
///
/// It is shared as an `Arc`, may be called from any thread and has no network access. Its methods are of four kinds:
///
/// - [`Bench::open`] reads or creates the session of a folder and claims the folder until the value is dropped.
/// - Requests are [`Bench::act`] and [`Bench::take`] (which adds a log). Each contains the revision of the session on which it
///   is based. If this revision is outdated, a request that edits the session fails with [`WorkbenchError::Conflict`]. Otherwise
///   the edit is on disk when the call returns. `Diagnose`, `Fit`, `Propose`, `Design`, `Save`, `Cancel` and `StopFlight` are
///   accepted at any revision.
/// - Views do not change the session: [`Bench::state`], [`Bench::diagnosis`], [`Bench::failing`], [`Bench::flight`],
///   [`Bench::free_run`] and others. `failing` and `flight` block while they compute a comparison that is not cached. `flight`
///   and `free_run` refuse test flights that have not been opened.
/// - Events go to the callback of [`Bench::open`], on the thread that causes them. The callback may call the bench.
///
/// After `open`, requests and views may be called in any order. Each job runs on a thread of its own. A new job replaces a
/// running job of the same kind, which then ends at its next stage, as if it was cancelled. Each result is stored under a key
/// that is computed from its inputs. If an edit is undone, the earlier result is therefore found again. The system clock is used
/// only for time stamps in the session.
pub struct Bench {
    pub(super) folder: PathBuf,
    pub(super) on_event: Box<dyn Fn(Event) + Send + Sync>,
    inner: Mutex<Inner>,
    /// Held while a log is added, because two concurrent calls must not select the same file name.
    pub(super) taking: Mutex<()>,
    #[cfg(feature = "sitl")]
    pub(super) failsafes: super::failsafe::Failsafes,
    _claim: Claim,
}

/// State behind the lock of a [`Bench`].
pub(super) struct Inner {
    pub folder: PathBuf,
    pub session: Session,
    pub model: GreyBox,
    pub original: Original,
    /// The session's logs, in order; `Err` with the reason for a log that cannot be used.
    pub flights: Vec<Result<Arc<Loaded>, String>>,
    pub comparison: Option<(String, Arc<Comparison>)>,
    pub tuned: Option<(String, Fit)>,
    pub diagnosis: Option<(String, Arc<Value>)>,
    /// Key and result of the search for a formula.
    pub proposal: Option<(String, Arc<Value>)>,
    /// The two effects that the next flight-test schedule is to distinguish.
    pub between: Option<[String; 2]>,
    /// Schedules that were designed in this session.
    pub designed: Vec<Designed>,
    /// The present flight, or the last one if none is in progress.
    pub flying: Option<Flying>,
    pub estimate: Option<(String, Estimate)>,
    pub fits: BTreeMap<String, Arc<Fitted>>,
    /// Errors of failed jobs, by the key of the job's result.
    pub failures: BTreeMap<String, String>,
    pub jobs: Vec<Job>,
    pub next_job: u64,
    /// Command-line options for reading logs.
    pub given: Reading,
    /// The same options in the form of [`greylag_logs`].
    pub options: logs::Options,
    pub mapping: InUse,
}

impl Bench {
    /// Opens the session of a folder, or creates one. `on_event` is called for every event, on the thread that causes the event.
    ///
    /// # Errors
    /// If the folder is locked, a file is invalid or cannot be read or written, or a new session has no model.
    pub fn open(
        given: Given,
        on_event: impl Fn(Event) + Send + Sync + 'static,
    ) -> Result<Arc<Bench>, WorkbenchError> {
        let claim = Claim::of(&given.folder)?;
        let folder = fs::canonicalize(&given.folder).map_err(|e| io(&given.folder, e))?;
        let (session, model, original) = begin(&folder, given.model.as_deref())?;
        let mut inner = Inner {
            folder: folder.clone(),
            session,
            model,
            original,
            flights: Vec::new(),
            comparison: None,
            tuned: None,
            diagnosis: None,
            proposal: None,
            between: None,
            designed: Vec::new(),
            flying: None,
            estimate: None,
            fits: BTreeMap::new(),
            failures: BTreeMap::new(),
            jobs: Vec::new(),
            next_job: 1,
            options: Inner::options_of(&given.reading),
            given: given.reading.absolute()?,
            mapping: InUse::default(),
        };
        inner.take_mapping()?;
        inner.read_own()?;
        inner.read_designed();
        // an earlier process may have ended during a flight
        let cut = inner.session.flown.iter_mut().filter(|f| f.outcome == Outcome::Flying);
        cut.for_each(|flown| flown.outcome = Outcome::CutOff);
        inner.reread();
        inner.session.write(&folder)?;
        let bench = Arc::new(Bench {
            folder,
            on_event: Box::new(on_event),
            inner: Mutex::new(inner),
            taking: Mutex::new(()),
            #[cfg(feature = "sitl")]
            failsafes: given.failsafes,
            _claim: claim,
        });
        for log in &given.logs {
            bench.add_file(log)?;
        }
        bench.lock().recall();
        Ok(bench)
    }

    pub(super) fn lock(&self) -> MutexGuard<'_, Inner> {
        // the state is consistent even after a job's panic, because each job changes it in single steps
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Present revision of the session, which every change increments.
    pub fn revision(&self) -> u64 {
        self.lock().session.revision
    }

    /// Applies `edit` if the session is at revision `seen`, and writes the session. If the edit or the writing fails, the state
    /// before is restored.
    pub(super) fn change<T>(
        &self,
        seen: u64,
        edit: impl FnOnce(&mut Inner) -> Result<T, WorkbenchError>,
    ) -> Result<T, WorkbenchError> {
        let mut inner = self.lock();
        let now = inner.session.revision;
        if now != seen {
            return Err(WorkbenchError::Conflict { now, seen });
        }
        let before = Before::of(&inner);
        let edited = edit(&mut inner).inspect(|_| inner.share_installation());
        inner.session.revision += 1;
        let revision = inner.session.revision;
        match edited.and_then(|t| inner.session.write(&self.folder).map(|()| t)) {
            Ok(t) => {
                inner.recall();
                drop(inner);
                (self.on_event)(Event::Changed { revision });
                Ok(t)
            }
            Err(error) => {
                before.back_to(&mut inner);
                Err(error)
            }
        }
    }

    /// Applies `edit` at any revision, for changes that no page requests, and writes the session.
    pub(super) fn amend_session(
        &self,
        edit: impl FnOnce(&mut Inner),
    ) -> Result<(), WorkbenchError> {
        let mut inner = self.lock();
        edit(&mut inner);
        inner.session.revision += 1;
        let revision = inner.session.revision;
        let written = inner.session.write(&self.folder);
        drop(inner);
        (self.on_event)(Event::Changed { revision });
        written
    }

    /// Adds the log at `path` with the content `bytes`. If `role` is `None`, the log gets the role of [`Session::usual_role`].
    pub(super) fn add(
        &self,
        seen: u64,
        path: PathBuf,
        bytes: &[u8],
        role: Option<Role>,
    ) -> Result<(), WorkbenchError> {
        let sha256 = sha256(bytes);
        let entry = LogEntry { path, sha256, role: Role::Unused };
        let name = entry.name();
        let (model, options) = {
            let inner = self.lock();
            let same = inner.session.logs.iter().find(|l| l.sha256 == entry.sha256);
            if let Some(same) = same {
                return Err(WorkbenchError::Twice(same.name()));
            }
            (inner.model.clone(), inner.options.clone())
        };
        let loaded = Loaded::parse(bytes, &name, &options, &model)?;
        self.change(seen, |inner| {
            inner.take_in(entry, role, loaded);
            Ok(())
        })
    }

    /// Compares the given, tuned and amended models, as far as they exist, with the fit and hold-out flights. The result is
    /// cached by key.
    pub(super) fn comparison(&self) -> Result<(Vec<Way>, Arc<Comparison>), WorkbenchError> {
        let (key, ways, models, flights) = {
            let inner = self.lock();
            let (shown, (ways, models)) = (inner.shown(), inner.ways());
            // accepted effects do not change the comparison before a model with them is fitted or estimated
            let effects = if shown == "given" { &[] } else { &inner.session.effects[..] };
            let clock = inner.clock();
            let key = format!("{}{shown}{ways:?}{clock:?}", inner.key("comparison", effects));
            if let Some((_, known)) = inner.comparison.as_ref().filter(|(k, _)| *k == key) {
                return Ok((ways, known.clone()));
            }
            (key, ways, models, inner.flights_on(clock, &inner.seen()))
        };
        let made = compare(&models, &flights, &compare::Options::default(), &ignore_progress)?;
        let made = Arc::new(made);
        self.lock().comparison = Some((key, made.clone()));
        Ok((ways, made))
    }

    pub(super) fn result_file(&self, key: &str) -> PathBuf {
        result_file(&self.folder, key)
    }

    pub(super) fn fit_folder(&self, key: &str) -> PathBuf {
        self.folder.join("fits").join(key)
    }

    /// Fails with [`WorkbenchError::ModelChanged`] if the model file has changed since it was read.
    pub(super) fn same_model(&self) -> Result<(), WorkbenchError> {
        let inner = self.lock();
        match inner.model_changed() {
            false => Ok(()),
            true => Err(WorkbenchError::ModelChanged { path: inner.session.model.clone() }),
        }
    }
}

/// State to which a failed change is rolled back.
struct Before {
    session: Session,
    model: GreyBox,
    original: Original,
    flights: Vec<Result<Arc<Loaded>, String>>,
    options: logs::Options,
    mapping: InUse,
}

impl Before {
    fn of(inner: &Inner) -> Before {
        Before {
            session: inner.session.clone(),
            model: inner.model.clone(),
            original: inner.original.clone(),
            flights: inner.flights.clone(),
            options: inner.options.clone(),
            mapping: inner.mapping.clone(),
        }
    }

    fn back_to(self, inner: &mut Inner) {
        let Before { session, model, original, flights, options, mapping } = self;
        (inner.session, inner.model, inner.original) = (session, model, original);
        (inner.flights, inner.options, inner.mapping) = (flights, options, mapping);
    }
}

/// Reads or creates the session and reads its model. The model file may have changed since the session was last open.
fn begin(
    folder: &Path,
    model: Option<&Path>,
) -> Result<(Session, GreyBox, Original), WorkbenchError> {
    let known = Session::read(folder)?;
    let given = model.map(|m| fs::canonicalize(m).map_err(|e| io(m, e))).transpose()?;
    let path = match (&known, given) {
        (Some(session), Some(given)) if given != session.model => {
            let model = session.model.clone();
            return Err(WorkbenchError::OtherModel { folder: folder.into(), model });
        }
        (Some(session), _) => session.model.clone(),
        (None, Some(given)) => given,
        (None, None) => return Err(WorkbenchError::NoModel),
    };
    let read = load(&path)?;
    let mut session = known.unwrap_or_else(|| Session::new(path, read.fingerprint.clone()));
    session.model_sha256 = read.fingerprint;
    Ok((session, read.model, read.original))
}

/// A model, the contents of its files, and their fingerprint.
pub(super) struct Read {
    pub model: GreyBox,
    pub original: Original,
    pub fingerprint: String,
}

/// Reads the model at `path`.
pub(super) fn load(path: &Path) -> Result<Read, WorkbenchError> {
    // computed before the model is read, so an edit in the meantime is detected later
    let fingerprint = fingerprint(path).map_err(|e| io(path, e))?;
    Ok(Read { model: GreyBox::load(path)?, original: Original::read(path)?, fingerprint })
}

/// Path of a stored result.
fn result_file(folder: &Path, key: &str) -> PathBuf {
    folder.join(format!("{key}.json"))
}

impl Inner {
    /// Loads stored results that belong to the present state of the session. An earlier run, or the same state before an edit,
    /// may have computed them.
    pub fn recall(&mut self) {
        let stored = |key: &str, known: &Option<(String, Arc<Value>)>| {
            if known.as_ref().is_some_and(|(of, _)| of == key) {
                return None;
            }
            let text = fs::read_to_string(result_file(&self.folder, key)).ok()?;
            Some((key.to_owned(), Arc::new(serde_json::from_str::<Value>(&text).ok()?)))
        };
        let key = |work: Work| self.key(work.word(), &[]);
        let diagnosis = stored(&key(Work::Diagnosis), &self.diagnosis);
        let proposal = stored(&key(Work::Proposal), &self.proposal);
        self.diagnosis = diagnosis.or(self.diagnosis.take());
        self.proposal = proposal.or(self.proposal.take());
        for effects in self.stacks() {
            let key = self.key("fit", &effects);
            let folder = self.folder.join("fits").join(&key);
            if !self.fits.contains_key(&key)
                && let Some(fitted) = Fitted::read(&folder)
            {
                self.fits.insert(key, Arc::new(fitted));
            }
        }
    }

    /// Origin of the amended model that is displayed: `fitted`, `estimated`, or `given` if there is neither a fit nor an
    /// estimate.
    pub fn shown(&self) -> String {
        let key = self.key("fit", &self.session.effects);
        match (self.fits.contains_key(&key), &self.estimate) {
            (true, _) => "fitted".into(),
            (false, Some((of, _))) if *of == key => "estimated".into(),
            _ => "given".into(),
        }
    }

    /// The given model, followed by the amended model (the model with the accepted effects) if there is one. Until its fit is
    /// complete, the amended model is an equation-error estimate.
    pub fn models(&self) -> Vec<GreyBox> {
        let key = self.key("fit", &self.session.effects);
        let estimate = self.estimate.as_ref().filter(|(of, _)| *of == key).map(|(_, e)| &e.model);
        let amended = self.fits.get(&key).map(|f| &f.model).or(estimate);
        std::iter::once(&self.model).chain(amended).cloned().collect()
    }
}
