//! The commands `compare`, `diagnose` and `amend` as functions.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use greylag::commands::distinct::distinct;
use greylag::logs::csv::Tolerance;
use greylag::logs::mapping::Mapping;
use greylag::logs::{self, Log};
use greylag::model::GreyBox;
use greylag::physics::catalogue;
use greylag::sysid;
use greylag::sysid::amend::{Added, Amended, Prior, Refused, document};
use greylag::sysid::flight_path::installation::{Prior as Expected, share};
use greylag::sysid::flight_path::reconstruction::Reconstruction;
use greylag::sysid::flight_path::{self, ActuatorClock, reconstruct};
use greylag::sysid::progress::{Progress, Stage};
use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;

use crate::error::raised;
use crate::long_work::done;
use crate::model::Model;

/// Fraction of the progress for reading the logs and reconstructing the flights.
const INTAKE: f64 = 0.2;

/// Options for reading logs.
#[derive(FromPyObject)]
pub struct Reading {
    mapping: Option<PathBuf>,
    lenient: bool,
    despite_problems: bool,
}

/// Options of `amend`.
#[derive(FromPyObject)]
pub struct Wanted {
    /// Effects to add, each with start values of its coefficients. `None` adds the effects that a diagnosis asserts.
    effects: Option<Vec<(String, HashMap<String, f64>)>>,
    conventions: bool,
    from_scratch: bool,
    keep_refused: bool,
}

impl Reading {
    fn options(&self) -> Result<logs::Options, String> {
        let mapping = self.mapping.as_deref().map(Mapping::load).transpose();
        let tolerance = if self.lenient { Tolerance::Lenient } else { Tolerance::Strict };
        let mapping = mapping.map_err(said)?.unwrap_or_default();
        Ok(logs::Options { tolerance, mapping, ..logs::Options::default() })
    }

    /// The log at `path`. An error if wrong units, signs or axes were found and the options do not accept them.
    fn log(&self, path: &Path) -> Result<Log, String> {
        let log = logs::load(path, &self.options()?).map_err(said)?;
        match log.problems().filter(|_| !self.despite_problems) {
            None => Ok(log),
            Some(problems) if log.flown_s() == 0.0 => {
                Err(format!("flight log {}: {problems}", path.display()))
            }
            Some(problems) => Err(format!(
                "flight log {}: {problems}. Every figure would be wrong. If the log is right all the same, \
                 give despite_problems=True",
                path.display()
            )),
        }
    }

    /// The reconstructed flights of `paths`; the findings of the log readers are appended to `notes`. The constants of the sensors'
    /// installation that only some of the flights show are used for all of them, and are appended to `installation`, which has
    /// those of flights that were read before.
    fn flights(
        &self,
        paths: &[PathBuf],
        (model, clock): (&GreyBox, ActuatorClock),
        installation: &mut Vec<Expected>,
        notes: &mut Vec<String>,
        progress: &Progress,
    ) -> Result<Vec<Reconstruction>, String> {
        let mut flights = Vec::new();
        let known = installation.clone();
        let names: Vec<String> = paths.iter().map(|path| name_of(path)).collect();
        let one = |log: Log, k: usize, priors: &[Expected]| {
            let options = flight_path::Options::of(&names[k], model, clock);
            let options = options.expecting(&known).expecting(priors);
            let cannot = |e| format!("cannot use flight log {}: {e}", paths[k].display());
            reconstruct(log.flight, &options).map_err(cannot)
        };
        for (k, path) in paths.iter().enumerate() {
            let name = &names[k];
            let doing = format!("reading and reconstructing {name}");
            let share = INTAKE * k as f64 / paths.len() as f64;
            if progress(Stage::new(&doing, share)).is_break() {
                return Err("cancelled".into());
            }
            let log = self.log(path)?;
            notes.extend(log.findings.iter().map(|f| format!("{name}: {f}")));
            flights.push(one(log, k, &[])?);
        }
        let common = share(&mut flights, |k, priors| one(self.log(&paths[k])?, k, priors))?;
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        notes.extend(common.sentences(&names));
        installation.extend(common.priors(None));
        Ok(flights)
    }
}

