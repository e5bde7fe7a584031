//! Phases of a log: on the ground, in flight, split at gaps.

use serde::Serialize;

use super::Sample;

/// From when on an aircraft is taken to fly, and how much of it a study needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flying {
    /// Airspeed above which it flies, m/s.
    pub from_mps: f64,
    /// How long it must stay above, s.
    pub sustained_s: f64,
    /// Flight below which a verdict would rest on too little, s.
    pub shortest_s: f64,
    /// Time without rows that is no gap, s: between the stretches of a long log that are looked at.
    pub bridged_s: f64,
}

impl Default for Flying {
    /// For an aircraft that nothing is known of.
    fn default() -> Flying {
        Flying { from_mps: 7.0, sustained_s: 2.0, shortest_s: 5.0, bridged_s: 0.0 }
    }
}

impl Flying {
    /// For an aircraft that flies from an airspeed on, m/s.
    ///
    /// The times of its motions go with V/g (Froude's law), so that a slower aircraft needs less time. A
    /// faster one gets no more than the usual.
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

/// A gap that splits the log, s, unless the log is slower than that.
const GAP_S: f64 = 0.1;

/// Kind of a phase.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum PhaseKind {
    /// The aircraft stands or rolls.
    Ground,
    /// The aircraft is airborne.
    Flight,
}

/// A stretch of a log without gaps in which the aircraft does one thing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Phase {
    /// Kind of the phase.
    pub kind: PhaseKind,
    /// Time of the first row, s.
    pub from_s: f64,
    /// Time of the last row, s.
    pub to_s: f64,
    /// Number of rows in it.
    pub rows: usize,
}

/// The time between rows above which a log is split, s.
pub fn split_s(rows: &[Sample]) -> f64 {
    let times: Vec<f64> = rows.iter().map(|s| s.time_s).collect();
    GAP_S.max(3.0 * super::topics::period_s(&times))
}

/// The phases of a log in order.
pub fn phases(rows: &[Sample], flies: &Flying) -> Vec<Phase> {
    let split = split_s(rows).max(flies.bridged_s);
    let flying = |airspeed: f64| {
        if airspeed > flies.from_mps { PhaseKind::Flight } else { PhaseKind::Ground }
    };
    let mut raw: Vec<Phase> = Vec::new();
    // an airspeed that comes more slowly than the rows holds until the next one
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
    // What is too short takes the kind of what it touches.
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
