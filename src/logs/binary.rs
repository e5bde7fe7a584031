//! Resamples the topics of a binary log onto one table and checks the table. A topic is a kind of message or record with its own
//! sample rate.
//!
//! A log is read either for a computation or for an inspection (`greylag logs info`). Defects that are errors in a computation
//! become findings in an inspection. Of a long log, an inspection keeps only some stretches.

use std::path::Path;

use super::error::LogError;
use super::finding::{Finding, named};
use super::load::{Log, Options, Use, dropped, hint};
use super::phases::{self, Flying};
use super::stretches::Stretches;
use super::topics::{Naming, Topics};
use super::vehicle::{self, Kind, Vehicle};
use super::{Flight, FlowAngles, Format, Sample, assess, derive, rows, screening, table};

/// Makes a log from `topics`. `path` appears in errors, `name` is the name of the flight, `to` is the purpose.
///
/// # Errors
/// For a computation: if the log lacks a required column, has too many unusable rows, or is of a vehicle without wings.
pub(super) fn read(
    format: Format,
    mut topics: Topics,
    name: &str,
    path: &Path,
    o: &Options,
    to: Use,
) -> Result<Log, LogError> {
    let vehicle = vehicle::vehicle(format, &topics);
    let mut hovers = hovers(vehicle.as_ref(), format, &topics, o.flies.sustained_s);
    let mut findings = refused(vehicle.as_ref(), path, to)?;
    let no_wings = !findings.is_empty();
    let mut table = table::build(&topics, &o.mapping.rules(format, &topics), &o.sources);
    // the topics are freed, so that a long log is not in memory twice
    topics.topics.clear();
    let entries = o.mapping.over(std::mem::take(&mut table.entries));
    let flies = Flying { bridged_s: bridged_s(&table), ..o.flies };
    let stretches = table.whole.take().map(|whole| of_all(whole, &hovers, &o.flies));
    findings.extend(stretches.iter().map(|stretches| Finding::note(stretches.said())));
    table.missing.retain(|missing| !o.mapping.makes(missing.column));
    findings
        .extend(lacking(&table, &topics, path, to).map(|f| f.into_iter().filter(|_| !no_wings))?);
    findings.extend(std::mem::take(&mut table.findings));
    let end = table.rows.last().map_or(0.0, |row| row.time_s);
    findings.extend(grounded(&mut table.rows, &hovers, vehicle.as_ref()));
    hovers.iter_mut().for_each(|hover| hover.1 = hover.1.min(end));
    findings.extend(assess::freeze(&mut table.rows, &table.channels, &flies));
    table.rows.retain(|row| !assess::hangs(row, &table.channels));
    table.notes.extend(derive::apply(&mut table.rows, &o.mapping));
    findings.extend(topics.findings);
    if !no_wings {
        findings.extend(assess::channels(&table.channels, &table.rows, &flies));
        let found = on_wings(&mut table.rows, &hovers, &flies);
        findings.extend(found.into_iter().map(|f| named(f, &entries, format)));
    }
    let kept = kept(&mut table, path, o, to, &mut findings)?;
    findings.extend(dropped(kept.dropped, &kept.dropped_rows));
    findings.extend(table.notes.iter().map(Finding::note));
    Ok(Log {
        format,
        flight: flight(name, (kept.samples, table.notes), format, o),
        channels: table.channels,
        entries,
        topics: topics.counts.into_iter().map(|((name, i), n)| (name, i, n)).collect(),
        dropped: kept.dropped,
        dropped_rows: kept.dropped_rows,
        findings,
        flies,
        vehicle,
        hovers,
        sources: table.sources,
        life: topics.life,
        stretches,
    })
}

/// The flight `name` with its samples and notes.
fn flight(
    name: &str,
    (samples, notes): (Vec<Sample>, Vec<String>),
    format: Format,
    o: &Options,
) -> Flight {
    Flight {
        name: name.to_owned(),
        samples,
        flow_angles: flow_angles(format, o),
        sensors: o.mapping.sensors().clone(),
        unknown_columns: Vec::new(),
        notes,
    }
}

/// Time (s) without rows that must not split a phase of flight. It is longer than any interval between the kept stretches of the
/// log, and 0 if the whole log is kept.
fn bridged_s(table: &table::Table) -> f64 {
    let Some(whole) = &table.whole else { return 0.0 };
    let step = |w: &[Sample]| w[1].time_s - w[0].time_s;
    table.rows.windows(2).map(step).fold(0.0, f64::max).max(whole.stretches.length_s) + 1.0
}

