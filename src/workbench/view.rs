//! The session as a page sees it.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::bench::{Bench, Inner};
use super::commands::Commands;
use super::error::WorkbenchError;
use super::flights::{Loaded, Strip};
use super::jobs::{Job, Work};
use super::mapping::Cure;
use super::session::{LogEntry, Opening, Role};
use crate::logs::Format;
use crate::logs::finding::Finding;
use crate::logs::info::Purpose;
use crate::logs::phases::Phase;
use crate::sysid::compare::{
    self, ChannelId, Comparison, FlightResult, ModelResult, RegimeVariable, compare, free_run,
};
use crate::sysid::progress::unheard;
use crate::sysid::weak_form::prepared::Prepared;

/// Rows of a flight that are drawn at most.
const ROWS: usize = 2500;
/// Longest free run, s.
const LONGEST_S: f64 = 60.0;

/// A flight in the list.
#[derive(Serialize)]
struct FlightView<'a> {
    name: String,
    path: String,
    role: Role,
    /// Whether its data may not be seen yet.
    locked: bool,
    error: Option<&'a str>,
    #[serde(flatten)]
    about: Option<About<'a>>,
}

/// What is known of a flight that can be used.
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
    findings: Vec<FindingView<'a>>,
    nuisances: Vec<Value>,
    notes: &'a [String],
    strip: Option<Strip>,
}

/// A finding with what would put it right.
#[derive(Serialize)]
struct FindingView<'a> {
    #[serde(flatten)]
    finding: &'a Finding,
    cure: Option<Cure>,
}

impl FindingView<'_> {
    fn of(finding: &Finding) -> FindingView<'_> {
        FindingView { finding, cure: Cure::of(finding) }
    }
}

/// An accepted effect with what its fit says.
#[derive(Serialize)]
struct StepView {
    id: String,
    description: &'static str,
    anyway: bool,
    /// `fitted`, `fitting`, `failed` or `unfitted`.
    status: &'static str,
    error: Option<String>,
    /// By equation error alone, as long as the fit is not done: errors on the flights held out.
    estimated: Option<Value>,
    story: Option<Value>,
    on_fit: Option<Value>,
}

/// Everything but the curves.
#[derive(Serialize)]
struct StateView<'a> {
    schema: &'static str,
    version: &'static str,
    revision: u64,
    folder: String,
    model: Value,
    flights: Vec<FlightView<'a>>,
    diagnosis: Value,
    stack: Vec<StepView>,
    redo: Option<&'a str>,
    openings: &'a [Opening],
    jobs: &'a [Job],
    commands: Commands,
}

/// Where the models fail.
#[derive(Serialize)]
struct FailingView<'a> {
    flights: Vec<usize>,
    models: &'a [ModelResult],
    notes: &'a [String],
}

/// A flight over time, drawn.
#[derive(Clone, Debug, Serialize)]
pub struct FlightData {
    /// Its name.
    pub name: String,
    /// Time on the log's clock, s.
    pub time_s: Vec<Option<f64>>,
    /// The states by name, in °, °/s and m/s.
    pub states: BTreeMap<&'static str, Vec<Option<f32>>>,
    /// The deflections in °, the throttle as a share.
    pub controls: BTreeMap<&'static str, Vec<Option<f32>>>,
    /// Middles of the windows, s.
    pub window_s: Vec<Option<f64>>,
    /// Where each window lies, by variable.
    pub regimes: BTreeMap<String, Vec<Option<f32>>>,
    /// Channels by symbol: measured, then each model.
    pub channels: BTreeMap<&'static str, Vec<Vec<Option<f32>>>>,
}

/// Short names of the states, in their order.
const STATES: [&str; 8] = ["phi", "theta", "V", "p", "q", "r", "alpha", "beta"];

/// A free run that is asked for.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunRequest {
    /// The flight.
    pub flight: usize,
    /// Where it starts, s on the log's clock.
    pub time_s: f64,
    /// How long it is, s.
    pub seconds: f64,
}

/// A free run of each model.
#[derive(Clone, Debug, Serialize)]
pub struct FreeRun {
    /// The runs: of the model as given, then as amended.
    pub runs: Vec<OneRun>,
}

/// A free run of one model.
#[derive(Clone, Debug, Serialize)]
pub struct OneRun {
    /// The model.
    pub model: String,
    /// Time on the log's clock, s.
    pub time_s: Vec<f64>,
    /// The states by name, in °, °/s and m/s.
    pub states: BTreeMap<&'static str, Vec<Option<f32>>>,
}

