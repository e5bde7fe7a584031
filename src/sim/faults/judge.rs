//! Checks a flight under faults against requirements, at every step and at the end of the flight. A finding is a violated
//! requirement. An exposure is a condition that the companion cannot prevent, such as missing commands.

use greylag_sitl::plant::Truth;

use super::mix::FaultKind;
use greylag_flight::pilot::{Decision, Source, TICK_S};
use greylag_physics::Command;
use greylag_physics::airframe::Envelope;

/// Largest accepted excess of bank and pitch over the envelope, degrees. A gust causes about this excess while the surfaces
/// move at their slew limit.
pub(super) const OVERSHOOT_DEG: f64 = 15.0;
/// Ratio of the envelope's smallest airspeed to the airspeed below which there is a finding. The dynamic pressure at this
/// lower airspeed, near the stall, is half of that at the envelope's smallest airspeed.
pub(super) const ABOVE_STALL: f64 = std::f64::consts::SQRT_2;
/// Largest accepted altitude loss in a flight of turns, climbs and descents that starts at 600 m, m.
const ALTITUDE_LOSS_M: f64 = 200.0;
/// Largest accepted roll error at the end, degrees. Twice this error is accepted in pitch.
const RECOVERED_DEG: f64 = 3.0;
/// Rounding tolerance for the change of a surface command in one step, where the command is −1..1.
const ROUNDING: f64 = 1e-9;
/// Number of steps with constant actuators after which the aircraft counts as uncommanded: 0.2 s.
const UNSTEERED: u32 = 20;
/// Number of 10 ms steps after which an exposure no longer explains a finding. Airspeed and altitude take long to recover.
/// Bank and pitch recover within 0.5 s after control is regained and have the shorter limit `MEMORY_OF_ATTITUDE`.
const MEMORY: u64 = 300;
const MEMORY_OF_ATTITUDE: u64 = 100;

/// A violated requirement. A finding on the companion itself is never attributed to a cause.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Finding {
    /// The companion program panicked.
    Panic,
    /// A command was not finite, or out of range.
    Command,
    /// A surface command exceeded the slew limit.
    Slew,
    /// Control was not returned to the flight controller within 0.5 s after the link had failed.
    SlowHandBack,
    /// The aircraft hit the ground, or a state was not finite.
    Crash,
    /// Bank or pitch was more than 15° outside the envelope.
    Attitude,
    /// Airspeed was below the envelope's smallest divided by √2 (near the stall), or above the envelope's largest.
    Airspeed,
    /// More than 200 m of altitude were lost.
    Altitude,
    /// The attitude at the end differed by more than 3° in roll or 6° in pitch from the required attitude.
    NotRecovered,
    /// A full disk was not reported.
    Unreported,
}

/// Exposures of the aircraft at one step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Exposure {
    /// The actuators hold their position because no command arrives, or the flight controller holds its own attitude
    /// because targets are missing.
    pub unsteered: bool,
    /// No state is usable, and no other pilot can fly.
    pub blind: bool,
    /// A sensor shows a plausible wrong value.
    pub misled: bool,
}

/// Cause of a finding on the aircraft.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Cause {
    /// At some time in the last 3 s (1 s for bank and pitch) no command had arrived for at least 0.2 s.
    Unsteered,
    /// At some time in the same interval no state was usable, and the vehicle cannot fly by itself.
    Blind,
    /// At some time in the same interval a sensor showed a plausible wrong value.
    Misled,
    /// No fault is the cause: the same flight without faults has the finding too.
    Itself,
}

impl Found {
    /// Whether `cause` is suspected and no cause has been established yet.
    pub(super) fn is_open_to(&self, cause: Cause) -> bool {
        self.cause.is_none() && self.suspects.contains(&Some(cause))
    }
}

impl Cause {
    /// The causes that faults produce.
    pub const OF_FAULTS: [Cause; 3] = [Cause::Unsteered, Cause::Blind, Cause::Misled];

