//! Effects that the user of the workbench writes as the text of an effect file (TOML). They are checked, stored, and then
//! diagnosed and fitted like effects of the catalogue.

use std::fs;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde_json::{Value, json};

use super::bench::{Bench, Inner};
use super::curves::rows;
use super::error::{WorkbenchError, io};
use super::jobs::Work;
use super::session::Role;
use greylag_model::GreyBox;
use greylag_physics::catalogue;
use greylag_physics::effects::Description;
use greylag_physics::formula::expression::Function;
use greylag_physics::formula::{Status, Variable, file, register};
use greylag_report::write_over;
use greylag_sysid::amend::document::sha256;
use greylag_sysid::compare::{self, ChannelId, compare};
use greylag_sysid::diagnose::{Curve, over_the_best};
use greylag_sysid::flight_path::reconstruction::Reconstruction;
use greylag_sysid::progress::ignore_progress;
use greylag_sysid::weak_form::prepared::{ClockError, Prepared};

/// Subfolder of the session's folder for effect files.
pub(super) const EFFECTS: &str = "effects";
/// An example of an effect file.
const EXAMPLE: &str = include_str!("../../params/effects/yaw_by_throttle.toml");

/// An effect that the user has written as text.
#[derive(Clone, Debug, Serialize)]
pub struct OwnView {
    id: String,
    description: &'static str,
    formula: &'static str,
    status: Option<Status>,
    text: String,
}

/// Content of a valid effect file.
#[derive(Clone, Debug, Serialize)]
pub struct Checked {
    /// Id of the effect.
    pub id: &'static str,
    /// Description of the effect.
    pub description: &'static str,
    /// Formula of the effect.
    pub formula: &'static str,
    /// Whether a controller may fly a model with this effect.
    pub status: Status,
}

/// Names of variables and functions that the formula of an effect file may contain, and an example.
pub fn grammar() -> Value {
    let variable = |v: &Variable| json!([v.name(), v.alias(), v.meaning()]);
    let functions = Function::ALL.iter().filter(|f| !f.is_operator());
    let functions: Vec<_> = functions.map(|f| json!([f.name(), f.meaning()])).collect();
    let variables: Vec<_> = Variable::ALL.iter().map(variable).collect();
    json!({ "example": EXAMPLE, "variables": variables, "functions": functions })
}

/// Parses `text` as an effect file, without storing it.
///
/// # Errors
/// `WorkbenchError::EffectText` with the error, its line and a remedy.
pub fn check(text: &str) -> Result<Checked, WorkbenchError> {
    let written = file::parse(text).map_err(WorkbenchError::EffectText)?;
    let Description { id, description, formula, .. } = written.about;
    Ok(Checked { id, description, formula, status: written.status })
}

impl Bench {
    /// Adds an effect, given as text, to the session. It replaces an effect with the same id.
    pub(super) fn write_effect(
        self: &std::sync::Arc<Self>,
        seen: u64,
        text: &str,
    ) -> Result<(), WorkbenchError> {
        let id = check(text)?.id;
        let path = effect_file(&self.folder, id);
        let mut before = None;
        let kept = self.change(seen, |inner| {
            // an effect of the model must keep the formula with which it was fitted
            if inner.model.has(id) {
                return Err(WorkbenchError::Present(id.into()));
            }
            let folder = self.folder.join(EFFECTS);
            fs::create_dir_all(&folder).map_err(|e| io(&folder, e))?;
            before = Some(fs::read_to_string(&path).ok());
            write_over(&path, text)?;
            register::read(text).map_err(WorkbenchError::EffectText)?;
            if !inner.session.own.iter().any(|own| own == id) {
                inner.session.own.push(id.into());
            }
            Ok(inner.session.effects.iter().any(|e| e.id == id))
        });
        let accepted = kept.inspect_err(|_| match before {
            Some(Some(text)) => {
                let _ = write_over(&path, &text);
                let _ = register::read(&text);
            }
            Some(None) => drop(fs::remove_file(&path)),
            None => {}
        })?;
        if accepted {
            self.start(Work::Fit);
        }
        Ok(())
    }

