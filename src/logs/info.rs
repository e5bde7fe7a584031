//! Summary of a log: its content, its length, and the channels that it lacks for each purpose, such as a comparison of moments.

use std::collections::BTreeMap;

use serde::Serialize;

use super::columns::{BLOCK, COLUMNS, index};
use super::finding::{Finding, Severity};
use super::mapping::Entry;
use super::phases::{self, Phase, PhaseKind};
use super::rudder::RudderMotion;
use super::sources::Source;
use super::vehicle::Vehicle;
use super::{Channel, Format, Log, Sample, assess, screening};

/// Summary of a log, as `greylag logs info` prints it.
#[derive(Clone, Debug, Serialize)]
pub struct Info {
    /// Name and version of the format, `greylag.log-info/1`.
    pub schema: &'static str,
    /// Name of the flight.
    pub name: String,
    /// Format of the file.
    pub format: Format,
    /// Number of rows in the table that was made from the log.
    pub rows: usize,
    /// Number of rows that were dropped as unusable.
    pub dropped_rows: usize,
    /// Time of the first row, s.
    pub from_s: f64,
    /// Time of the last row, s.
    pub to_s: f64,
    /// Rate of the rows: one over the median time between them, Hz.
    pub rate_hz: f64,
    /// Gaps that split the log: start and length, s.
    pub gaps: Vec<(f64, f64)>,
    /// Total time in flight, s.
    pub flight_s: f64,
    /// Phases of flight and ground, in order of time.
    pub phases: Vec<Phase>,
    /// Type of the vehicle; `None` if the log does not show it.
    pub vehicle: Option<Vehicle>,
    /// Intervals (from, to, s) in which a VTOL is not in wing-borne flight. Their rows are left out.
    pub hovers: Vec<(f64, f64)>,
    /// Text that names the vehicle and the boot of the autopilot of this flight, if the file contains several; otherwise `None`.
    pub life: Option<String>,
    /// All instances of each topic with more than one instance, such as two airspeed sensors.
    pub sources: Vec<Source>,
    /// Channels of the file that fill columns of the table.
    pub channels: Vec<Channel>,
    /// For each column that a single field fills: the entry of a mapping file that fills it in the same way.
    #[serde(skip)]
    pub entries: BTreeMap<String, Entry>,
    /// Purposes with the channels that the log lacks for each.
    pub purposes: Vec<Purpose>,
    /// Topics (kinds of records) of the file: name, instance, number of records.
    pub topics: Vec<(String, u16, usize)>,
    /// Defects and peculiarities of the log.
    pub findings: Vec<Finding>,
}

/// Purpose for which a log can be used.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Purpose {
    /// Name of the purpose.
    pub name: &'static str,
    /// Columns that the log lacks for the purpose; empty if the log suffices.
    pub missing: Vec<String>,
    /// Columns that are present at too low a rate.
    pub slow: Vec<String>,
    /// Sources from which absent columns are computed.
    pub instead: Vec<String>,
}

impl Info {
    /// The summary of the log `log`.
    pub fn of(log: &Log) -> Info {
        let samples = &log.flight.samples;
        let times: Vec<f64> = samples.iter().map(|s| s.time_s).collect();
        let period = super::topics::period_s(&times);
        let split = phases::split_s(samples);
        let steps = times.windows(2).map(|w| (w[0], w[1] - w[0]));
        let mut gaps: Vec<(f64, f64)> = steps.filter(|(_, step)| *step > split).collect();
        let mut rows = samples.len();
        let mut span = times.first().zip(times.last()).map_or((0.0, 0.0), |(a, b)| (*a, *b));
        if let Some(whole) = &log.stretches {
            (rows, span) = (whole.rows, whole.span_s);
            gaps = whole.gaps.iter().filter(|(_, step)| *step > split).copied().collect();
        }
        let phases = log.phases();
        let flown =
            phases.iter().filter(|p| p.kind == PhaseKind::Flight).map(|p| p.to_s - p.from_s);
        let flight_s = flown.fold(0.0, |sum, x| sum + x);
        Info {
            schema: "greylag.log-info/1",
            name: log.flight.name.clone(),
            format: log.format,
            rows,
            dropped_rows: log.dropped,
            from_s: span.0,
            to_s: span.1,
            rate_hz: if period > 0.0 { 1.0 / period } else { 0.0 },
            gaps,
            flight_s,
            phases,
            vehicle: log.vehicle.clone(),
            hovers: log.hovers.clone(),
            life: log.life.clone(),
            sources: log.sources.clone(),
            channels: log.channels.clone(),
            entries: log.entries.clone(),
            purposes: purposes(log).into_iter().map(|p| weighed(log, flight_s, p)).collect(),
            topics: log.topics.clone(),
            findings: [rudder(log), signs(log)]
                .into_iter()
                .flatten()
                .chain(log.findings.clone())
                .collect(),
        }
    }