/// The stretches with the phases (ground or flight) of the whole log. `hovers` are the intervals (start and end, s) in which a
/// VTOL hovers. They are left out.
fn of_all(mut whole: table::Whole, hovers: &[(f64, f64)], flies: &Flying) -> Stretches {
    whole.air.retain(|s| !hovers.iter().any(|(from, to)| (*from..*to).contains(&s.time_s)));
    let mut phases = phases::phases(&whole.air, flies);
    let (from, to) = whole.stretches.span_s;
    let rate = whole.stretches.rows as f64 / (to - from).max(f64::MIN_POSITIVE);
    phases.iter_mut().for_each(|p| p.rows = ((p.to_s - p.from_s) * rate).round() as usize + 1);
    Stretches { phases, ..whole.stretches }
}

/// Findings on `rows`, which contain wing-borne flight only. Sensors that are constant in all of them are set to NaN. `hovers` are
/// the intervals (start and end, s) of hover.
fn on_wings(rows: &mut [Sample], hovers: &[(f64, f64)], flies: &Flying) -> Vec<Finding> {
    match rows.is_empty() && !hovers.is_empty() {
        true => vec![Finding::problem(NEVER_ON_WINGS)],
        false => screening::screened(rows, flies),
    }
}

/// Text of the finding for a log in which the vehicle only hovers.
const NEVER_ON_WINGS: &str = "there is no flight in this log: the vehicle never flies on its wings alone; give a log with forward flight";

/// The finding that the vehicle has no wings, if so. In a computation it is an error.
fn refused(vehicle: Option<&Vehicle>, path: &Path, to: Use) -> Result<Vec<Finding>, LogError> {
    match vehicle.and_then(Vehicle::refusal) {
        Some(why) if to == Use::Compute => Err(LogError::Vehicle { path: path.to_owned(), why }),
        why => Ok(why.map(Finding::problem).into_iter().collect()),
    }
}

/// The finding that required columns have no data, if so. In a computation the first such column is an error.
fn lacking(
    table: &table::Table,
    topics: &Topics,
    path: &Path,
    to: Use,
) -> Result<Vec<Finding>, LogError> {
    match (&table.missing[..], to) {
        ([], _) => Ok(Vec::new()),
        ([first, ..], Use::Compute) => Err(missing_column(path, topics, first)),
        ([one], _) => Ok(vec![Finding::problem(missing_column(path, topics, one).to_string())]),
        (several, _) => {
            // columns with the same remedy are listed together
            let mut groups: Vec<(String, Vec<String>)> = Vec::new();
            for missing in several {
                let (remedy, column) = (would_fill(topics, missing), either(missing));
                match groups.iter_mut().find(|(r, _)| *r == remedy) {
                    Some((_, columns)) => columns.push(column),
                    None => groups.push((remedy, vec![column])),
                }
            }
            let list: Vec<String> =
                groups.iter().map(|(r, columns)| format!("{}: {r}", columns.join(", "))).collect();
            Ok(vec![Finding::problem(format!(
                "flight log {} has nothing for column {}; or name other sources in a mapping (--mapping); {}",
                path.display(),
                list.join("; "),
                holds(topics)
            ))])
        }
    }
}

/// Removes the rows in the intervals `hovers`, in which a VTOL is not in wing-borne flight. Returns a finding about them.
fn grounded(
    rows: &mut Vec<Sample>,
    hovers: &[(f64, f64)],
    vehicle: Option<&Vehicle>,
) -> Option<Finding> {
    let before = rows.len();
    rows.retain(|s| !hovers.iter().any(|(from, to)| (*from..*to).contains(&s.time_s)));
    let out = before - rows.len();
    let by = vehicle.map(|v| v.by.as_str()).unwrap_or_default();
    match (out, vehicle.map(|v| v.kind)) {
        (0, Some(Kind::Vtol)) if hovers.is_empty() => Some(Finding::warning(format!(
            "the vehicle hovers as well ({by}), and the log does not say when: hover is taken for flight above the flying airspeed"
        ))),
        (0, _) => None,
        (out, _) => Some(Finding::warning(format!(
            "{out} of {before} rows are left out: the vehicle hovers as well ({by}), and its lift motors carry or it changes over there"
        ))),
    }
}

