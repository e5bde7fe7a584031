//! The judge of a flight under faults: what must hold at every step, and at the end.

use greylag_sitl::plant::Truth;

use crate::flight::pilot::Decision;
use crate::physics::Command;
use crate::physics::airframe::Envelope;

/// Overshoot of bank and pitch beyond the envelope that is still no violation, degrees: a gust of
/// the surfaces' full slew takes about so far.
const OVERSHOOT_DEG: f64 = 15.0;
/// Stall speed of the X8 in level flight, m/s.
const STALL_MPS: f64 = 9.2;
/// Altitude that a flight of turns, climbs and descents may lose, m, of the 600 it begins at.
const ALTITUDE_LOSS_M: f64 = 200.0;
/// Attitude error at the end that counts as recovered, degrees.
const RECOVERED_DEG: f64 = 3.0;
/// Rounding of a step of the surfaces.
const ROUNDING: f64 = 1e-9;

/// What was found wrong. Those of the companion itself are never excused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Finding {
    /// The program panicked.
    Panic,
    /// A command was not finite, or out of range.
    Command,
    /// A surface moved faster than the slew limit.
    Slew,
    /// The aircraft was not handed back within 0.5 s of a dead link.
    SlowHandBack,
    /// The aircraft came to the ground, or left the numbers.
    Crash,
    /// Bank or pitch beyond the envelope.
    Attitude,
    /// Below the stall speed, or above the maximum airspeed.
    Airspeed,
    /// More altitude lost than allowed.
    Altitude,
    /// Not level, or not at its target, at the end.
    NotRecovered,
}

impl Finding {
    /// All of them.
    pub const ALL: [Finding; 9] = [
        Finding::Panic,
        Finding::Command,
        Finding::Slew,
        Finding::SlowHandBack,
        Finding::Crash,
        Finding::Attitude,
        Finding::Airspeed,
        Finding::Altitude,
        Finding::NotRecovered,
    ];

    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Finding::Panic => "panic",
            Finding::Command => "command",
            Finding::Slew => "slew",
            Finding::SlowHandBack => "hand-back",
            Finding::Crash => "crash",
            Finding::Attitude => "attitude",
            Finding::Airspeed => "airspeed",
            Finding::Altitude => "altitude",
            Finding::NotRecovered => "recovery",
        }
    }
}

/// The judge.
#[derive(Clone, Debug)]
pub struct Judge {
    envelope: Envelope,
    last: Option<Command>,
    start_m: Option<f64>,
    findings: Vec<(f64, Finding)>,
}

impl Judge {
    /// A judge by an envelope.
    pub fn new(envelope: Envelope) -> Self {
        Judge { envelope, last: None, start_m: None, findings: Vec::new() }
    }

    /// Notes a finding; the first of each kind counts.
    pub fn note(&mut self, now_s: f64, finding: Finding) {
        if !self.findings.iter().any(|(_, known)| *known == finding) {
            self.findings.push((now_s, finding));
        }
    }

    /// Judges a decision.
    pub fn decision(&mut self, now_s: f64, decision: &Decision) {
        let c = decision.command;
        let in_range = c.is_finite()
            && c.aileron.abs() <= 1.0
            && c.elevator.abs() <= 1.0
            && (0.0..=1.0).contains(&c.throttle);
        if !in_range {
            self.note(now_s, Finding::Command);
        }
        let limit = self.envelope.surface_slew_per_s * 0.01 + ROUNDING;
        if let Some(last) = self.last.filter(|_| decision.armed) {
            let step = (c.aileron - last.aileron).abs().max((c.elevator - last.elevator).abs());
            if step > limit {
                self.note(now_s, Finding::Slew);
            }
        }
        self.last = decision.armed.then_some(c);
    }

    /// Judges the aircraft.
    pub fn aircraft(&mut self, now_s: f64, truth: &Truth) {
        let start = *self.start_m.get_or_insert(truth.altitude_m);
        let e = self.envelope;
        let (roll, pitch) = (truth.roll_rad.to_degrees(), truth.pitch_rad.to_degrees());
        let inside = roll.abs() <= e.bank_max_deg + OVERSHOOT_DEG
            && pitch <= e.pitch_max_deg + OVERSHOOT_DEG
            && pitch >= e.pitch_min_deg - OVERSHOOT_DEG;
        if !inside {
            self.note(now_s, Finding::Attitude);
        }
        if !(STALL_MPS..=e.airspeed_max_mps).contains(&truth.airspeed_mps) {
            self.note(now_s, Finding::Airspeed);
        }
        if start - truth.altitude_m > ALTITUDE_LOSS_M {
            self.note(now_s, Finding::Altitude);
        }
    }

    /// Judges the end: where the aircraft is against where it should be, degrees.
    pub fn end(&mut self, now_s: f64, truth: &Truth, [roll, pitch]: [f64; 2]) {
        let roll_off = (truth.roll_rad.to_degrees() - roll).abs();
        let pitch_off = (truth.pitch_rad.to_degrees() - pitch).abs();
        if roll_off > RECOVERED_DEG || pitch_off > 2.0 * RECOVERED_DEG {
            self.note(now_s, Finding::NotRecovered);
        }
    }

    /// What was found, with the time of each, s.
    pub fn findings(self) -> Vec<(f64, Finding)> {
        self.findings
    }
}
