//! The state of a workbench session as JSON for its page. A session has a model, flights with roles, and effects that the user
//! accepted to add to the model. An amended model is refitted with these effects.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::ahead::AheadView;
use super::bench::{Bench, Inner};
use super::commands::Commands;
use super::curves::{FlightData, data, named};
use super::error::WorkbenchError;
use super::flights::{Loaded, Strip};
use super::fly;
use super::jobs::{Job, TRIED, Work};
use super::own::OwnView;
use super::proposal::Designed;
use super::session::{Flown, Opening, Role};
use super::tuned::Way;
use greylag_logs::Format;
use greylag_logs::finding::Finding;
use greylag_logs::info::Purpose;
use greylag_logs::phases::Phase;
use greylag_sysid::compare::{self, FlightResult, ModelResult, compare, free_run};
use greylag_sysid::flight_path::ActuatorClock;
use greylag_sysid::flight_path::reconstruction::{Nuisance, Reconstruction};
use greylag_sysid::progress::ignore_progress;

/// Longest duration of a free run (simulation from a recorded state), s.
const LONGEST_S: f64 = 60.0;

/// A flight in the list of flights.
#[derive(Serialize)]
struct FlightView<'a> {
    name: String,
    path: String,
    role: Role,
    /// Whether the flight is a test flight that has not been opened. Its data are hidden until then.
    locked: bool,
    error: Option<&'a str>,
    #[serde(flatten)]
    about: Option<About<'a>>,
}

/// Summary of a usable flight.
#[derive(Serialize)]
struct About<'a> {
    format: Format,
    rate_hz: f64,
    from_s: f64,
    to_s: f64,
    flight_s: f64,
    in_doubt: bool,
    phases: &'a [Phase],
    purposes: &'a [Purpose],
    findings: &'a [Finding],
    nuisances: Vec<Value>,
    notes: &'a [String],
    strip: Option<Strip>,
}

/// An accepted effect with the results of its fit.
#[derive(Serialize)]
struct StepView {
    id: String,
    description: &'static str,
    anyway: bool,
    /// One of `fitted`, `fitting`, `failed`, `unfitted`.
    status: &'static str,
    error: Option<String>,
    /// Free-run errors of the preliminary estimate (by equation error) on the hold-out flights; `None` once the fit is complete.
    estimated: Option<Value>,
    story: Option<Value>,
    on_fit: Option<Value>,
}

/// The state of the session, without the data of curves.
#[derive(Serialize)]
struct StateView<'a> {
    schema: &'static str,
    version: &'static str,
    revision: u64,
    folder: String,
    model: Value,
    flights: Vec<FlightView<'a>>,
    diagnosis: Value,
    proposal: Value,
    schedule: Value,
    designed: &'a [Designed],
    own: Vec<OwnView>,
    fly: Value,
    flown: &'a [Flown],
    stack: Vec<StepView>,
    ahead: Option<AheadView>,
    redo: Option<&'a str>,
    openings: &'a [Opening],
    jobs: &'a [Job],
    commands: Commands,
}

/// Errors of the models by channel (force, moment or rate) and by regime (range of a variable, such as α).
#[derive(Serialize)]
struct FailingView<'a> {
    flights: Vec<usize>,
    /// Origin of each model: given, tuned or amended.
    ways: Vec<Way>,
    models: &'a [ModelResult],
    /// Physically impossible estimates, in words, and what follows. If there are any, forces and moments are withheld.
    doubtful: &'a [String],
    notes: &'a [String],
}

/// Request for free runs.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunRequest {
    /// Index of the flight in the session.
    pub flight: usize,
    /// Start of the run in the time of the log, s.
    pub time_s: f64,
    /// Duration of the run, s; limited to 0.1 to 60 s.
    pub seconds: f64,
}

/// Free runs of all models from the same state.
#[derive(Clone, Debug, Serialize)]
pub struct FreeRun {
    /// The runs of the given, the tuned and the amended model. Models that are not fitted yet are left out.
    pub runs: Vec<OneRun>,
}

/// A free run of one model.
#[derive(Clone, Debug, Serialize)]
pub struct OneRun {
    /// Origin of the model.
    pub way: Way,
    /// Name of the model.
    pub model: String,
    /// Times of the states in the time of the log, s.
    pub time_s: Vec<f64>,
    /// The states by name, in °, °/s and m/s.
    pub states: BTreeMap<&'static str, Vec<Option<f32>>>,
}