    /// Removes an effect that was written as text from the session; its file is kept.
    pub(super) fn forget(&self, seen: u64, id: &str) -> Result<(), WorkbenchError> {
        self.change(seen, |inner| {
            if inner.session.effects.iter().any(|e| e.id == id) {
                return Err(WorkbenchError::Accepted(id.into()));
            }
            inner.session.own.retain(|own| own != id);
            inner.session.undone.retain(|e| e.id != id);
            Ok(())
        })
    }

    /// Contribution of the accepted effect `id` in the channel in which it is largest relative to the residual, over the regime
    /// variable (such as the angle of attack) that explains most of it. The result also contains the residual of the model
    /// without the effect. It is computed with the fitted model or, until the fit is complete, with the estimated one. `None` if
    /// there is neither, or if the effect has no linear coefficients.
    ///
    /// # Errors
    /// If the flights cannot be compared.
    pub fn curve(&self, id: &str) -> Result<Option<Curve>, WorkbenchError> {
        let (with, flights, relative) = {
            let inner = self.lock();
            let models = inner.models();
            let Some(with) = models.into_iter().nth(1) else { return Ok(None) };
            (with, inner.reconstructions(&inner.usable(&[Role::Fit])), inner.relative_sd(id))
        };
        let Some(without) = zeroed(&with, id) else { return Ok(None) };
        let models = [without, with];
        let comparison =
            compare(&models, &flights, &compare::Options::default(), &ignore_progress)?;
        let prepared = compared(&flights, models[0].airframe.envelope.flying_from_mps())?;
        let all = ChannelId::ALL.iter().filter_map(|id| made(&comparison, &prepared, *id));
        let most = all.max_by(|a, b| a.weight().total_cmp(&b.weight()));
        Ok(most.and_then(|m| over_the_best(m.id, m.made, m.left, &m.regimes, relative)))
    }
}

/// Prepares the flights that a comparison uses, in the same order: those with at least one window. `slowest` is the airspeed
/// above which the aircraft counts as flying, m/s.
fn compared(flights: &[Reconstruction], slowest: f64) -> Result<Vec<Prepared>, ClockError> {
    let prepared = flights.iter().map(|f| Prepared::new(f, slowest));
    let mut prepared = prepared.collect::<Result<Vec<_>, _>>()?;
    prepared.retain(|f| !f.windows.is_empty());
    Ok(prepared)
}

/// Contribution of an effect to a channel in each window, with the residual of the model without the effect.
struct Made {
    id: ChannelId,
    made: Vec<f64>,
    left: Vec<f64>,
    regimes: Vec<[f64; compare::RegimeVariable::CONTINUOUS.len()]>,
}

impl Made {
    /// Sum of squares of the contribution divided by that of the residual of the model without the effect.
    fn weight(&self) -> f64 {
        let power = |list: &[f64]| list.iter().map(|x| x * x).sum::<f64>();
        power(&self.made) / power(&self.left).max(f64::MIN_POSITIVE)
    }
}

/// Difference between the predictions of the second and the first model in a channel; `None` if the channel is not measured.
fn made(comparison: &compare::Comparison, flights: &[Prepared], id: ChannelId) -> Option<Made> {
    let mut all = Made { id, made: Vec::new(), left: Vec::new(), regimes: Vec::new() };
    let [without, with] = &comparison.models[..] else { return None };
    for (k, flight) in flights.iter().enumerate() {
        let of = |m: &compare::ModelResult| {
            m.traces.get(k)?.channels.iter().find(|c| c.channel == id).cloned()
        };
        let (without, with) = (of(without)?, of(with)?);
        for (row, window) in rows(flight).into_iter().enumerate() {
            let Some(window) = window else { continue };
            let (less, more) = (without.predicted.get(row)?, with.predicted.get(row)?);
            let left = without.measured.get(row)? - less;
            if left.is_finite() && more.is_finite() {
                all.made.push(more - less);
                all.left.push(left);
                all.regimes.push(flight.windows[window].regime);
            }
        }
    }
    (!all.made.is_empty()).then_some(all)
}