impl Bench {
    /// Everything but the curves, as JSON.
    ///
    /// # Errors
    /// A number has no place in JSON.
    pub fn state(&self) -> Result<Value, WorkbenchError> {
        let inner = self.lock();
        let session = &inner.session;
        let key = inner.key("diagnosis", &[]);
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
            flights: (0..session.logs.len()).map(|k| self.flight_view(&inner, k)).collect(),
            diagnosis: json!({
                "there": inner.diagnosis.as_ref().is_some_and(|(of, _)| *of == key),
                "error": inner.failures.get(&key),
                "key": key,
            }),
            stack: (1..=session.effects.len()).map(|count| step(&inner, count)).collect(),
            redo: session.undone.last().map(|e| e.id.as_str()),
            openings: &session.openings,
            jobs: &inner.jobs,
            commands: self.commands(&inner),
        };
        Ok(serde_json::to_value(&state)?)
    }

    fn flight_view<'a>(&self, inner: &'a Inner, k: usize) -> FlightView<'a> {
        let log = &inner.session.logs[k];
        let locked = locked(inner, log);
        let loaded = inner.flights[k].as_ref();
        FlightView {
            name: log.name(),
            path: self.folder.join(&log.path).display().to_string(),
            role: log.role,
            locked,
            error: loaded.err().map(String::as_str),
            about: loaded.ok().map(|flight| about(flight, locked)),
        }
    }

    /// The diagnosis as `greylag diagnose --json` writes it; `null` if there is none.
    pub fn diagnosis(&self) -> Value {
        let inner = self.lock();
        let key = inner.key("diagnosis", &[]);
        let known = inner.diagnosis.as_ref().filter(|(of, _)| *of == key);
        known.map_or(Value::Null, |(_, value)| value.as_ref().clone())
    }

    /// Where the models fail on the flights to fit to and held out.
    ///
    /// # Errors
    /// No flight can be compared.
    pub fn failing(&self) -> Result<Value, WorkbenchError> {
        let comparison = self.comparison()?;
        let inner = self.lock();
        let place = |f: &FlightResult| inner.session.logs.iter().position(|l| l.name() == f.name);
        let view = FailingView {
            flights: comparison.flights.iter().filter_map(place).collect(),
            models: &comparison.models,
            notes: &comparison.notes,
        };
        Ok(serde_json::to_value(&view)?)
    }

    /// The flight over time, measured and by the models.
    ///
    /// # Errors
    /// There is no such flight, or it may not be seen yet.
    pub fn flight(&self, place: usize) -> Result<FlightData, WorkbenchError> {
        let (flight, role) = self.seen(place)?;
        let name = flight.flight.name.clone();
        let of = |comparison: &Comparison| {
            let k = comparison.flights.iter().position(|f| f.name == name)?;
            Some(data(&flight.prepared, comparison, k))
        };
        if matches!(role, Role::Fit | Role::HoldOut) {
            let comparison = self.comparison()?;
            return of(&comparison).ok_or(WorkbenchError::NoFlight(place));
        }
        let models = self.lock().models();
        let flights = std::slice::from_ref(&flight.flight);
        let comparison = compare(&models, flights, &compare::Options::default(), &unheard)?;
        of(&comparison).ok_or(WorkbenchError::NoFlight(place))
    }

    /// Free runs of the models from a moment of a flight.
    ///
    /// # Errors
    /// The flight may not be seen, or is not flown at that moment.
    pub fn free_run(&self, request: RunRequest) -> Result<FreeRun, WorkbenchError> {
        let (flight, _) = self.seen(request.flight)?;
        let models = self.lock().models();
        let seconds = request.seconds.clamp(0.1, LONGEST_S);
        let run = |model: &crate::model::GreyBox| {
            let path = free_run::from_moment(model, &flight.prepared, request.time_s, seconds)?;
            Some(OneRun {
                model: model.name.clone(),
                time_s: path.time_s.clone(),
                states: named(&path.states, &(0..path.time_s.len()).collect::<Vec<_>>()),
            })
        };
        let runs = models.iter().map(run).collect::<Option<Vec<_>>>();
        Ok(FreeRun { runs: runs.ok_or(WorkbenchError::NotFlown(request.time_s))? })
    }

    /// A flight whose data may be seen.
    fn seen(&self, place: usize) -> Result<(Arc<Loaded>, Role), WorkbenchError> {
        let inner = self.lock();
        let log = inner.session.logs.get(place).ok_or(WorkbenchError::NoFlight(place))?;
        if locked(&inner, log) {
            return Err(WorkbenchError::Locked(log.name()));
        }
        let flight = inner.flights[place].as_ref().ok().cloned();
        Ok((flight.ok_or(WorkbenchError::NoFlight(place))?, log.role))
    }
}

/// Whether a flight is a test that no judgement has opened.
fn locked(inner: &Inner, log: &LogEntry) -> bool {
    let opened = inner.session.openings.iter().any(|o| o.flights.contains(&log.name()));
    log.role == Role::Test && !opened
}

