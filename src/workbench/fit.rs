//! Fits the session's model together with the effects that the user accepted to add. It stores the fits in the session's folder,
//! and saves the amended model (refitted, with added effects). Errors are errors of free runs, which are simulations from
//! recorded states. They are computed over the fit flights or over the held-out flights, which the fit does not use.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use serde_json::{Value, json};

use super::bench::{Bench, Inner};
use super::error::{WorkbenchError, io};
use super::roles::Divided;
use super::session::{Accepted, Role};
use greylag_model::GreyBox;
use greylag_report::write_over;
use greylag_sysid::amend::document::{self, Hashed, MODEL, Original, STORY, differs};
use greylag_sysid::amend::{self, Added, Amended, Options, Refused, amend, estimate, tune};
use greylag_sysid::compare::{HorizonScore, free_run};
use greylag_sysid::progress::{Progress, part, report};
use greylag_sysid::weak_form::prepared::Prepared;

/// File with the free-run errors over the fit flights.
const ON_FIT: &str = "on_fit.json";
/// Share of the progress of a first fit that is taken by tuning the model without added effects.
const TUNING: f64 = 0.4;

/// A model that was fitted with accepted effects, as stored in the session's folder.
pub struct Fitted {
    /// The model with the fitted coefficients.
    pub model: GreyBox,
    /// Content of the file `amend.json`, as the command `greylag amend` writes it.
    pub story: Value,
    /// Free-run errors over the fit flights, of the `given` and of the `amended` model.
    pub on_fit: Value,
}

impl Fitted {
    /// The fit in `folder`; `None` if it is missing or incomplete.
    pub fn read(folder: &Path) -> Option<Fitted> {
        let json = |name: &str| -> Option<Value> {
            serde_json::from_str(&fs::read_to_string(folder.join(name)).ok()?).ok()
        };
        let model = GreyBox::load(&folder.join(MODEL)).ok()?;
        Some(Fitted { model, story: json(STORY)?, on_fit: json(ON_FIT)? })
    }

    /// Whether the fit added none of the accepted effects, because all failed its checks.
    pub fn all_refused(&self) -> bool {
        self.joined().is_empty()
    }

    /// Ids of the effects that the fit added to the model.
    pub fn joined(&self) -> Vec<String> {
        let all = self.story["effects"].as_array().into_iter().flatten();
        let joined = all.filter(|e| e["joined"] == true);
        joined.filter_map(|e| Some(e["id"].as_str()?.to_owned())).collect()
    }
}

/// Inputs of a fit.
struct Task {
    key: String,
    model: GreyBox,
    original: Original,
    effects: Vec<Accepted>,
    flights: Divided,
    tuned_key: String,
    tuned: Option<amend::Fit>,
    logs: [Vec<Hashed>; 2],
}

impl Bench {
    /// Computes the missing fits: one for the first accepted effect, one for the first two, and so on, and one for all accepted
    /// effects with the next one.
    pub(super) fn fit(&self, progress: &Progress) -> Result<(), WorkbenchError> {
        let (accepted, stacks) = {
            let inner = self.lock();
            (inner.session.effects.len(), inner.stacks())
        };
        let count = stacks.len();
        for (k, effects) in stacks.into_iter().enumerate() {
            let shares = [k as f64 / count as f64, (k + 1) as f64 / count as f64];
            let fitted = self.missing_fit(effects, &part(progress, shares));
            // errors of the last fit, which nobody asked for, occur again, and are shown, when the user accepts the effect
            if k < accepted {
                fitted?;
            }
        }
        Ok(())
    }

    /// Makes the fit with `effects` unless it exists.
    fn missing_fit(
        &self,
        effects: Vec<Accepted>,
        progress: &Progress,
    ) -> Result<(), WorkbenchError> {
        self.task(effects)?.map_or(Ok(()), |task| self.one_fit(task, progress))
    }

    /// Inputs of the fit with `effects`; `None` if the fit exists, or other effects are accepted now.
    fn task(&self, effects: Vec<Accepted>) -> Result<Option<Task>, WorkbenchError> {
        let mut inner = self.lock();
        let key = inner.key("fit", &effects);
        if inner.fits.contains_key(&key) || !inner.stacks().contains(&effects) {
            return Ok(None);
        }
        // the fit may be stored from an earlier run
        if let Some(fitted) = Fitted::read(&self.fit_folder(&key)) {
            inner.fits.insert(key, Arc::new(fitted));
            return Ok(None);
        }
        let tuned_key = inner.key("tuned", &[]);
        let tuned = inner.tuned.as_ref().filter(|(of, _)| *of == tuned_key);
        Ok(Some(Task {
            key,
            model: inner.model.clone(),
            original: inner.original.clone(),
            effects,
            flights: inner.divided()?,
            tuned: tuned.map(|(_, fit)| fit.clone()),
            tuned_key,
            logs: [Role::Fit, Role::HoldOut].map(|role| hashed(&inner, role)),
        }))
    }