    /// The highest severity among the findings.
    pub fn severity(&self) -> Severity {
        self.findings.iter().map(|f| f.severity).max().unwrap_or(Severity::Note)
    }
}

/// The finding that the rudder moves; `None` if it does not.
fn rudder(log: &Log) -> Option<Finding> {
    let motion = RudderMotion::of(&log.flight.samples)?;
    Some(Finding::warning(format!(
        "{motion}: unless the airframe file says that the aircraft has no rudder, a model needs \
         rudder_linear, or yaw, roll, side-force and drag residuals include its moments and forces"
    )))
}

/// The note that the flight does not show the signs of surfaces; `None` if it does, or if the log has a problem or no wings.
fn signs(log: &Log) -> Option<Finding> {
    let has_wings = log.vehicle.as_ref().is_none_or(|v| v.refusal().is_none());
    if !has_wings || log.problems().is_some() {
        return None;
    }
    screening::hidden_signs(&log.flight.samples, &log.flies)
}

/// A column counts as present if it has values in this fraction of the rows. For a slow channel, this fraction of the samples
/// that are expected at its own rate suffices.
const PRESENT: f64 = 0.5;

/// Number of rows with a value, for each column.
fn filled(samples: &[Sample]) -> [usize; COLUMNS.len()] {
    let mut counts = [0; COLUMNS.len()];
    for block in samples.chunks(BLOCK) {
        for (count, (_, get, _)) in counts.iter_mut().zip(COLUMNS) {
            *count += block.iter().filter(|s| get(s).is_finite()).count();
        }
    }
    counts
}

/// Whether `log` is a table without usable rows, for instance one without times. Its header then states what it has.
fn has_only_a_header(log: &Log) -> bool {
    log.format == Format::Csv && log.flight.samples.is_empty()
}

/// Whether `column` counts as present in `log`. `filled` has the number of rows with a value, for each column.
fn has(log: &Log, filled: &[usize; COLUMNS.len()], column: &str) -> bool {
    if has_only_a_header(log) {
        return log.entries.contains_key(column);
    }
    let samples = &log.flight.samples;
    let whole = samples.first().zip(samples.last()).map_or(0.0, |(a, b)| b.time_s - a.time_s);
    let count = index(column).map_or(0, |place| filled[place]);
    let channel = log.channels.iter().find(|c| c.columns.iter().any(|x| x == column));
    let rate = channel.map_or(f64::INFINITY, |c| c.rate_hz);
    // of a long log, only stretches are in memory
    let share = log.stretches.as_ref().map_or(1.0, |s| samples.len() as f64 / s.rows.max(1) as f64);
    let covered = rate > 0.0 && count as f64 >= PRESENT * rate * whole * share;
    count > 0 && (count as f64 >= PRESENT * samples.len() as f64 || covered)
}

/// Two lists. The first names the actuators without data. The second names those without a measured position, whose position is
/// computed from the command by the actuator model.
fn actuators(has: impl Fn(&str) -> bool) -> (Vec<String>, Vec<String>) {
    let mut missing = Vec::new();
    let mut instead = Vec::new();
    for (command, position) in super::columns::EITHER {
        match (has(command), has(position)) {
            (false, false) => missing.push(format!("{command} or {position}")),
            (true, false) => instead.push(format!("{position} through the actuator model")),
            _ => {}
        }
    }
    (missing, instead)
}