fn about(flight: &Loaded, locked: bool) -> About<'_> {
    let info = &flight.info;
    let nuisance = |n: &crate::sysid::flight_path::reconstruction::Nuisance| json!({ "name": n.name, "value": n.value, "sd": n.sd, "unit": n.unit });
    About {
        format: info.format,
        rate_hz: info.rate_hz,
        from_s: info.from_s,
        to_s: info.to_s,
        flight_s: info.flight_s,
        in_doubt: flight.in_doubt(),
        phases: &info.phases,
        purposes: &info.purposes,
        findings: info.findings.iter().map(FindingView::of).collect(),
        nuisances: flight.flight.nuisances.iter().map(nuisance).collect(),
        notes: &flight.flight.notes,
        strip: (!locked).then(|| flight.strip()),
    }
}

/// The accepted effect number `count`, counted from one.
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
        description: crate::physics::catalogue::describe(&effect.id).map_or("", |a| a.description),
        anyway: effect.anyway,
        status,
        error: error.filter(|_| status == "failed"),
        estimated: estimate.map(|(_, e)| json!(e.after)),
        story: fitted.map(|f| f.story.clone()),
        on_fit: fitted.map(|f| f.on_fit.clone()),
    }
}

/// A flight over time, number `k` of the comparison.
fn data(flight: &Prepared, comparison: &Comparison, k: usize) -> FlightData {
    let trace = &comparison.flights[k].trace;
    let every = trace.time_s.len().div_ceil(ROWS).max(1);
    let gap = |i: usize| trace.states[2][i].is_nan();
    let kept: Vec<usize> =
        (0..trace.time_s.len()).filter(|i| i.is_multiple_of(every) || gap(*i)).collect();
    let take = |list: &[f64], factor: f64| kept.iter().map(|i| some(factor * list[*i])).collect();
    let degrees = 1_f64.to_degrees();
    let [aileron, elevator, throttle] = &trace.controls;
    let controls = [
        ("aileron", take(aileron, degrees)),
        ("elevator", take(elevator, degrees)),
        ("throttle", take(throttle, 1.0)),
    ];
    let channels = |id: &ChannelId| {
        let of = |m: &ModelResult| m.traces[k].channels.iter().find(|c| c.channel == *id).cloned();
        let all: Vec<_> = comparison.models.iter().filter_map(of).collect();
        let measured = all.first()?.measured.iter().map(|x| some(*x)).collect();
        let predicted = all.iter().map(|c| c.predicted.iter().map(|x| some(*x)).collect());
        Some((id.symbol(), std::iter::once(measured).chain(predicted).collect()))
    };
    let windows = rows(flight);
    let regime = |(v, variable): (usize, &RegimeVariable)| {
        let values = windows.iter().map(|w| w.and_then(|w| some(flight.windows[w].regime[v])));
        (word(*variable), values.collect())
    };
    FlightData {
        name: comparison.flights[k].name.clone(),
        time_s: kept.iter().map(|i| clock(trace.time_s[*i])).collect(),
        states: named(&trace.states, &kept),
        controls: controls.into_iter().collect(),
        window_s: comparison.models[0].traces[k]
            .channels
            .first()
            .map_or_else(Vec::new, |c| c.time_s.iter().map(|t| clock(*t)).collect()),
        regimes: RegimeVariable::CONTINUOUS.iter().enumerate().map(regime).collect(),
        channels: ChannelId::ALL.iter().filter_map(channels).collect(),
    }
}

/// The windows in the rows of a channel's trace, which has one of its own between segments.
fn rows(flight: &Prepared) -> Vec<Option<usize>> {
    let mut rows = Vec::with_capacity(flight.windows.len());
    for (k, window) in flight.windows.iter().enumerate() {
        if k > 0 && flight.windows[k - 1].segment != window.segment {
            rows.push(None);
        }
        rows.push(Some(k));
    }
    rows
}

/// The states by name, in °, °/s and m/s, at `kept` rows.
fn named(states: &[Vec<f64>; 8], kept: &[usize]) -> BTreeMap<&'static str, Vec<Option<f32>>> {
    let of = |(name, list): (&&'static str, &Vec<f64>)| {
        let factor = if *name == "V" { 1.0 } else { 1_f64.to_degrees() };
        (*name, kept.iter().map(|i| some(factor * list[*i])).collect())
    };
    STATES.iter().zip(states).map(of).collect()
}

/// A variable as JSON has it.
fn word(variable: RegimeVariable) -> String {
    match serde_json::to_value(variable) {
        Ok(Value::String(word)) => word,
        _ => variable.name().to_owned(),
    }
}

/// Five digits of a number, which a screen does not show; nothing of what is none.
fn some(x: f64) -> Option<f32> {
    if x == 0.0 {
        return Some(0.0);
    }
    let unit = 10_f64.powi(4 - x.abs().log10().floor() as i32);
    Some(((x * unit).round() / unit) as f32).filter(|x| x.is_finite())
}

/// A time to 0.1 ms.
fn clock(time_s: f64) -> Option<f64> {
    Some((time_s * 1e4).round() / 1e4).filter(|t| t.is_finite())
}
