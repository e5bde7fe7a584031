//! Time lines of a simulated flight in which failsafes are tried. Bands show the modes of the companion and the flight
//! controller, curves show the motion. The companion is Greylag's autopilot.

use super::Flown;
use super::choices::{fault, request};
use super::form::FLIGHT_S;
use greylag_flight::pilot::{Source, TICK_S, mode_name};
use greylag_report::{Span, States, Style, TimeLine, Tone, TraceLine, Traces};
use greylag_sim::faults::policies::Sample;
use greylag_sim::faults::{ControllerMode, Fault};

/// Time before and after the first event in the close-up, s.
const BEFORE_S: f64 = 1.0;
const AFTER_S: f64 = 5.0;
/// Age above which a decision is stale, s.
const STALE_S: f64 = 0.2;
/// Displayed length of an instantaneous event, such as a request, s.
const MOMENT_S: f64 = 0.1;

/// Name of the state that a band shows at a step, and its kind, which sets the colour. `None` leaves a gap in the band.
type Seen = Option<(String, Tone)>;

impl Flown {
    /// Time line of the whole flight.
    pub(super) fn time_line(&self) -> TimeLine {
        let (shaded_s, marks_s) = (self.shaded(), self.marks());
        TimeLine {
            title: "The whole flight".into(),
            span_s: [0.0, FLIGHT_S],
            states: self.states(),
            traces: self.traces(),
            shaded_s,
            marks_s,
        }
    }

    /// Time line around the first event; `None` without events.
    pub(super) fn close_up(&self) -> Option<TimeLine> {
        let first_s = self.first_s()?;
        let from = (first_s - BEFORE_S).max(0.0);
        let span_s = [from, (first_s + AFTER_S).min(FLIGHT_S)];
        let title = format!("From {from:.1} to {:.1} s", span_s[1]);
        Some(TimeLine { title, span_s, states: self.states(), ..TimeLine::default() })
    }

    /// Time of the first fault, or without faults of the first request, s; `None` without either.
    pub(super) fn first_s(&self) -> Option<f64> {
        let faults = self.scenario.faults.iter().map(|f| f.from_s).reduce(f64::min);
        faults.or(self.scenario.asked.iter().map(|a| a.at_s).reduce(f64::min))
    }

    fn shaded(&self) -> Option<[f64; 2]> {
        self.scenario.faults.first().map(|f| [f.from_s, f.to_s])
    }

    fn marks(&self) -> Vec<f64> {
        self.scenario.asked.iter().map(|a| a.at_s).collect()
    }

    fn states(&self) -> Vec<States> {
        let mut rows = vec![self.befalls(), self.row("Companion's mode", companion)];
        let controller = self.controller.name();
        rows.push(self.row("Command from", |s| command(s, controller)));
        if let Some(stack) = self.scenario.counterpart.stack() {
            rows.push(self.row("The aircraft is", |s| owner(s, stack)));
            let counterpart = self.scenario.counterpart;
            rows.push(self.row(&format!("{stack}'s mode"), |s| {
                let mode = s.controller?;
                Some((counterpart.mode_name(mode).to_owned(), tone(mode)))
            }));
        }
        rows
    }

    /// Row of the faults and requests.
    fn befalls(&self) -> States {
        let of_fault = |f: &Fault| Span {
            time_s: [f.from_s, f.to_s.max(f.from_s + MOMENT_S)],
            word: fault(f.kind).0.into(),
            tone: Tone::Wrong,
        };
        let mut spans: Vec<Span> = self.scenario.faults.iter().map(of_fault).collect();
        spans.extend(self.scenario.asked.iter().map(|a| Span {
            time_s: [a.at_s, a.at_s + MOMENT_S],
            word: request(a.what).into(),
            tone: Tone::Begins,
        }));
        spans.sort_by(|a, b| a.time_s[0].total_cmp(&b.time_s[0]));
        States { label: "Fault, request".into(), spans }
    }

    fn row(&self, label: &str, of: impl Fn(&Sample) -> Seen) -> States {
        States { label: label.into(), spans: spans(&self.witnessed.samples, of) }
    }