    fn one_fit(&self, task: Task, progress: &Progress) -> Result<(), WorkbenchError> {
        let Divided { fit, held_out, notes } = &task.flights;
        let effects: Vec<Added> =
            task.effects.iter().map(|e| Added { id: e.id.clone(), start: None }).collect();
        report(progress, "equation error", 0.0)?;
        let at_once = estimate(&task.model, fit, held_out, &effects)?;
        self.lock().estimate = Some((task.key.clone(), at_once));
        self.changed();
        let tuned = match &task.tuned {
            Some(tuned) => tuned.clone(),
            None => {
                let tuned = tune(&task.model, fit, &part(progress, [0.0, TUNING]))?;
                self.keep_tuned(task.tuned_key.clone(), tuned.clone());
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
        let progress = part(progress, [TUNING, 1.0]);
        let mut amended = amend(&task.model, fit, held_out, &options, &progress)?;
        amended.amendment.notes.splice(0..0, notes.iter().cloned());
        let folder = self.fit_folder(&task.key);
        write(&task, &amended, &folder)?;
        let fitted = Fitted::read(&folder).ok_or_else(|| {
            io(&folder, std::io::Error::other("what was written does not read back"))
        })?;
        self.lock().fits.insert(task.key, Arc::new(fitted));
        self.changed();
        Ok(())
    }

    /// Writes the model with all accepted effects to `folder`, in the same files as `greylag amend`.
    pub(super) fn save(&self, folder: &Path) -> Result<(), WorkbenchError> {
        let from = {
            let inner = self.lock();
            if inner.session.effects.is_empty() {
                return Err(WorkbenchError::Nothing("save: accept an effect first"));
            }
            let key = inner.key("fit", &inner.session.effects);
            let fitted = inner.fits.get(&key).ok_or(WorkbenchError::Unfitted)?;
            if fitted.all_refused() {
                return Err(WorkbenchError::AllRefused);
            }
            let there = fs::canonicalize(folder.join(MODEL));
            if there.is_ok_and(|there| there == inner.session.model) {
                return Err(WorkbenchError::OverModel(inner.session.model.clone()));
            }
            self.fit_folder(&key)
        };
        fs::create_dir_all(folder).map_err(|e| io(folder, e))?;
        let files = fs::read_dir(&from).map_err(|e| io(&from, e))?;
        for file in files {
            let path = file.map_err(|e| io(&from, e))?.path();
            let Some(name) = path.file_name().filter(|n| *n != ON_FIT) else { continue };
            let text = fs::read_to_string(&path).map_err(|e| io(&path, e))?;
            write_over(&folder.join(name), &text)?;
        }
        Ok(())
    }
}

/// Free-run errors of `model` over `flights` at the default horizons.
pub(super) fn scores(model: &GreyBox, flights: &[Prepared]) -> Vec<HorizonScore> {
    let horizons = Options::default().horizons_s;
    let (runs, _) = free_run::fly(model, flights, &horizons);
    horizons.iter().map(|h| runs.score(*h)).collect()
}

/// The usable logs of the flights with `role`, each with its hash.
fn hashed(inner: &Inner, role: Role) -> Vec<Hashed> {
    let of = |k: &usize| {
        let path = inner.file(*k).display().to_string();
        Hashed { path, sha256: inner.session.logs[*k].sha256.clone() }
    };
    inner.usable(&[role]).iter().map(of).collect()
}

/// Writes a fit to a temporary folder, which then replaces `folder`.
fn write(task: &Task, amended: &Amended, folder: &Path) -> Result<(), WorkbenchError> {
    let [logs, hold_out] = &task.logs;
    let slowest = task.model.airframe.envelope.flying_from_mps();
    let flights: Vec<Prepared> =
        task.flights.fit.iter().map(|f| Prepared::new(f, slowest)).collect::<Result<_, _>>()?;
    let on_fit = json!({
        "given": scores(&task.model, &flights),
        "amended": scores(&amended.model, &flights),
    });
    let part = folder.with_extension("part");
    let _ = fs::remove_dir_all(&part);
    fs::create_dir_all(&part).map_err(|e| io(&part, e))?;
    for (name, text) in document::files(&task.original, &task.model, amended, [logs, hold_out])? {
        write_over(&part.join(name), text)?;
    }
    write_over(&part.join(ON_FIT), on_fit.to_string())?;
    if let Some(what) = differs(&GreyBox::load(&part.join(MODEL))?, &amended.model) {
        return Err(WorkbenchError::Lost { folder: part, what });
    }
    let _ = fs::remove_dir_all(folder);
    fs::rename(&part, folder).map_err(|e| io(folder, e))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_data_refuse_has_not_joined() {
        let model = GreyBox::load(Path::new(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../params/x8/prior.toml"
        )))
        .unwrap();
        let fitted = |joined: bool| {
            let effects = json!([{ "id": "actuator_lag", "joined": joined }, { "id": "drag_beta2", "joined": false }]);
            Fitted {
                model: model.clone(),
                story: json!({ "effects": effects }),
                on_fit: Value::Null,
            }
        };
        assert_eq!(fitted(true).joined(), ["actuator_lag"]);
        assert!(!fitted(true).all_refused() && fitted(false).all_refused());
    }
}