fn name_of(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

fn said(error: impl std::fmt::Display) -> String {
    error.to_string()
}

/// Reports the stages after the logs have been read, with fractions of the whole work.
fn after_intake<'a>(
    progress: &'a Progress<'a>,
) -> impl Fn(Stage<'_>) -> std::ops::ControlFlow<()> + Sync + 'a {
    move |stage| progress(Stage { fraction: INTAKE + (1.0 - INTAKE) * stage.fraction, ..stage })
}

/// Reads a log and returns its name, format, notes and columns.
#[pyfunction]
#[expect(clippy::type_complexity, reason = "the Python layer makes a class of it")]
pub fn load<'py>(
    py: Python<'py>,
    path: PathBuf,
    reading: Reading,
) -> PyResult<(String, String, Vec<String>, Vec<(&'static str, Bound<'py, PyArray1<f64>>)>)> {
    let log = py.detach(|| reading.log(&path)).map_err(raised)?;
    let columns = log.flight.columns();
    let columns = columns.into_iter().map(|(name, x)| (name, x.into_pyarray(py))).collect();
    let notes = log.findings.iter().map(ToString::to_string).collect();
    Ok((log.flight.name.clone(), log.format.name().to_owned(), notes, columns))
}

/// Compares models over the flights in `logs` and returns the JSON document of `greylag compare`.
#[pyfunction]
pub fn compare(
    py: Python<'_>,
    models: Vec<PyRef<'_, Model>>,
    logs: Vec<PathBuf>,
    horizons_s: Vec<f64>,
    seed: u64,
    reading: Reading,
    progress: Option<Py<PyAny>>,
) -> PyResult<String> {
    let models: Vec<GreyBox> = models.iter().map(|m| m.model.as_ref().clone()).collect();
    done(py, progress, move |progress| {
        let first = models.first().ok_or("name a model to compare")?;
        let mut notes = Vec::new();
        let clock = ActuatorClock::Estimated;
        let flights =
            reading.flights(&logs, (first, clock), &mut Vec::new(), &mut notes, progress)?;
        let options = sysid::compare::Options { horizons_s, seed };
        let stages = after_intake(progress);
        let mut found =
            sysid::compare::compare(&models, &flights, &options, &stages).map_err(said)?;
        notes.append(&mut found.notes);
        found.notes = notes;
        serde_json::to_string(&found.document()).map_err(said)
    })
}

/// Diagnoses a model from the flights in `logs` and returns the JSON document of `greylag diagnose`.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "the Python layer names them")]
pub fn diagnose(
    py: Python<'_>,
    model: PyRef<'_, Model>,
    logs: Vec<PathBuf>,
    nulls: usize,
    seed: u64,
    without: Vec<String>,
    reading: Reading,
    progress: Option<Py<PyAny>>,
) -> PyResult<String> {
    let model = model.model.clone();
    done(py, progress, move |progress| {
        let mut notes = Vec::new();
        let clock = ActuatorClock::AsRecorded;
        distinct(&logs, &[]).map_err(said)?;
        let flights =
            reading.flights(&logs, (&model, clock), &mut Vec::new(), &mut notes, progress)?;
        let options = sysid::diagnose::Options { seed, nulls, without, ..Default::default() };
        let stages = after_intake(progress);
        let mut found =
            sysid::diagnose::diagnose(&model, &flights, &options, &stages).map_err(said)?;
        notes.append(&mut found.notes);
        found.notes = notes;
        serde_json::to_string(&found).map_err(said)
    })
}

