//! The judge of a flight under faults: what must hold at every step, and at the end.

use greylag_sitl::plant::Truth;

use super::mix::FaultKind;
use greylag_flight::pilot::{Decision, Source};
use greylag_physics::Command;
use greylag_physics::airframe::Envelope;

/// Overshoot of bank and pitch beyond the envelope that is still no violation, degrees: a gust of
/// the surfaces' full slew takes about so far.
pub(super) const OVERSHOOT_DEG: f64 = 15.0;
/// The least airspeed of the envelope over that at which an airspeed is a finding: half the dynamic pressure, about the
/// stall.
pub(super) const ABOVE_STALL: f64 = std::f64::consts::SQRT_2;
/// Altitude that a flight of turns, climbs and descents may lose, m, of the 600 it begins at.
const ALTITUDE_LOSS_M: f64 = 200.0;
/// Attitude error at the end that counts as recovered, degrees.
const RECOVERED_DEG: f64 = 3.0;
/// Rounding of a step of the surfaces.
const ROUNDING: f64 = 1e-9;
/// Steps of the actuators standing still that are a stretch in which nobody steers: 0.2 s.
const UNSTEERED: u32 = 20;
/// An exposure that ended so many steps ago no longer explains anything. Bank and pitch are arrested within half a
/// second once somebody steers again; airspeed and altitude take longer to come back.
const MEMORY: u64 = 300;
const MEMORY_OF_ATTITUDE: u64 = 100;

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
    /// A disk was full, and it was not reported.
    Unreported,
}

/// What an aircraft suffers that its companion cannot help.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Exposure {
    /// The actuators stand where they stood, since nothing new has arrived, and nobody else flies.
    pub unsteered: bool,
    /// There is no state to fly on, and nobody else to hand the aircraft to.
    pub blind: bool,
    /// A sensor lies within what an aircraft may show.
    pub misled: bool,
}

/// What explains that an aircraft left its envelope.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Cause {
    /// No command reached it for 0.2 s or more, a moment ago.
    Unsteered,
    /// Without a state to fly on a moment ago, at a vehicle that cannot fly by itself.
    Blind,
    /// A sensor showed a believable wrong value a moment ago.
    Misled,
    /// None of the faults: the same flight without any has it too.
    Itself,
}

impl Found {
    /// Whether `cause` might explain it, and nothing else does yet.
    pub(super) fn is_open_to(&self, cause: Cause) -> bool {
        self.cause.is_none() && self.suspects.contains(&Some(cause))
    }
}

impl Cause {
    /// Those that faults bring about.
    pub const OF_FAULTS: [Cause; 3] = [Cause::Unsteered, Cause::Blind, Cause::Misled];

    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Cause::Unsteered => "unsteered",
            Cause::Blind => "blind",
            Cause::Misled => "misled",
            Cause::Itself => "by itself",
        }
    }

    /// Whether it is the doing of faults of `kind`.
    pub fn is_of(self, kind: FaultKind) -> bool {
        let lie = matches!(kind, FaultKind::Airspeed | FaultKind::Alpha);
        match self {
            Cause::Misled => lie,
            Cause::Unsteered | Cause::Blind => {
                !lie && !matches!(kind, FaultKind::Client | FaultKind::Disk)
            }
            Cause::Itself => false,
        }
    }
}

/// A finding with its circumstances.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// When, s.
    pub at_s: f64,
    /// What.
    pub finding: Finding,
    /// What explains it, of those that may be explained: the aircraft's, not the companion's.
    pub cause: Option<Cause>,
    /// What might have, by the moment alone.
    pub suspects: [Option<Cause>; 3],
}

impl Finding {
    /// All of them.
    pub const ALL: [Finding; 10] = [
        Finding::Panic,
        Finding::Command,
        Finding::Slew,
        Finding::SlowHandBack,
        Finding::Crash,
        Finding::Attitude,
        Finding::Airspeed,
        Finding::Altitude,
        Finding::NotRecovered,
        Finding::Unreported,
    ];

    /// Whether it is the companion's own, which nothing excuses.
    pub fn is_own(self) -> bool {
        use Finding::*;
        matches!(self, Panic | Command | Slew | SlowHandBack | Unreported)
    }

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
            Finding::Unreported => "unreported",
        }
    }
}

/// The judge.
#[derive(Clone, Debug)]
pub struct Judge {
    envelope: Envelope,
    last: Option<Command>,
    start_m: Option<f64>,
    findings: Vec<Found>,
    steps: u64,
    /// Steps for which nobody has steered by now.
    unsteered: u32,
    blind: bool,
    /// The last step of each cause.
    causes: [(Cause, Option<u64>); 3],
}

impl Judge {
    /// A judge by an envelope.
    pub fn new(envelope: Envelope) -> Self {
        Judge {
            envelope,
            last: None,
            start_m: None,
            findings: Vec::new(),
            steps: 0,
            unsteered: 0,
            blind: false,
            causes: Cause::OF_FAULTS.map(|cause| (cause, None)),
        }
    }

    /// Notes a finding; the first of each kind counts.
    pub fn note(&mut self, at_s: f64, finding: Finding) {
        if !self.findings.iter().any(|known| known.finding == finding) {
            let suspects = if finding.is_own() { [None; 3] } else { self.suspects(finding) };
            self.findings.push(Found { at_s, finding, cause: None, suspects });
        }
    }

    /// The causes in force, or of a moment ago.
    fn suspects(&self, finding: Finding) -> [Option<Cause>; 3] {
        let memory = if finding == Finding::Attitude { MEMORY_OF_ATTITUDE } else { MEMORY };
        let recent = |at: u64| self.steps - at < memory;
        self.causes.map(|(cause, at)| at.is_some_and(recent).then_some(cause))
    }

    /// Whether the last decision was made without a state to fly on.
    pub fn is_blind(&self) -> bool {
        self.blind
    }

    /// Whether the last step exposed the aircraft to what its companion cannot help.
    pub fn is_exposed(&self) -> bool {
        self.causes.iter().any(|(_, at)| *at == Some(self.steps))
    }

    fn suffer(&mut self, exposure: Exposure) {
        self.steps += 1;
        self.unsteered = if exposure.unsteered { self.unsteered + 1 } else { 0 };
        let acting = [self.unsteered >= UNSTEERED, exposure.blind, exposure.misled];
        for ((_, at), acts) in self.causes.iter_mut().zip(acting) {
            if acts {
                *at = Some(self.steps);
            }
        }
    }

    /// Judges a decision.
    pub fn decision(&mut self, now_s: f64, decision: &Decision) {
        let c = decision.command;
        self.blind = decision.source == Source::Level;
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
    pub fn aircraft(&mut self, now_s: f64, truth: &Truth, exposure: Exposure) {
        self.suffer(exposure);
        let start = *self.start_m.get_or_insert(truth.altitude_m);
        let e = self.envelope;
        let (roll, pitch) = (truth.roll_rad.to_degrees(), truth.pitch_rad.to_degrees());
        let inside = roll.abs() <= e.bank_max_deg + OVERSHOOT_DEG
            && pitch <= e.pitch_max_deg + OVERSHOOT_DEG
            && pitch >= e.pitch_min_deg - OVERSHOOT_DEG;
        if !inside {
            self.note(now_s, Finding::Attitude);
        }
        let stall = e.airspeed_min_mps / ABOVE_STALL;
        if !(stall..=e.airspeed_max_mps).contains(&truth.airspeed_mps) {
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

    /// What was found.
    pub fn findings(self) -> Vec<Found> {
        self.findings
    }
}
