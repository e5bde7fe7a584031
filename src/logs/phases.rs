//! Splits a log into phases on the ground and in flight, and at gaps.

use serde::Serialize;

use super::Sample;

/// States when the aircraft counts as flying, and how much flight time a study of the log needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flying {
    /// Airspeed above which the aircraft counts as flying, m/s.
    pub from_mps: f64,
    /// Time for which the airspeed must stay above `from_mps`, s.
    pub sustained_s: f64,
    /// Shortest flight time with which a log can be studied, s.
    pub shortest_s: f64,
    /// Time without rows up to which a phase is not split, s. It covers the time between the kept stretches of a long
    /// log and is otherwise 0.
    pub bridged_s: f64,
}

impl Default for Flying {
    /// Criteria for an unknown aircraft.
    fn default() -> Flying {
        Flying { from_mps: 7.0, sustained_s: 2.0, shortest_s: 5.0, bridged_s: 0.0 }
    }
}

impl Flying {
    /// Criteria for an aircraft that flies above `airspeed`, m/s.
    ///
    /// The time constants of the motion scale with V/g (Froude scaling), so a slower aircraft needs less time than
    /// the default. A faster aircraft has the default times.
    pub fn from(airspeed: f64) -> Flying {
        let usual = Flying::default();
        let share = (airspeed / usual.from_mps).min(1.0);
        Flying {
            from_mps: airspeed,
            sustained_s: share * usual.sustained_s,
            shortest_s: share * usual.shortest_s,
            bridged_s: 0.0,
        }
    }
}

/// A log is split where the time between two rows exceeds this limit (s) and three sample periods.
const GAP_S: f64 = 0.1;

/// Kind of a phase.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum PhaseKind {
    /// The aircraft is on the ground, at rest or rolling.
    Ground,
    /// The aircraft is airborne.
    Flight,
}

/// A stretch of a log without gaps, either on the ground or in flight.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Phase {
    /// Kind of the phase.
    pub kind: PhaseKind,
    /// Time of the first row, s.
    pub from_s: f64,
    /// Time of the last row, s.
    pub to_s: f64,
    /// Number of rows in the phase.
    pub rows: usize,
}

/// The time between rows above which a log is split, s.
pub fn split_s(rows: &[Sample]) -> f64 {
    let times: Vec<f64> = rows.iter().map(|s| s.time_s).collect();
    GAP_S.max(3.0 * super::topics::period_s(&times))
}

/// The phases of a log in order of time.
pub fn phases(rows: &[Sample], flies: &Flying) -> Vec<Phase> {
    let split = split_s(rows).max(flies.bridged_s);
    let flying = |airspeed: f64| {
        if airspeed > flies.from_mps { PhaseKind::Flight } else { PhaseKind::Ground }
    };
    let mut raw: Vec<Phase> = Vec::new();
    // airspeed sampled more slowly than the rows is held until its next sample
    let mut airspeed = f64::NAN;
    for row in rows.iter().filter(|s| s.time_s.is_finite()) {
        if row.airspeed_mps.is_finite() {
            airspeed = row.airspeed_mps;
        } else if airspeed.is_nan() {
            continue;
        }
        let kind = flying(airspeed);
        match raw.last_mut() {
            Some(p) if row.time_s - p.to_s <= split && p.kind == kind => {
                p.to_s = row.time_s;
                p.rows += 1;
            }
            _ => raw.push(Phase { kind, from_s: row.time_s, to_s: row.time_s, rows: 1 }),
        }
    }
    // A phase shorter than `sustained_s` is merged with the preceding one. At the start or after a gap it counts as ground.
    let mut out: Vec<Phase> = Vec::new();
    for mut phase in raw {
        let short = phase.to_s - phase.from_s < flies.sustained_s;
        match out.last_mut() {
            Some(last)
                if phase.from_s - last.to_s <= split && (short || last.kind == phase.kind) =>
            {
                last.to_s = phase.to_s;
                last.rows += phase.rows;
            }
            _ => {
                if short {
                    phase.kind = PhaseKind::Ground;
                }
                out.push(phase);
            }
        }
    }
    out
}