impl Bench {
    /// The state of the session as JSON, without the data of curves.
    ///
    /// # Errors
    /// If a number cannot be represented in JSON.
    pub fn state(&self) -> Result<Value, WorkbenchError> {
        let inner = self.lock();
        let session = &inner.session;
        let names = inner.names(&(0..session.logs.len()).collect::<Vec<_>>());
        let clock = inner.clock();
        let state = StateView {
            schema: "greylag.workbench/1",
            version: env!("CARGO_PKG_VERSION"),
            revision: session.revision,
            folder: self.folder.display().to_string(),
            model: json!({
                "name": inner.model.name,
                "path": session.model.display().to_string(),
                "changed_outside": inner.model_changed(),
            }),
            flights: names.into_iter().enumerate().map(|n| flight_view(&inner, clock, n)).collect(),
            diagnosis: result(&inner, &inner.diagnosis, Work::Diagnosis),
            proposal: result(&inner, &inner.proposal, Work::Proposal),
            schedule: json!({ "error": design_failure(&inner) }),
            designed: &inner.designed,
            own: inner.own_views(),
            fly: fly_view(&inner),
            flown: &session.flown,
            stack: (1..=session.effects.len()).map(|count| step(&inner, count)).collect(),
            ahead: inner.ahead(),
            redo: session.undone.last().map(|e| e.id.as_str()),
            openings: &session.openings,
            jobs: &inner.jobs,
            commands: self.commands(&inner),
        };
        Ok(serde_json::to_value(&state)?)
    }

    /// The diagnosis as `greylag diagnose --json` writes it; `null` if there is none.
    pub fn diagnosis(&self) -> Value {
        let inner = self.lock();
        let key = inner.key("diagnosis", &[]);
        let known = inner.diagnosis.as_ref().filter(|(of, _)| *of == key);
        known.map_or(Value::Null, |(_, value)| value.as_ref().clone())
    }

    /// Errors of the models by channel and regime, over the fit and hold-out flights.
    ///
    /// # Errors
    /// If no flight can be compared, or a number cannot be represented in JSON.
    pub fn failing(&self) -> Result<Value, WorkbenchError> {
        let (ways, comparison) = self.comparison()?;
        let inner = self.lock();
        let seen = inner.seen();
        let names = inner.names(&seen);
        let place = |f: &FlightResult| Some(seen[names.iter().position(|n| *n == f.name)?]);
        let view = FailingView {
            flights: comparison.flights.iter().filter_map(place).collect(),
            ways,
            models: &comparison.models,
            doubtful: &comparison.doubtful,
            notes: &comparison.notes,
        };
        Ok(serde_json::to_value(&view)?)
    }

    /// One flight over time, as measured and as predicted by the models.
    ///
    /// # Errors
    /// `WorkbenchError::NoFlight` if the flight does not exist, and `WorkbenchError::Locked` if it is a test flight that has
    /// not been opened.
    pub fn flight(&self, place: usize) -> Result<FlightData, WorkbenchError> {
        let flight = self.may_be_seen(place)?;
        let missing = WorkbenchError::NoFlight(place);
        let ((ways, models), shared, clock) = {
            let inner = self.lock();
            let seen = inner.seen();
            let k = seen.iter().position(|k| *k == place);
            (inner.ways(), k.map(|k| inner.names(&seen).swap_remove(k)), inner.clock())
        };
        let (flown, prepared) = flight.on(clock);
        let ((ways, comparison), name) = match shared {
            Some(name) => (self.comparison()?, name),
            None => {
                let flights = std::slice::from_ref(flown);
                let made =
                    compare(&models, flights, &compare::Options::default(), &ignore_progress)?;
                ((ways, Arc::new(made)), flown.name.clone())
            }
        };
        let k = comparison.flights.iter().position(|f| f.name == name).ok_or(missing)?;
        Ok(data(prepared, &comparison, k, ways))
    }

    /// Free runs of the models from one time of a flight.
    ///
    /// # Errors
    /// `WorkbenchError::NoFlight` if the flight does not exist, `WorkbenchError::Locked` if it is a test flight that has not been
    /// opened, and `WorkbenchError::NotFlown` if the aircraft is not in flight at that time.
    pub fn free_run(&self, request: RunRequest) -> Result<FreeRun, WorkbenchError> {
        let flight = self.may_be_seen(request.flight)?;
        let ((ways, models), clock) = {
            let inner = self.lock();
            (inner.ways(), inner.clock())
        };
        let (_, prepared) = flight.on(clock);
        let seconds = request.seconds.clamp(0.1, LONGEST_S);
        let run = |(way, model): (&Way, &greylag_model::GreyBox)| {
            let path = free_run::from_moment(model, prepared, request.time_s, seconds)?;
            Some(OneRun {
                way: *way,
                model: model.name.clone(),
                time_s: path.time_s.clone(),
                states: named(&path.states, &(0..path.time_s.len()).collect::<Vec<_>>()),
            })
        };
        let runs = ways.iter().zip(&models).map(run).collect::<Option<Vec<_>>>();
        Ok(FreeRun { runs: runs.ok_or(WorkbenchError::NotFlown(request.time_s))? })
    }

