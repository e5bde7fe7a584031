//! Input of a flight report.

pub(super) mod page;
pub(super) mod quality;
pub(super) mod targets;
pub(super) mod verdict;

use crate::Sight;
use crate::{LoopTiming, Page};
use greylag_control::quality::{Limits, Quality};
use greylag_logs::Flight;
use greylag_sysid::compare::Comparison;

/// A flight with what is known about it.
#[derive(Clone, Debug)]
pub struct FlightReport<'a> {
    /// Title of the page.
    pub title: String,
    /// Log of the flight.
    pub flight: &'a Flight,
    /// Name of the controller that flew.
    pub controller: String,
    /// Name of the model it flew with.
    pub model: String,
    /// Seed of everything random in the flight; `None` when nothing was random or the seed is not known.
    pub seed: Option<u64>,
    /// The command line that made the flight.
    pub command_line: String,
    /// Programs and their versions.
    pub versions: Vec<(String, String)>,
    /// The schedule, in time order; empty when no target was set.
    pub segments: Vec<Segment>,
    /// Largest settled error that counts as tracked, rad.
    pub tolerance_rad: f64,
    /// The envelope that the flight is measured against; `None` when the aircraft is not known.
    pub envelope: Option<EnvelopeFlown>,
    /// Deflections at full command, with which commands are drawn as deflections.
    pub travel: SurfaceTravel,
    /// Durations of the control cycles; `None` when they were not recorded.
    pub timing: Option<LoopTiming>,
    /// Events of the flight, in time order.
    pub events: Vec<Event>,
    /// Prediction errors of the model on this flight; `None` if they were not computed.
    pub comparison: Option<Comparison>,
    /// Insight into the planner at some ticks; empty if no planner flew.
    pub sights: Vec<Sight>,
    /// The next command, ready to be copied; empty if none is known.
    pub next: String,
}

/// Flight envelope with which a flight is compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnvelopeFlown {
    /// The limits of the aircraft.
    pub limits: Limits,
    /// Airspeed from which a sample counts as flight, m/s.
    pub flying_from_mps: f64,
}

/// Deflections at a command of +1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceTravel {
    /// Deflection of the aileron, rad.
    pub aileron_rad: f64,
    /// Deflection of the elevator, rad.
    pub elevator_rad: f64,
}

/// A part of the schedule with one target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// When the target was set, s, on the flight's clock.
    pub start_s: f64,
    /// When it ended, s.
    pub end_s: f64,
    /// Commanded roll angle, rad.
    pub roll_target_rad: f64,
    /// Commanded pitch angle, rad.
    pub pitch_target_rad: f64,
    /// How far the target is from level flight.
    pub difficulty: Difficulty,
    /// Settled error: mean of the roll and pitch RMS errors over the last fifth, rad; NaN when it
    /// could not be determined.
    pub settled_error_rad: f64,
}

impl Segment {
    /// Whether the settled error is within `tolerance_rad`; one that could not be determined is not.
    pub fn tracked(&self, tolerance_rad: f64) -> bool {
        self.settled_error_rad <= tolerance_rad
    }
}

/// How far a target is from level flight, by the groups of the evaluation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Difficulty {
    /// |roll| below 45° with |pitch| below 25°.
    Easy,
    /// Any other target: |roll| from 45° up, or |pitch| from 25° up.
    Hard,
}

impl Difficulty {
    /// Name of the group in tables.
    pub fn name(self) -> &'static str {
        match self {
            Difficulty::Easy => "easy",
            Difficulty::Hard => "hard",
        }
    }
}

/// An event at an instant.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// When, s, on the flight's clock.
    pub time_s: f64,
    /// Kind of the event.
    pub kind: EventKind,
    /// Description of the event for the reader.
    pub text: String,
}

/// Kinds of events in a flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EventKind {
    /// The flight controller changed its mode.
    Mode,
    /// A message was sent or received.
    Text,
    /// A failsafe took over.
    Failsafe,
}

impl EventKind {
    /// Name of the kind in tables.
    pub fn name(self) -> &'static str {
        match self {
            EventKind::Mode => "mode",
            EventKind::Text => "text",
            EventKind::Failsafe => "failsafe",
        }
    }
}

impl FlightReport<'_> {
    /// Number of segments that were tracked.
    pub fn tracked(&self) -> usize {
        self.segments.iter().filter(|s| s.tracked(self.tolerance_rad)).count()
    }

    /// What happened on the way to each target, in the order of the segments; `None` where the aircraft's limits are
    /// not known.
    pub fn qualities(&self) -> Option<Vec<Quality>> {
        let limits = self.envelope?.limits;
        let of = |segment: &Segment| quality::of_segment(&self.flight.samples, segment, &limits);
        Some(self.segments.iter().map(of).collect())
    }

    /// Verdict on the flight in one line.
    pub fn page_sentence(&self) -> String {
        verdict::sentence(self)
    }

    /// The page of the flight.
    pub fn page(&self) -> Page {
        page::page(self)
    }
}
