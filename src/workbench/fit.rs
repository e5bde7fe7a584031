//! The model with the accepted effects: worked out, kept in the session's folder, saved.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use serde_json::{Value, json};

use super::bench::{Bench, Divided, Inner};
use super::error::{WorkbenchError, io};
use super::session::{Accepted, Role};
use crate::model::GreyBox;
use crate::report::write_over;
use crate::sysid::amend::document::{self, Hashed};
use crate::sysid::amend::{self, Added, Amended, Options, Refused, amend, estimate, tune};
use crate::sysid::compare::{HorizonScore, free_run};
use crate::sysid::progress::{Progress, Stage, part};
use crate::sysid::weak_form::prepared::Prepared;

/// Share of a first fit's time that tuning the prior takes.
const TUNING: f64 = 0.4;

/// A model with accepted effects, as it lies in the session's folder.
pub struct Fitted {
    /// The model.
    pub model: GreyBox,
    /// What the command `amend` writes as `amend.json`.
    pub story: Value,
    /// Free-run errors over the flights that the fit saw, `given` and `amended`.
    pub on_fit: Value,
}

impl Fitted {
    /// The fit in `folder`, if a whole one is there.
    pub fn read(folder: &Path) -> Option<Fitted> {
        let json = |name: &str| -> Option<Value> {
            serde_json::from_str(&fs::read_to_string(folder.join(name)).ok()?).ok()
        };
        let model = GreyBox::load(&folder.join("model.toml")).ok()?;
        Some(Fitted { model, story: json("amend.json")?, on_fit: json("on_fit.json")? })
    }
}

/// What a fit is made of.
struct Task {
    key: String,
    model: GreyBox,
    text: String,
    effects: Vec<Accepted>,
    flights: Divided,
    tuned_key: String,
    tuned: Option<amend::Fit>,
    logs: [Vec<Hashed>; 2],
    airframe: (String, String),
    original: std::path::PathBuf,
}

impl Bench {
    /// Works out the fits of all accepted effects that are not there yet.
    pub(super) fn fit(&self, progress: &Progress) -> Result<(), WorkbenchError> {
        let count = self.lock().session.effects.len();
        for k in 1..=count {
            let shares = [(k - 1) as f64 / count as f64, k as f64 / count as f64];
            let progress = part(progress, shares);
            let task = self.task(k)?;
            if let Some(task) = task {
                self.one_fit(task, &progress)?;
            }
        }
        Ok(())
    }

    /// The fit of the first `count` effects; `None` if it is there, or they are no longer so many.
    fn task(&self, count: usize) -> Result<Option<Task>, WorkbenchError> {
        let inner = self.lock();
        let Some(effects) = inner.session.effects.get(..count) else { return Ok(None) };
        let key = inner.key("fit", effects);
        if inner.fits.contains_key(&key) {
            return Ok(None);
        }
        let tuned_key = inner.key("tuned", &[]);
        let tuned = inner.tuned.as_ref().filter(|(of, _)| *of == tuned_key);
        Ok(Some(Task {
            key,
            model: inner.model.clone(),
            text: inner.text.clone(),
            effects: effects.to_vec(),
            flights: inner.divided()?,
            tuned: tuned.map(|(_, fit)| fit.clone()),
            tuned_key,
            logs: [Role::Fit, Role::HoldOut].map(|role| hashed(&inner, role, &self.folder)),
            airframe: airframe(&inner.text, &inner.session.model)?,
            original: inner.session.model.clone(),
        }))
    }

    fn one_fit(&self, task: Task, progress: &Progress) -> Result<(), WorkbenchError> {
        let Divided { fit, held_out } = &task.flights;
        let effects: Vec<Added> =
            task.effects.iter().map(|e| Added { id: e.id.clone(), start: None }).collect();
        super::jobs::go_on(progress(Stage::new("equation error", 0.0)))?;
        let at_once = estimate(&task.model, fit, held_out, &effects)?;
        self.lock().estimate = Some((task.key.clone(), at_once));
        self.changed();
        let tuned = match &task.tuned {
            Some(tuned) => tuned.clone(),
            None => {
                let tuned = tune(&task.model, fit, &part(progress, [0.0, TUNING]))?;
                self.lock().tuned = Some((task.tuned_key.clone(), tuned.clone()));
                tuned
            }
        };
        let anyway = task.effects.iter().any(|e| e.anyway);
        let options = Options {
            effects,
            refused: if anyway { Refused::Kept } else { Refused::Left },
            tuned: Some(tuned),
            ..Options::default()
        };
        let amended = amend(&task.model, fit, held_out, &options, &part(progress, [TUNING, 1.0]))?;
        let folder = self.fit_folder(&task.key);
        write(&task, &amended, &folder)?;
        let fitted = Fitted::read(&folder).ok_or_else(|| {
            io(&folder, std::io::Error::other("what was written does not read back"))
        })?;
        self.lock().fits.insert(task.key, Arc::new(fitted));
        self.changed();
        Ok(())
    }

