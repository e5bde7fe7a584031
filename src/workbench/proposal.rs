//! Two functions of the workbench. The first searches for a formula for the residual that no effect of the catalogue explains.
//! The second designs a schedule (a sequence of attitudes and excitations to be flown) with which flights can distinguish two
//! effects.

use std::fs;
use std::path::PathBuf;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::bench::{Bench, Inner};
use super::error::WorkbenchError;
use super::fly::SCHEDULES;
use super::jobs::Work;
use super::session::Role;
use greylag_report::write_over;
use greylag_sysid::diagnose::{Options, propose};
use greylag_sysid::flight_path::reconstruction::Reconstruction;
use greylag_sysid::progress::Progress;

/// A schedule that was designed to distinguish two effects.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Designed {
    /// Name of the schedule and of its file.
    pub name: String,
    /// Ids of the two effects.
    pub between: [String; 2],
    /// Name of the manoeuvre that distinguishes the two effects.
    pub manoeuvre: String,
    /// Purpose of the manoeuvre.
    pub description: String,
    /// Duration of the manoeuvre that suffices to distinguish them, s.
    pub seconds: f64,
    /// Number of times that the manoeuvre is flown.
    pub times: usize,
    /// Path of the schedule's file.
    pub file: PathBuf,
    /// The `greylag` command that designs the same schedule.
    pub command: String,
}

impl Bench {
    /// Searches for a formula for the unexplained residual of the session's given model, and stores the result.
    pub(super) fn propose(&self, progress: &Progress) -> Result<(), WorkbenchError> {
        let (key, model, [search, test], with) = {
            let inner = self.lock();
            let key = inner.key(Work::Proposal.word(), &[]);
            (key, inner.model.clone(), inner.searched()?, inner.session.own.clone())
        };
        let options = Options { with, ..Options::default() };
        let found = propose(&model, &search, &test, &options, progress)?;
        let value = serde_json::to_value(&found)?;
        write_over(&self.result_file(&key), value.to_string())?;
        self.lock().proposal = Some((key, Arc::new(value)));
        self.changed();
        Ok(())
    }

    /// Result of the search for a formula, as `greylag propose --json` writes it; `null` if there was no search with the present
    /// model and flights.
    pub fn proposal(&self) -> Value {
        let inner = self.lock();
        let key = inner.key(Work::Proposal.word(), &[]);
        let known = inner.proposal.as_ref().filter(|(of, _)| *of == key);
        known.map_or(Value::Null, |(_, value)| value.as_ref().clone())
    }

    /// Starts the design of a schedule that distinguishes the two effects `between`.
    pub(super) fn start_design(
        self: &Arc<Self>,
        between: [String; 2],
    ) -> Result<(), WorkbenchError> {
        if !cfg!(feature = "sitl") {
            return Err(WorkbenchError::NoSimulator);
        }
        self.same_model()?;
        self.lock().between = Some(between);
        self.start(Work::Schedule);
        Ok(())
    }

    /// Designs the schedule for the two effects that were passed to [`Bench::start_design`], and writes its file.
    #[cfg(feature = "sitl")]
    pub(super) fn design(&self, progress: &Progress) -> Result<(), WorkbenchError> {
        use super::error::io;
        use greylag_control::{ControllerKind, build};
        use greylag_logs::quoted;
        use greylag_sim::design::{Suspect, plan, prospects};

        let (model, path, between, words) = {
            let inner = self.lock();
            let between = inner.between.clone().ok_or(WorkbenchError::Nothing("tell apart"))?;
            let words = between.each_ref().map(|id| quoted(&inner.effect_word(id)));
            (inner.model.clone(), inner.session.model.clone(), between, words)
        };
        let suspects = between.each_ref().map(|id| Suspect { id: id.clone(), values: Vec::new() });
        let all =
            prospects(&model, build(ControllerKind::Lqi, &model)?.as_ref(), &suspects, progress)?;
        let [a, b] = &between;
        let plan = plan(&all, model.airframe.envelope.airspeed_cruise_mps)
            .ok_or_else(|| WorkbenchError::NotApart([a.clone(), b.clone()]))?;
        let name = format!("{a}-or-{b}");
        let folder = self.folder.join(SCHEDULES);
        fs::create_dir_all(&folder).map_err(|e| io(&folder, e))?;
        let file = folder.join(format!("{name}.toml"));
        let [first, second] = words;
        let designed = Designed {
            command: format!(
                "greylag design --model {} --between {first} {second} --out {}",
                quoted(&path),
                quoted(&file)
            ),
            manoeuvre: plan.manoeuvre.name.into(),
            description: plan.manoeuvre.description.into(),
            seconds: plan.seconds,
            times: plan.times,
            file: file.clone(),
            between,
            name,
        };
        write_over(&file, plan.schedule.to_toml())?;
        write_over(&file.with_extension("json"), serde_json::to_string(&designed)?)?;
        let mut inner = self.lock();
        inner.designed.retain(|d| d.name != designed.name);
        inner.designed.push(designed);
        drop(inner);
        self.changed();
        Ok(())
    }

    /// Without the simulator, no schedule can be designed.
    #[cfg(not(feature = "sitl"))]
    pub(super) fn design(&self, _: &Progress) -> Result<(), WorkbenchError> {
        Err(WorkbenchError::NoSimulator)
    }
}

impl Inner {
    /// The flights for the search for a formula, then the flights for the test of the formula, as in `greylag propose`. The
    /// search uses the fit flights of the session, and the test uses its hold-out flights. Without a hold-out flight, the last
    /// fit flight is used for the test.
    pub(super) fn searched(&self) -> Result<[Vec<Reconstruction>; 2], WorkbenchError> {
        let [fit, held] = self.searched_places()?;
        Ok([self.reconstructions(&fit), self.reconstructions(&held)])
    }

    /// Indices of the flights in [`searched`](Inner::searched).
    pub(super) fn searched_places(&self) -> Result<[Vec<usize>; 2], WorkbenchError> {
        let (mut fit, held) = (self.usable(&[Role::Fit]), self.usable(&[Role::HoldOut]));
        match (&fit[..], &held[..]) {
            ([], _) => Err(WorkbenchError::NoRole(Role::Fit)),
            ([_], []) => Err(WorkbenchError::NoRole(Role::HoldOut)),
            (_, []) => {
                let last = fit.pop();
                Ok([fit, last.into_iter().collect()])
            }
            _ => Ok([fit, held]),
        }
    }

    /// Reads the schedules that were designed in this session.
    pub(super) fn read_designed(&mut self) {
        let files = fs::read_dir(self.folder.join(SCHEDULES)).into_iter().flatten().flatten();
        let mut paths: Vec<PathBuf> = files.map(|e| e.path()).collect();
        paths.sort();
        let read = paths.iter().filter(|p| p.extension().is_some_and(|e| e == "json"));
        let read = read.filter_map(|p| serde_json::from_str(&fs::read_to_string(p).ok()?).ok());
        self.designed = read.collect();
    }
}
