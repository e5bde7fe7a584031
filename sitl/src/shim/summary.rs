//! Events during a run, and the counts at its end.

use std::fmt;
use std::net::SocketAddr;
use std::time::Duration;

use super::ardupilot_sim::ArdupilotEvent;
use super::flight::Over;
use super::link::{Address, Transport};
use super::px4_sim::Px4Event;

/// A change of state, reported to the observer of a run.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// The link is open; the second field is the local address, if the link has one.
    Open(Address, Option<SocketAddr>),
    /// A note on the aircraft.
    Note(String),
    /// No companion has sent a message yet, or the companion was lost.
    Waiting(Address),
    /// The first message of the companion has arrived.
    Found,
    /// The companion has sent nothing for two seconds, or has closed its stream.
    Lost,
    /// The first armed answer has arrived, and the aircraft begins to fly.
    Launched,
    /// The companion is armed.
    Armed,
    /// The companion is disarmed.
    Disarmed,
    /// Lockstep: no answer to the present frame arrived for 1 s; simulated time stops until an answer arrives.
    Paused,
    /// Lockstep: an answer has arrived after the interruption.
    Resumed,
    /// The simulated flight controller has changed its mode.
    Mode(String),
    /// Event of a run against PX4.
    Px4(Px4Event),
    /// Event of a run against ArduPilot.
    Ardupilot(ArdupilotEvent),
    /// The loop was late by this time, so its schedule restarted at the present time.
    Skipped(Duration),
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Event::Open(link @ Address { transport: Transport::Pty, endpoint }, _) => write!(
                f,
                "link {link} is open; give the companion --vehicle serial:{endpoint}:921600"
            ),
            Event::Open(link, Some(local)) => write!(f, "link {link} is open, here {local}"),
            Event::Open(link, None) => write!(f, "link {link} is open"),
            Event::Waiting(link) => {
                write!(f, "waiting for a companion on {link}; start one with `cargo fly`")
            }
            Event::Note(note) => write!(f, "note: {note}"),
            Event::Found => write!(f, "companion found"),
            Event::Lost => write!(f, "companion lost"),
            Event::Launched => write!(f, "launched"),
            Event::Armed => write!(f, "armed"),
            Event::Disarmed => write!(f, "disarmed: surfaces centred, motor off"),
            Event::Paused => write!(
                f,
                "no answer for 1 s: simulated time stands still; the frame is repeated every second"
            ),
            Event::Resumed => write!(f, "answered: simulated time goes on"),
            Event::Mode(mode) => write!(f, "mode {mode}"),
            Event::Px4(event) => event.fmt(f),
            Event::Ardupilot(event) => event.fmt(f),
            Event::Skipped(by) => {
                write!(
                    f,
                    "this machine was {:.0} ms late: the clock is set anew",
                    by.as_secs_f64() * 1e3
                )
            }
        }
    }
}

/// An event with its simulated time.
#[derive(Clone, Debug, PartialEq)]
pub struct Notice {
    /// Simulated time of the event, s.
    pub time_s: f64,
    /// Change of state that happened.
    pub event: Event,
}

/// Distribution of the time from sending a frame to receiving its answer, in bins of 10 µs up to 20 ms.
#[derive(Clone, Debug, PartialEq)]
pub struct Latency {
    bins: Vec<u64>,
    count: u64,
    longest: Duration,
}

impl Default for Latency {
    fn default() -> Self {
        Latency { bins: vec![0; 2001], count: 0, longest: Duration::ZERO }
    }
}

impl Latency {
    pub(super) fn record(&mut self, taken: Duration) {
        let bin = (taken.as_micros() / 10).min(2000) as usize;
        self.bins[bin] += 1;
        self.count += 1;
        self.longest = self.longest.max(taken);
    }

    /// Number of measured answers.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Longest time from frame to answer.
    pub fn longest(&self) -> Duration {
        self.longest
    }

    /// The quantile `share` (0..1) of the times from frame to answer, with a resolution of one bin; zero without answers.
    pub fn quantile(&self, share: f64) -> Duration {
        let wanted = (share * self.count as f64).ceil() as u64;
        let mut seen = 0;
        for (bin, &answers) in self.bins.iter().enumerate().take(2000) {
            seen += answers;
            if seen >= wanted.max(1) {
                return Duration::from_micros(10 * (bin as u64 + 1)).min(self.longest);
            }
        }
        self.longest
    }
}

/// Counts and times of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Summary {
    /// State frames, without repetitions.
    pub frames: u64,
    /// State frames sent again because no answer arrived.
    pub repeated_frames: u64,
    /// State frames dropped by the fault rule.
    pub dropped_frames: u64,
    /// State frames that could not be sent: no peer, or no room in the send buffer.
    pub unsent_frames: u64,
    /// Answers that were used; before the launch, they do not move the aircraft.
    pub answers: u64,
    /// Repeated answers to an answered frame.
    pub repeated_answers: u64,
    /// Answers older than 0.5 s; not used.
    pub stale_answers: u64,
    /// Answers that echo a time of no frame; not used.
    pub wrong_answers: u64,
    /// Answers with a control that is not finite; not used.
    pub unusable_answers: u64,
    /// Answers with a control outside its range; the control was limited.
    pub limited_answers: u64,
    /// Real time: steps after the launch without a new valid answer.
    pub unanswered_steps: u64,
    /// Real time: cycles that began more than 2 ms late.
    pub late_cycles: u64,
    /// Real time: largest delay at the beginning of a cycle.
    pub latest_cycle: Duration,
    /// Runs of bytes that were not part of a frame.
    pub bad_frames: u64,
    /// Valid frames from senders other than the companion, and frames with unknown messages.
    pub foreign_frames: u64,
    /// Simulated time of the frames, s.
    pub simulated_s: f64,
    /// Simulated time since the launch, s.
    pub flown_s: f64,
    /// Wall time of the run, s.
    pub wall_s: f64,
    /// Distribution of the time from sending a frame to receiving its answer.
    pub latency: Latency,
    /// Why the run ended; `None` after a stop request.
    pub over: Option<Over>,
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let reason = match self.over {
            None => "Stopped",
            Some(Over::Duration) => "The asked time has been flown",
            Some(Over::Ground) => "The aircraft has come down to sea level",
        };
        let ms = |time: Duration| time.as_secs_f64() * 1e3;
        write!(
            f,
            "{reason} after {:.2} s of simulated time ({:.2} s flown) in {:.2} s. \
             Frames: {} ({} repeated, {} dropped on purpose, {} without anybody to send to). \
             Answers: {} ({} stale, {} repeated, {} with a wrong time, {} unusable, {} limited; \
             {} steps without a new one). Frame to answer: {:.2} ms median, {:.2} ms p99, {:.2} ms \
             at most. Late cycles of the simulator: {} (at most {:.2} ms late). Bad frames: {}, foreign: {}.",
            self.simulated_s,
            self.flown_s,
            self.wall_s,
            self.frames,
            self.repeated_frames,
            self.dropped_frames,
            self.unsent_frames,
            self.answers,
            self.stale_answers,
            self.repeated_answers,
            self.wrong_answers,
            self.unusable_answers,
            self.limited_answers,
            self.unanswered_steps,
            ms(self.latency.quantile(0.5)),
            ms(self.latency.quantile(0.99)),
            ms(self.latency.longest()),
            self.late_cycles,
            ms(self.latest_cycle),
            self.bad_frames,
            self.foreign_frames,
        )
    }
}