/// Intervals (from, to, s) in which a VTOL is not in wing-borne flight; empty for other vehicles.
fn hovers(
    vehicle: Option<&Vehicle>,
    format: Format,
    topics: &Topics,
    shortest_s: f64,
) -> Vec<(f64, f64)> {
    match vehicle.map(|v| v.kind) {
        Some(Kind::Vtol) => vehicle::joined(vehicle::hovers(format, topics), shortest_s),
        _ => Vec::new(),
    }
}

/// Whether α and β are measured or estimated. In a DataFlash log (ArduPilot) they are the autopilot's estimates, unless a mapping
/// names a source for α.
fn flow_angles(format: Format, o: &Options) -> FlowAngles {
    match format {
        Format::Dataflash if o.mapping.get("alpha_rad").is_none() => FlowAngles::Estimated,
        _ => FlowAngles::Measured,
    }
}

/// Returns the usable rows of the flight. Too many unusable rows are an error in a computation. In an inspection they are a
/// finding, and all rows are returned. All rows are also returned if a required column has no data.
fn kept(
    table: &mut table::Table,
    path: &Path,
    o: &Options,
    to: Use,
    findings: &mut Vec<Finding>,
) -> Result<rows::Rows, LogError> {
    if !table.missing.is_empty() {
        return Ok(visible(&table.rows));
    }
    let counted = usable(&table.rows).counted(&table.rows);
    let Some(first) = counted.refused(o.tolerance) else {
        return Ok(usable(&table.rows).taken(std::mem::take(&mut table.rows)));
    };
    let (dropped, rows, hint) = (counted.dropped, counted.total, hint(findings));
    let (path, reasons) = (path.to_owned(), counted.reasons());
    let error = LogError::Unusable { path, dropped, rows, reasons, first, hint };
    if to == Use::Compute {
        return Err(error);
    }
    findings.push(Finding::problem(error.to_string()));
    Ok(visible(&table.rows))
}

/// An empty table for the usable rows of `samples`. If the airspeed is missing in any row, a usable row may have empty fields in
/// the columns of slow sensors.
fn usable(samples: &[Sample]) -> rows::Rows {
    let hangs = samples.iter().any(|s| s.airspeed_mps.is_nan());
    match hangs {
        true => rows::Rows::with_sparse_columns_of(samples),
        false => rows::Rows::default(),
    }
}

/// All rows of `samples`, complete or not, for an inspection.
fn visible(samples: &[Sample]) -> rows::Rows {
    let mut kept = rows::Rows::default();
    samples.iter().enumerate().for_each(|(i, sample)| kept.take_incomplete(i + 1, *sample));
    kept
}

fn missing_column(path: &Path, topics: &Topics, missing: &table::Missing) -> LogError {
    let or = missing.or.map(|p| format!(" (or of `{p}`)")).unwrap_or_default();
    let remedy = format!(
        "{}{or}, or name another source in a mapping (--mapping); {}",
        would_fill(topics, missing),
        holds(topics)
    );
    LogError::Missing { path: path.to_owned(), column: missing.column, remedy }
}

/// The name of the missing column, with its alternative if there is one.
fn either(missing: &table::Missing) -> String {
    match missing.or {
        Some(or) => format!("`{}` (or `{or}`)", missing.column),
        None => format!("`{}`", missing.column),
    }
}

/// Advice to the user on which records would fill the missing column.
fn would_fill(topics: &Topics, missing: &table::Missing) -> String {
    match (missing.looked_for.is_empty(), topics.naming) {
        (true, Naming::Sender) if missing.or.is_some() => "record SERVO_OUTPUT_RAW with the parameters SERVOn_FUNCTION, which say what each output moves".to_owned(),
        (true, Naming::Sender) => "record ATTITUDE, VFR_HUD and GLOBAL_POSITION_INT".to_owned(),
        (true, _) => "no topic of this format is known for it".to_owned(),
        (false, _) => format!("log {}", missing.looked_for.join(" or ")),
    }
}

/// A sentence that lists the topics of the log.
fn holds(topics: &Topics) -> String {
    let mut has: Vec<&str> = topics.counts.keys().map(|(name, _)| name.as_str()).collect();
    has.dedup();
    let has = match has.len() {
        0 => "nothing that could be decoded".to_owned(),
        1..=40 => has.join(", "),
        n => format!("{n} topics, the first of them {}", has[..40].join(", ")),
    };
    format!("the file holds {has}")
}