    fn traces(&self) -> Vec<Traces> {
        let line = |label: &str, style, value: &dyn Fn(&Sample) -> f64| {
            let point = |(k, s): (usize, &Sample)| [k as f64 * TICK_S, value(s)];
            let points = self.witnessed.samples.iter().enumerate().map(point).collect();
            TraceLine { label: label.into(), style, points }
        };
        let asked = |s: &Sample, angle: fn(&greylag_control::Target) -> f64| {
            let fresh = s.decision.filter(|d| s.age_s <= STALE_S && d.armed);
            fresh.map_or(f64::NAN, |d| angle(&d.target).to_degrees())
        };
        let attitude = |label: &str, k: usize, angle: fn(&greylag_control::Target) -> f64| Traces {
            label: label.into(),
            lines: vec![
                line("flown", Style::Actual, &move |s| s.attitude_deg[k]),
                line("companion's target", Style::Command, &move |s| asked(s, angle)),
            ],
        };
        let one = |label: &str, value: &dyn Fn(&Sample) -> f64| Traces {
            label: label.into(),
            lines: vec![line("flown", Style::Actual, value)],
        };
        vec![
            attitude("Roll (degrees)", 0, |t| t.roll),
            attitude("Pitch (degrees)", 1, |t| t.pitch),
            one("Altitude (m)", &|s| s.altitude_m),
            one("True airspeed (m/s)", &|s| s.airspeed_mps),
        ]
    }
}

/// Joins the equal states of consecutive samples to spans of a band. A sample without a state leaves a gap.
pub(super) fn spans(samples: &[Sample], of: impl Fn(&Sample) -> Seen) -> Vec<Span> {
    let mut spans: Vec<Span> = Vec::new();
    for (k, sample) in samples.iter().enumerate() {
        let now_s = k as f64 * TICK_S;
        let Some((word, tone)) = of(sample) else { continue };
        match spans.last_mut() {
            Some(last) if last.word == word && last.time_s[1] >= now_s - 0.5 * TICK_S => {
                last.time_s[1] = now_s + TICK_S;
            }
            _ => spans.push(Span { time_s: [now_s, now_s + TICK_S], word, tone }),
        }
    }
    spans
}

/// Mode that the companion reports to its clients.
pub(super) fn companion(s: &Sample) -> Seen {
    let Some(shown) = s.shown else { return Some(("killed".into(), Tone::Wrong)) };
    let mode = mode_name(shown.mode);
    Some(match (shown.armed, shown.failsafe) {
        (false, _) => ("disarmed".into(), Tone::Idle),
        (true, true) => (format!("{mode}, failsafe"), Tone::Wrong),
        (true, false) if mode == "OFFBOARD" => (mode.into(), Tone::Asked),
        (true, false) => (mode.into(), Tone::Safe),
    })
}

/// Source of the actuator command in a sample; `None` if the command is stale or the companion is disarmed.
fn command(s: &Sample, controller: &str) -> Seen {
    let decision = s.decision.filter(|_| s.age_s <= STALE_S)?;
    let (word, tone) = match decision.source {
        Source::Planned => (controller, Tone::Asked),
        Source::Late | Source::Fallback => ("fallback", Tone::Safe),
        Source::Held => ("last command held", Tone::Begins),
        Source::Level => ("level trim, no state", Tone::Wrong),
        Source::Check => ("check of signs", Tone::Begins),
        Source::Sticks => ("sticks", Tone::Safe),
        Source::Disarmed => return None,
    };
    Some((word.into(), tone))
}

/// The system that controls the aircraft in a sample.
fn owner(s: &Sample, stack: &str) -> Seen {
    Some(match (s.engaged, s.steered) {
        (true, true) if s.confirmed => ("the companion's".into(), Tone::Asked),
        (true, false) if s.confirmed => (format!("taken by {stack}"), Tone::Begins),
        (true, _) => ("asked for".into(), Tone::Begins),
        // the companion has been killed, or was restarted and has no request to fly
        (false, true) if s.shown.is_none() || !s.asked => ("nobody's".into(), Tone::Wrong),
        (false, true) => ("let go".into(), Tone::Begins),
        (false, false) => (format!("{stack}'s"), Tone::Safe),
    })
}

fn tone(mode: ControllerMode) -> Tone {
    match mode {
        ControllerMode::Manual | ControllerMode::Guided => Tone::Asked,
        ControllerMode::Hold => Tone::Safe,
        ControllerMode::Return | ControllerMode::Circle => Tone::Begins,
    }
}