    /// The name in tables and reports.
    pub fn name(self) -> &'static str {
        match self {
            Cause::Unsteered => "unsteered",
            Cause::Blind => "blind",
            Cause::Misled => "misled",
            Cause::Itself => "by itself",
        }
    }

    /// Whether faults of `kind` can produce the cause.
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

/// A finding with its time and causes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// Time of the finding, s.
    pub at_s: f64,
    /// The requirement that was violated.
    pub finding: Finding,
    /// Established cause. `None` if no cause is established, and for findings on the companion.
    pub cause: Option<Cause>,
    /// Possible causes: the exposures that were active at the time of the finding or shortly before.
    pub suspects: [Option<Cause>; 3],
}

impl Finding {
    /// All requirements.
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

    /// Whether the finding concerns the companion itself. Such a finding is never attributed to a cause.
    pub fn is_own(self) -> bool {
        use Finding::*;
        matches!(self, Panic | Command | Slew | SlowHandBack | Unreported)
    }

    /// The name in tables and reports.
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

/// Checks one flight and keeps its findings.
#[derive(Clone, Debug)]
pub struct Judge {
    envelope: Envelope,
    last: Option<Command>,
    start_m: Option<f64>,
    findings: Vec<Found>,
    /// Number of finished steps of 10 ms.
    steps: u64,
    /// Number of consecutive uncommanded steps.
    unsteered: u32,
    blind: bool,
    /// Last step at which each cause was active.
    causes: [(Cause, Option<u64>); 3],
}

impl Judge {
    /// A check of one flight of an aircraft with `envelope`, without findings.
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

    /// Records a finding. Only the first finding of each kind counts.
    pub fn note(&mut self, at_s: f64, finding: Finding) {
        if !self.findings.iter().any(|known| known.finding == finding) {
            let suspects = if finding.is_own() { [None; 3] } else { self.suspects(finding) };
            self.findings.push(Found { at_s, finding, cause: None, suspects });
        }
    }

    /// Time of the step in progress, s.
    pub fn now_s(&self) -> f64 {
        self.steps as f64 * TICK_S
    }

    /// The causes that are active now or were active recently.
    fn suspects(&self, finding: Finding) -> [Option<Cause>; 3] {
        let memory = if finding == Finding::Attitude { MEMORY_OF_ATTITUDE } else { MEMORY };
        let recent = |at: u64| self.steps - at < memory;
        self.causes.map(|(cause, at)| at.is_some_and(recent).then_some(cause))
    }

    /// Whether the last decision was made without a usable state.
    pub fn is_blind(&self) -> bool {
        self.blind
    }

    /// Whether the last step exposed the aircraft to a condition that its companion cannot prevent.
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

    /// Checks that the command of a decision is finite, in range and within the slew limit.
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

    /// Checks attitude, airspeed and altitude loss of the aircraft.
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

    /// Checks the final attitude against the required roll and pitch, degrees.
    pub fn end(&mut self, now_s: f64, truth: &Truth, [roll, pitch]: [f64; 2]) {
        let roll_off = (truth.roll_rad.to_degrees() - roll).abs();
        let pitch_off = (truth.pitch_rad.to_degrees() - pitch).abs();
        if roll_off > RECOVERED_DEG || pitch_off > 2.0 * RECOVERED_DEG {
            self.note(now_s, Finding::NotRecovered);
        }
    }

    /// All findings so far.
    pub fn findings(self) -> Vec<Found> {
        self.findings
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use greylag_physics::Airframe;

    #[test]
    fn a_finding_after_a_panic_has_the_time_of_its_step() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../params/x8/airframe.toml");
        let mut judge = Judge::new(Airframe::load(std::path::Path::new(path)).unwrap().envelope);
        (0..150).for_each(|_| judge.suffer(Exposure::default()));
        assert!((judge.now_s() - 1.5).abs() < 1e-9);
    }
}