/// Returns the model with the linear coefficients of the effect set to zero; `None` if there are none.
fn zeroed(model: &GreyBox, id: &str) -> Option<GreyBox> {
    let about = catalogue::describe(id)?;
    let linear = about.coefficients.len().checked_sub(about.shape)?;
    let mut without = model.clone();
    let mut any = false;
    for coefficient in &about.coefficients[..linear] {
        any |= without.set_coefficient(&format!("{id}.{}", coefficient.name), 0.0);
    }
    any.then_some(without)
}

impl Inner {
    /// Loads the session's effect files. Their effects can then be found by id.
    pub(super) fn read_own(&self) -> Result<(), WorkbenchError> {
        for id in &self.session.own {
            register::load(&effect_file(&self.folder, id))?;
        }
        Ok(())
    }

    /// Ids and hashes of the session's effect files. A new diagnosis includes these effects as candidates.
    pub(super) fn tried(&self) -> Value {
        let text = |id: &String| register::find(id).map_or("", |effect| effect.text.as_str());
        self.session.own.iter().map(|id| json!([id, sha256(text(id).as_bytes())])).collect()
    }

    /// The effects that the user has written as text.
    pub(super) fn own_views(&self) -> Vec<OwnView> {
        let view = |id: &String| {
            let read = register::find(id);
            OwnView {
                id: id.clone(),
                description: read.map_or("", |e| e.about.description),
                formula: read.map_or("", |e| e.about.formula),
                status: read.map(|e| e.status),
                text: read.map(|e| e.text.clone()).unwrap_or_default(),
            }
        };
        self.session.own.iter().map(view).collect()
    }

    /// Argument for the effect in a command: the path of its file if the session has one, otherwise its id.
    pub(super) fn effect_word(&self, id: &str) -> PathBuf {
        match self.session.own.iter().any(|own| own == id) {
            true => effect_file(&self.folder, id),
            false => id.into(),
        }
    }

    /// Smallest ratio of standard deviation to value among the coefficients of an effect; 0 before the fit.
    fn relative_sd(&self, id: &str) -> f64 {
        let key = self.key("fit", &self.session.effects);
        let Some(fitted) = self.fits.get(&key) else { return 0.0 };
        let all = fitted.story["parameters"].as_array().into_iter().flatten();
        let of = |p: &&Value| p["name"].as_str().is_some_and(|n| n.split('.').next() == Some(id));
        let relative = |p: &Value| Some((p["sd"].as_f64()? / p["value"].as_f64()?).abs());
        all.filter(of).filter_map(relative).min_by(f64::total_cmp).unwrap_or(0.0)
    }
}

/// Path of the file for the effect `id`, in the session's folder `folder`.
fn effect_file(folder: &Path, id: &str) -> PathBuf {
    folder.join(EFFECTS).join(format!("{id}.toml"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flights::Loaded;

    #[test]
    fn a_flight_without_a_window_is_not_compared() {
        let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
        let model = GreyBox::load(&root.join("params/x8/prior.toml")).unwrap();
        let bytes = fs::read(root.join("tests/data/odd_logs/good.csv")).unwrap();
        let options = greylag_logs::Options::default();
        let loaded = Loaded::parse(&bytes, "good.csv", &options, &model).unwrap();
        let mut short = loaded.flight.clone();
        short.segments.iter_mut().for_each(|s| s.instants.truncate(3));
        let slowest = model.airframe.envelope.flying_from_mps();
        let used = compared(&[short, loaded.flight.clone()], slowest).unwrap();
        assert!(used.len() == 1 && !used[0].windows.is_empty());
    }
}
