//! Input of the report on one flight.

pub(super) mod page;
pub(super) mod quality;
pub(super) mod targets;
pub(super) mod verdict;

use crate::Sight;
use crate::{LoopTiming, Page};
use greylag_control::quality::{Limits, Quality};
use greylag_logs::Flight;
use greylag_sysid::compare::Comparison;

/// Input of the report: the log of a flight and further data about the flight.
#[derive(Clone, Debug)]
pub struct FlightReport<'a> {
    /// Title of the page.
    pub title: String,
    /// Log of the flight.
    pub flight: &'a Flight,
    /// Name of the controller that flew.
    pub controller: String,
    /// Name of the model that the controller used.
    pub model: String,
    /// Seed of the random numbers in the flight; `None` if there were none or the seed is not known.
    pub seed: Option<u64>,
    /// The command line that produced the flight.
    pub command_line: String,
    /// Names and versions of programs.
    pub versions: Vec<(String, String)>,
    /// Segments of the schedule, in time order; empty if no target was set.
    pub segments: Vec<Segment>,
    /// Largest settled error that counts as tracked, rad.
    pub tolerance_rad: f64,
    /// The envelope against which the flight is checked; `None` if the aircraft's limits are not known.
    pub envelope: Option<EnvelopeFlown>,
    /// Deflections at full command, by which the plots convert commands to deflections.
    pub travel: SurfaceTravel,
    /// Durations of the control cycles; `None` when they were not recorded.
    pub timing: Option<LoopTiming>,
    /// Events of the flight, in time order.
    pub events: Vec<Event>,
    /// Prediction errors of the model on this flight; `None` if they were not computed.
    pub comparison: Option<Comparison>,
    /// Candidates and plans of the planner at some steps; empty if no planner flew.
    pub sights: Vec<Sight>,
    /// The next command for the user to run; empty if there is none.
    pub next: String,
}

/// Flight envelope against which a flight is checked, and the airspeed from which a sample counts as flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnvelopeFlown {
    /// The limits of the aircraft.
    pub limits: Limits,
    /// Lowest true airspeed at which a sample counts as flight, m/s.
    pub flying_from_mps: f64,
}

/// Surface deflections at a command of +1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceTravel {
    /// Deflection of the aileron, rad.
    pub aileron_rad: f64,
    /// Deflection of the elevator, rad.
    pub elevator_rad: f64,
}

/// A part of the schedule with a constant target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Time from which the target is commanded, s, on the flight's clock.
    pub start_s: f64,
    /// Time up to which the target is commanded, s, on the flight's clock.
    pub end_s: f64,
    /// Commanded roll angle, rad.
    pub roll_target_rad: f64,
    /// Commanded pitch angle, rad.
    pub pitch_target_rad: f64,
    /// Group of the target, by its distance from level flight.
    pub difficulty: Difficulty,
    /// Settled error, rad: mean of the roll and pitch RMS errors over the last fifth of the segment. NaN if it could not be
    /// determined.
    pub settled_error_rad: f64,
}

impl Segment {
    /// Whether the settled error is at most `tolerance_rad`, rad; `false` if the error could not be determined.
    pub fn tracked(&self, tolerance_rad: f64) -> bool {
        self.settled_error_rad <= tolerance_rad
    }
}

/// Group of a target by its distance from level flight, as in `greylag evaluate`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Difficulty {
    /// |roll| below 45° and |pitch| below 25°.
    Easy,
    /// |roll| of at least 45°, or |pitch| of at least 25°.
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

/// An event at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// Time of the event, s, on the flight's clock.
    pub time_s: f64,
    /// Kind of the event.
    pub kind: EventKind,
    /// Description of the event for the user.
    pub text: String,
}

/// Kinds of events in a flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EventKind {
    /// The flight controller changed its mode.
    Mode,
    /// A message was sent or received.
    Text,
    /// A failsafe was triggered.
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
    /// Number of tracked segments.
    pub fn tracked(&self) -> usize {
        self.segments.iter().filter(|s| s.tracked(self.tolerance_rad)).count()
    }

    /// Durations of the control cycles; `None` if no cycle was recorded.
    pub(crate) fn timed(&self) -> Option<&LoopTiming> {
        self.timing.as_ref().filter(|timing| !timing.cycles.is_empty())
    }

    /// Measures of the transient to each target, in the order of the segments; `None` if the aircraft's limits are not known.
    pub fn qualities(&self) -> Option<Vec<Quality>> {
        let limits = self.envelope?.limits;
        let of = |segment: &Segment| quality::of_segment(&self.flight.samples, segment, &limits);
        Some(self.segments.iter().map(of).collect())
    }

    /// One-line verdict on the flight.
    pub fn page_sentence(&self) -> String {
        verdict::sentence(self)
    }

    /// Builds the page of the flight.
    pub fn page(&self) -> Page {
        page::page(self)
    }
}