    /// Writes the model as amended to `folder`: the same files as `greylag amend`.
    pub(super) fn save(&self, folder: &Path) -> Result<(), WorkbenchError> {
        let from = {
            let inner = self.lock();
            if inner.session.effects.is_empty() {
                return Err(WorkbenchError::Nothing("save: accept an effect first"));
            }
            let key = inner.key("fit", &inner.session.effects);
            inner.fits.get(&key).ok_or(WorkbenchError::Unfitted)?;
            self.fit_folder(&key)
        };
        fs::create_dir_all(folder).map_err(|e| io(folder, e))?;
        let files = fs::read_dir(&from).map_err(|e| io(&from, e))?;
        for file in files {
            let path = file.map_err(|e| io(&from, e))?.path();
            let Some(name) = path.file_name().filter(|n| *n != "on_fit.json") else { continue };
            let text = fs::read_to_string(&path).map_err(|e| io(&path, e))?;
            write_over(&folder.join(name), &text)?;
        }
        Ok(())
    }
}

/// Free runs of `model` over `flights` at the usual horizons.
pub(super) fn scores(model: &GreyBox, flights: &[Prepared]) -> Vec<HorizonScore> {
    let horizons = Options::default().horizons_s;
    let (runs, _) = free_run::fly(model, flights, &horizons);
    horizons.iter().map(|h| runs.score(*h)).collect()
}

/// The logs of a role with their hashes.
fn hashed(inner: &Inner, role: Role, folder: &Path) -> Vec<Hashed> {
    let of = |k: usize| {
        let log = &inner.session.logs[k];
        let path = folder.join(&log.path).display().to_string();
        Hashed { path, sha256: log.sha256.clone() }
    };
    inner.session.with(role).map(of).collect()
}

/// The name and the text of the airframe file that the model at `path` names.
fn airframe(text: &str, path: &Path) -> Result<(String, String), WorkbenchError> {
    let table: toml::Table = toml::from_str(text)
        .map_err(|e| WorkbenchError::Session { path: path.into(), why: e.to_string() })?;
    let named = table.get("airframe").and_then(toml::Value::as_str).unwrap_or_default();
    let file = path.parent().unwrap_or(Path::new(".")).join(named);
    let name = file.file_name().unwrap_or("airframe.toml".as_ref()).to_string_lossy().into_owned();
    Ok((name, fs::read_to_string(&file).map_err(|e| io(&file, e))?))
}

/// Writes a fit to `folder`, whole or not at all.
fn write(task: &Task, amended: &Amended, folder: &Path) -> Result<(), WorkbenchError> {
    let [logs, hold_out] = &task.logs;
    let (airframe, body) = &task.airframe;
    let text = document::model(&task.text, &task.model, amended, logs, airframe.clone())?;
    let slowest = 0.5 * task.model.airframe.envelope.airspeed_min_mps;
    let flights: Vec<Prepared> =
        task.flights.fit.iter().map(|f| Prepared::new(f, slowest)).collect::<Result<_, _>>()?;
    let on_fit = json!({
        "given": scores(&task.model, &flights),
        "amended": scores(&amended.model, &flights),
    });
    let part = folder.with_extension("part");
    let _ = fs::remove_dir_all(&part);
    fs::create_dir_all(&part).map_err(|e| io(&part, e))?;
    write_over(&part.join("model.toml"), &text)?;
    write_over(&part.join(airframe), body)?;
    let story = document::story(amended, &task.original, logs, hold_out)?;
    write_over(&part.join("amend.json"), &story)?;
    write_over(&part.join("on_fit.json"), &on_fit.to_string())?;
    let _ = fs::remove_dir_all(folder);
    fs::rename(&part, folder).map_err(|e| io(folder, e))
}