    /// The flight with the index `place`, unless it is a locked test flight.
    fn may_be_seen(&self, place: usize) -> Result<Arc<Loaded>, WorkbenchError> {
        let inner = self.lock();
        let log = inner.session.logs.get(place).ok_or(WorkbenchError::NoFlight(place))?;
        if inner.locked(log) {
            return Err(WorkbenchError::Locked(log.name()));
        }
        let flight = inner.flights[place].as_ref().ok().cloned();
        flight.ok_or(WorkbenchError::NoFlight(place))
    }
}

/// Description of a result: whether it exists, whether it lacks newer effects, its key, and the error of its job.
fn result(inner: &Inner, known: &Option<(String, Arc<Value>)>, work: Work) -> Value {
    let key = inner.key(work.word(), &[]);
    let known = known.as_ref().filter(|(of, _)| *of == key);
    let tried = known.map_or(&Value::Null, |(_, value)| &value[TRIED]);
    json!({
        "there": known.is_some(),
        // a diagnosis that was made before the user wrote the last effect does not rank that effect
        "behind": tried.is_array() && *tried != inner.tried(),
        "error": inner.failures.get(&key),
        "key": key,
    })
}

/// Error of designing a schedule that separates the last pair of effects; `None` without an error.
fn design_failure(inner: &Inner) -> Option<&String> {
    let pair = inner.between.as_ref()?.join("-");
    inner.failures.get(&(inner.key(Work::Schedule.word(), &[]) + &pair))
}

/// Available schedules and the state of the present flight.
fn fly_view(inner: &Inner) -> Value {
    let flying = inner.flying.as_ref();
    json!({
        "possible": cfg!(feature = "sitl"),
        "on": flying.is_some_and(|f| f.on),
        "number": flying.map(|f| f.number),
        "place": flying.map(|f| f.place),
        "schedules": inner.schedules(),
        "controllers": fly::controllers().collect::<Vec<_>>(),
        "aircraft": fly::AIRCRAFT,
        "channels": fly::channels(),
    })
}

fn flight_view(inner: &Inner, clock: ActuatorClock, (k, name): (usize, String)) -> FlightView<'_> {
    let log = &inner.session.logs[k];
    let locked = inner.locked(log);
    let loaded = inner.flights[k].as_ref();
    FlightView {
        name,
        path: inner.file(k).display().to_string(),
        role: log.role,
        locked,
        error: loaded.err().map(String::as_str),
        about: loaded.ok().map(|flight| about(flight, flight.on(clock).0, locked)),
    }
}

/// Summary of `flight`, of which `flown` is the reconstruction that is compared with models.
fn about<'a>(flight: &'a Loaded, flown: &'a Reconstruction, locked: bool) -> About<'a> {
    let info = &flight.info;
    let nuisance =
        |n: &Nuisance| json!({ "name": n.name, "value": n.value, "sd": n.sd, "unit": n.unit });
    About {
        format: info.format,
        rate_hz: info.rate_hz,
        from_s: info.from_s,
        to_s: info.to_s,
        flight_s: info.flight_s,
        in_doubt: flight.in_doubt(),
        phases: &info.phases,
        purposes: &info.purposes,
        findings: &info.findings,
        nuisances: flown.nuisances.iter().map(nuisance).collect(),
        notes: &flown.notes,
        strip: (!locked).then(|| flight.strip()),
    }
}

/// The accepted effect with the number `count`, from 1.
fn step(inner: &Inner, count: usize) -> StepView {
    let effects = &inner.session.effects[..count];
    let effect = &effects[count - 1];
    let key = inner.key("fit", effects);
    let fitted = inner.fits.get(&key);
    let estimate = inner.estimate.as_ref().filter(|(of, _)| *of == key && fitted.is_none());
    let error = inner.failures.get(&inner.key("fit", &inner.session.effects)).cloned();
    let working = inner.jobs.iter().any(|job| job.work == Work::Fit);
    let status = match (fitted, working, &error) {
        (Some(_), ..) => "fitted",
        (None, true, _) => "fitting",
        (None, false, Some(_)) => "failed",
        _ => "unfitted",
    };
    StepView {
        id: effect.id.clone(),
        description: greylag_physics::catalogue::describe(&effect.id).map_or("", |a| a.description),
        anyway: effect.anyway,
        status,
        error: error.filter(|_| status == "failed"),
        estimated: estimate.map(|(_, e)| json!(e.after)),
        story: fitted.map(|f| f.story.clone()),
        on_fit: fitted.map(|f| f.on_fit.clone()),
    }
}