/// Adds to `purpose` what prevents it other than absent columns: no wings, no flight, or channels that are too slow.
fn weighed(log: &Log, flight_s: f64, mut purpose: Purpose) -> Purpose {
    let wings = log.vehicle.as_ref().is_none_or(|v| v.refusal().is_none());
    if !wings {
        purpose.missing = vec!["wings".into()];
        return purpose;
    }
    if log.flight.samples.is_empty() && !log.hovers.is_empty() {
        purpose.missing = vec!["a flight on its wings".into()];
        return purpose;
    }
    if has_only_a_header(log) && !log.entries.contains_key("time_s") {
        purpose.missing.insert(0, "time_s".into());
    }
    if flight_s == 0.0 && purpose.missing.is_empty() {
        purpose.missing.push("a flight".into());
    }
    let mut seen = std::collections::BTreeSet::new();
    purpose.missing.retain(|column| seen.insert(column.clone()));
    let moments = purpose.name != INCIDENCE;
    for channel in log.channels.iter().filter(|_| moments) {
        let slow = channel.columns.iter().filter_map(|c| Some((c, assess::too_slow(channel, c)?)));
        purpose.slow.extend(slow.map(|(column, wanted)| {
            format!("{column} {:.1} Hz; wanted ≥ {wanted}", assess::real_hz(channel))
        }));
    }
    purpose
}

/// Source of the air density if the log has none; empty if the log has it.
fn density(has: impl Fn(&str) -> bool) -> Vec<String> {
    match (has("air_density_kgpm3"), has("altitude_m")) {
        (true, _) => Vec::new(),
        (false, true) => {
            vec!["air density of the standard atmosphere at the logged altitude".to_owned()]
        }
        (false, false) => vec!["air density of the standard atmosphere at sea level".to_owned()],
    }
}

/// Name of the purpose for which channels of any rate suffice.
const INCIDENCE: &str = "alpha, beta";

fn purposes(log: &Log) -> Vec<Purpose> {
    let samples = &log.flight.samples;
    let filled = filled(samples);
    let has = |column: &str| has(log, &filled, column);
    let lacking = |columns: &[&str]| -> Vec<String> {
        columns.iter().filter(|c| !has(c)).map(|c| (*c).to_owned()).collect()
    };
    let (actuators, instead) = actuators(has);
    let states =
        lacking(&["roll_rad", "pitch_rad", "p_radps", "q_radps", "r_radps", "airspeed_mps"]);
    let join = |a: &[String], b: &[String]| [a, b].concat();
    let incidence = lacking(&["alpha_rad", "beta_rad"]);
    let airspeed = lacking(&["airspeed_mps"]);
    let velocity = lacking(&["vn_mps", "ve_mps", "vd_mps"]);
    let mut forces = lacking(&["ax_mps2", "ay_mps2", "az_mps2"]);
    let dense = |get: fn(&Sample) -> f64| {
        2 * samples.iter().filter(|s| get(s).is_finite()).count() > samples.len()
    };
    let by_path = !forces.is_empty() && dense(|s| s.velocity_ned_mps[0]);
    if by_path {
        forces.clear();
    }
    let named = |by: bool, text: &str| Vec::from_iter(by.then(|| text.to_owned()));
    let path = named(by_path, "specific force of the reconstructed path");
    let density = density(has);
    let rebuilt = named(
        !incidence.is_empty() && velocity.is_empty(),
        "alpha and beta from wind-corrected velocity, at a loss of power",
    );
    let no_incidence = if incidence.is_empty() {
        Vec::new()
    } else if velocity.is_empty() {
        airspeed
    } else {
        join(&incidence, &velocity)
    };
    vec![
        Purpose {
            name: "comparison in free run",
            missing: [&states[..], &actuators, &no_incidence].concat(),
            slow: Vec::new(),
            instead: [&instead[..], &rebuilt].concat(),
        },
        Purpose {
            name: "moments l, m, n",
            missing: [&states[..], &actuators].concat(),
            slow: Vec::new(),
            instead: [&instead[..], &density].concat(),
        },
        Purpose {
            name: "forces D, Y, L",
            missing: [&states[..], &actuators, &forces].concat(),
            slow: Vec::new(),
            instead: [&instead[..], &path, &density].concat(),
        },
        Purpose { name: INCIDENCE, missing: no_incidence, slow: Vec::new(), instead: rebuilt },
    ]
}