/// Amends a model, writes the model, the airframe and the JSON document of `greylag amend` to the folder `out`, and
/// returns the document.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "the Python layer names them")]
pub fn amend(
    py: Python<'_>,
    model: PyRef<'_, Model>,
    original: PathBuf,
    logs: Vec<PathBuf>,
    hold_out: Vec<PathBuf>,
    out: PathBuf,
    wanted: Wanted,
    reading: Reading,
    progress: Option<Py<PyAny>>,
) -> PyResult<String> {
    let model = model.model.clone();
    done(py, progress, move |progress| {
        distinct(&logs, &hold_out).map_err(said)?;
        let hashed = |paths: &[PathBuf]| paths.iter().map(hash).collect::<Result<Vec<_>, _>>();
        let hashes = [hashed(&logs)?, hashed(&hold_out)?];
        let clock = ActuatorClock::AsRecorded;
        let mut notes = Vec::new();
        let (aircraft, mut installation) = ((&*model, clock), Vec::new());
        let mut flights =
            reading.flights(&logs, aircraft, &mut installation, &mut notes, progress)?;
        let mut tests =
            reading.flights(&hold_out, aircraft, &mut installation, &mut notes, progress)?;
        if tests.is_empty() {
            let one = flights.pop().ok_or("name a log to fit to")?;
            notes.push(format!("{}: fitted to its first two thirds, judged by the last", one.name));
            let [first, last] = sysid::amend::split(&one);
            (flights, tests) = (vec![first], vec![last]);
        }
        let stages = after_intake(progress);
        let options = sysid::amend::Options {
            effects: effects(&wanted, &model, &flights, &stages)?,
            conventions: wanted.conventions,
            prior: if wanted.from_scratch { Prior::Bounds } else { Prior::File },
            refused: if wanted.keep_refused { Refused::Kept } else { Refused::Left },
            ..Default::default()
        };
        let mut amended =
            sysid::amend::amend(&model, &flights, &tests, &options, &stages).map_err(said)?;
        amended.amendment.notes.splice(0..0, notes);
        let all = &amended.amendment.effects;
        if !all.is_empty() && !all.iter().any(|e| e.joined) {
            let why = amended.amendment.sentences.join(" ");
            return Err(format!(
                "no effect was accepted, so nothing was written; effects=[] writes the tuned model, \
                 keep_refused=True a refused effect; it says: {why}"
            ));
        }
        write(&model, &original, &amended, &hashes, &out)
    })
}

/// The effects to add: those of `wanted`, otherwise those that a diagnosis of `flights` asserts.
fn effects(
    wanted: &Wanted,
    model: &GreyBox,
    flights: &[Reconstruction],
    progress: &Progress,
) -> Result<Vec<Added>, String> {
    if let Some(named) = &wanted.effects {
        return named.iter().map(|(id, start)| added(model, id, start)).collect();
    }
    let found =
        sysid::diagnose::diagnose(model, flights, &Default::default(), progress).map_err(said)?;
    let asserted: Vec<Added> = found.effects.iter().filter(|c| c.asserted).map(Added::of).collect();
    match asserted.is_empty() {
        false => Ok(asserted),
        true => Err(format!(
            "the diagnosis asserts no effect, so there is none to add; it says: {}",
            found.sentences.join(" ")
        )),
    }
}

fn added(model: &GreyBox, id: &str, values: &HashMap<String, f64>) -> Result<Added, String> {
    let about = catalogue::describe(id).ok_or_else(|| {
        format!("effect {id:?} is unknown; `greylag effects list` names those there are")
    })?;
    if model.has(id) {
        return Err(format!(
            "model {} has the effect {id} already; effects=[] refits its coefficients",
            model.name
        ));
    }
    let start = about.coefficients.iter().map(|c| values.get(c.name).copied()).collect();
    Ok(Added { id: id.into(), start })
}

fn hash(path: &PathBuf) -> Result<document::Hashed, String> {
    let content = std::fs::read(path)
        .map_err(|e| format!("cannot read flight log {}: {e}", path.display()))?;
    Ok(document::Hashed::new(path, &content))
}

/// Writes the files of an amended model to the folder `out` and returns the document. All files are written and checked
/// before the first is renamed into place.
fn write(
    model: &GreyBox,
    original: &Path,
    amended: &Amended,
    [logs, hold_out]: &[Vec<document::Hashed>; 2],
    out: &Path,
) -> Result<String, String> {
    let cannot = |e: std::io::Error| format!("cannot write the model to {}: {e}", out.display());
    let original = document::Original::read(original).map_err(said)?;
    let files = document::files(&original, model, amended, [logs, hold_out]).map_err(said)?;
    std::fs::create_dir_all(out).map_err(cannot)?;
    // the temporary folder is inside `out`, so that renaming is atomic; dropping it removes it
    let part = tempfile::Builder::new().prefix(".part-").tempdir_in(out).map_err(cannot)?;
    let part = part.path();
    for (name, text) in &files {
        std::fs::write(part.join(name), text).map_err(cannot)?;
    }
    let read = GreyBox::load(&part.join(document::MODEL)).map_err(said)?;
    if let Some(lost) = document::differs(&read, &amended.model) {
        return Err(format!(
            "the written model read back with another {lost}, and was removed; report this"
        ));
    }
    for (name, _) in &files {
        std::fs::rename(part.join(name), out.join(name)).map_err(cannot)?;
    }
    let story = files.into_iter().find(|(name, _)| name == document::STORY);
    Ok(story.map(|(_, text)| text).unwrap_or_default())
}
