//! The HTML page about an aircraft: three views, and trim, modes, stability margins and control responses computed from its model.

use std::fmt::Write;

use crate::Align::{Left, Right};
use crate::kit::numbers::number;
use crate::{
    Drawing, Figure, Outcome, Page, Panel, Section, Series, Style, Table, TimeFigure, Verdict,
};
use greylag_control::aircraft_check::{AircraftCheck, Level};
use greylag_control::stick_response::{STEPPED, StickResponse};
use greylag_model::GreyBox;

/// Contents of the page about an aircraft.
#[derive(Clone, Debug)]
pub struct AircraftReport<'a> {
    /// The model of the aircraft.
    pub model: &'a GreyBox,
    /// Results of the checks of the model.
    pub check: &'a AircraftCheck,
    /// Responses of the model to a step of a quarter of full aileron, and to one of a quarter of full elevator.
    pub responses: &'a [StickResponse; 2],
    /// Path of the model's file.
    pub model_file: String,
    /// Whether coefficients of the model were fitted to flights.
    pub fitted: bool,
    /// The command that the user should run next; empty if there is none.
    pub next: String,
    /// The command line that generated the page.
    pub command_line: String,
}

impl AircraftReport<'_> {
    /// Builds the page from these contents.
    pub fn page(&self) -> Page {
        let airframe = &self.model.airframe;
        let mut sections = vec![
            Section::verdict(self.verdict()),
            Section::new("Three views", SKETCH_NOTE, vec![Figure::Drawing(sketch(self.model))]),
            Section::new(
                "Straight flight",
                "Over the airspeeds of the envelope; angles up positive.",
                vec![Figure::Table(self.trim())],
            ),
            Section::new("Control response", &stick_note(), vec![Figure::Time(self.stick())]),
            Section::new(
                "Modes",
                "Of straight flight at the cruise airspeed.",
                vec![Figure::Table(self.modes())],
            ),
        ];
        if self.check.designed {
            sections.push(Section::new(
                "Stability margins",
                "Change of gain, phase lag and delay that each loop tolerates. A controller tolerates the least of its delays.",
                vec![Figure::Table(self.loops())],
            ));
        }
        let provenance = vec![Figure::Table(self.provenance())];
        sections.push(Section::new("Provenance", "", provenance).folded());
        Page {
            title: format!("{}: how it flies", airframe.name),
            subtitle: format!(
                "{} at {} m/s and {} m.",
                self.model.name,
                number(airframe.envelope.airspeed_cruise_mps),
                number(airframe.reference.altitude)
            ),
            sections,
        }
    }

    fn verdict(&self) -> Verdict {
        let AircraftCheck { findings, level_up_to, controller, .. } = self.check;
        let advice = || {
            format!(
                "Controller to begin with: {}; its loops tolerate {:.0} ms of delay (stability margins below).",
                controller.name,
                1e3 * controller.delay_s
            )
        };
        let mut details: Vec<String> = self.check.designed.then(advice).into_iter().collect();
        details.extend(level_up_to.map(|v| {
            format!(
                "It cannot fly level above {} m/s: faster is a descent at full throttle.",
                number(v)
            )
        }));
        match findings.split_first() {
            None => {
                let advice = if self.fitted { COMPARE } else { RECORD };
                details.push(advice.into());
                Verdict {
                    outcome: Outcome::Sound,
                    reason: "by its own numbers; no flight was compared".into(),
                    sentence: self.flies(),
                    details,
                    before_next: "fly it in simulation:".into(),
                    next: self.next.clone(),
                }
            }
            Some((first, rest)) => Verdict {
                outcome: Outcome::Faulty,
                reason: String::new(),
                sentence: format!("To correct before a flight: {first}."),
                details: rest.iter().cloned().chain(details).collect(),
                before_next: "correct it, then check it again:".into(),
                next: self.next.clone(),
            },
        }
    }

    /// Sentence on the airspeeds of level flight.
    fn flies(&self) -> String {
        let AircraftCheck { levels, level_up_to, .. } = self.check;
        let envelope = self.model.airframe.envelope;
        let to = number(level_up_to.unwrap_or(envelope.airspeed_max_mps));
        match levels.iter().find(|l| is_level(l) && l.is_possible()) {
            Some(slowest) => {
                format!("It flies level from {} to {to} m/s.", number(slowest.airspeed))
            }
            None => format!(
                "It flies straight from {} to {} m/s, never level.",
                number(envelope.airspeed_min_mps),
                number(envelope.airspeed_max_mps)
            ),
        }
    }

    fn trim(&self) -> Table {
        let columns = [
            ("Airspeed (m/s)", Right),
            ("Incidence (°)", Right),
            ("Elevator (% of travel)", Right),
            ("Throttle (%)", Right),
            ("Flight path (°)", Right),
        ];
        let mut table = Table::new("Straight flight", &columns);
        for l in &self.check.levels {
            let [alpha, path] = [l.alpha, l.path].map(f64::to_degrees);
            let row = [l.airspeed, alpha, 100.0 * l.elevator, 100.0 * l.throttle];
            let row = row.map(|x| format!("{x:.1}").replace('-', "−"));
            let path = match is_level(l) {
                _ if !l.is_possible() => "impossible".into(),
                true => "level".into(),
                false => format!("{path:.1}").replace('-', "−"),
            };
            table.push(row.into_iter().chain([path]));
        }
        table
    }

    fn modes(&self) -> Table {
        let columns = [
            ("Mode", Left),
            ("Frequency (rad/s)", Right),
            ("Damping ratio", Right),
            ("Time constant (s)", Right),
            ("", Left),
        ];
        let mut table = Table::new("Modes", &columns);
        for m in &self.check.modes {
            let some = |x: f64| if m.oscillates() { number(x) } else { "–".into() };
            let constant = m.time_constant();
            let fate = if constant < 0.0 { "grows" } else { "decays" };
            let cells =
                [some(m.frequency()), some(m.damping()), number(constant.abs()), fate.into()];
            table.push(std::iter::once(m.name.to_string()).chain(cells));
        }
        table
    }

    fn loops(&self) -> Table {
        let columns = [
            ("Controller", Left),
            ("Loop", Left),
            ("Crossover (rad/s)", Right),
            ("Least gain (dB)", Right),
            ("Most gain (dB)", Right),
            ("Phase (°)", Right),
            ("Delay (ms)", Right),
        ];
        let mut table = Table::new("Stability margins", &columns);
        for (controller, l) in self.check.named_loops() {
            let decibel = |x: f64| match x.is_finite() && x > 0.0 {
                true => number(20.0 * x.log10()),
                false => "any".into(),
            };
            let [least, most] = l.gain.map(decibel);
            let [crossover, phase] = [l.crossover, l.phase.to_degrees()].map(number);
            // as many digits as in the sentence on the controller to begin with
            let delay = match l.delay.is_finite() {
                true => format!("{:.0}", 1e3 * l.delay),
                false => "any".into(),
            };
            let [controller, surface] = [controller, l.surface].map(str::to_string);
            table.push([controller, surface, crossover, least, most, phase, delay]);
        }
        table
    }

    fn stick(&self) -> TimeFigure {
        let mut figure = TimeFigure::default();
        let [roll, pitch] = self.responses;
        let degrees = |r: &StickResponse, of: fn(&greylag_physics::State) -> f64| -> Vec<f64> {
            r.states.iter().map(|s| of(s).to_degrees()).collect()
        };
        let panel = |title: &str, unit: &str, name: &str, values: Vec<f64>| {
            Panel::new(title, unit, vec![Series::new(name, Style::Actual, values)])
        };
        figure.add_track(
            &roll.time_s,
            f64::INFINITY,
            vec![
                panel(
                    "Roll rate p after a quarter of aileron",
                    "°/s",
                    "roll rate",
                    degrees(roll, |s| s.p),
                ),
                panel("Roll φ after a quarter of aileron", "°", "roll", degrees(roll, |s| s.roll)),
            ],
        );
        figure.add_track(
            &pitch.time_s,
            f64::INFINITY,
            vec![
                panel(
                    "Pitch rate q after a quarter of up elevator",
                    "°/s",
                    "pitch rate",
                    degrees(pitch, |s| s.q),
                ),
                panel(
                    "Incidence α after a quarter of up elevator",
                    "°",
                    "incidence",
                    degrees(pitch, |s| s.alpha),
                ),
            ],
        );
        figure
    }

    fn provenance(&self) -> Table {
        let mut table = Table::new("Provenance", &[("Item", Left), ("Value", Left)]);
        table.push(["Program".to_string(), concat!("greylag ", env!("CARGO_PKG_VERSION")).into()]);
        table.push(["Model".to_string(), self.model_file.clone()]);
        table.push(["Command line".to_string(), self.command_line.clone()]);
        table
    }
}

/// Advice for a model that was fitted to flights, and for one that was not.
const COMPARE: &str = "It was fitted to flights. How well it predicts is shown by a comparison with a flight that the fit did not use.";
const RECORD: &str = "No flight has been fitted to it: record flights, then fit it to their logs.";

/// Whether straight flight is level: its flight-path angle is below 0.05°.
fn is_level(l: &Level) -> bool {
    l.path.to_degrees().abs() < 0.05
}

const SKETCH_NOTE: &str = "Span and mean chord to scale; the shapes of the body and the tail are typical ones, because \
                           the model has only their coefficients.";

fn stick_note() -> String {
    format!(
        "{:.0} % of the travel at once from straight flight at the cruise airspeed, nothing else moved, servos without lag.",
        100.0 * STEPPED
    )
}

/// Draws the top, front and side view of the aircraft.
fn sketch(model: &GreyBox) -> Drawing {
    let g = &model.airframe.geometry;
    let (span, chord) = (g.span, g.chord);
    let tailed = model.has_rudder();
    let length = if tailed { 0.7 * span } else { 1.6 * chord };
    let body = 0.06 * span;
    let (gap, high) = (0.12 * span, 0.16 * span);
    let mut svg = String::new();
    let mut rectangle = |x: f64, y: f64, w: f64, h: f64, class: &str| {
        let _ = write!(
            svg,
            "<rect class=\"{class}\" x=\"{x:.4}\" y=\"{y:.4}\" width=\"{w:.4}\" height=\"{h:.4}\"/>"
        );
    };
    // top view, nose up
    let nose = 0.5 * span - 0.5 * body;
    rectangle(nose, 0.0, body, length, "body");
    rectangle(0.0, 0.22 * length, span, chord, "wing");
    for side in [0.06 * span, 0.64 * span] {
        rectangle(side, 0.22 * length + 0.75 * chord, 0.3 * span, 0.25 * chord, "surface");
    }
    if tailed {
        rectangle(0.34 * span, length - 0.45 * chord, 0.32 * span, 0.45 * chord, "wing");
        rectangle(0.34 * span, length - 0.15 * chord, 0.32 * span, 0.15 * chord, "surface");
    }
    // front view
    let ahead = length + gap;
    rectangle(nose, ahead + 0.5 * high - 0.5 * body, body, body, "body");
    rectangle(0.0, ahead + 0.5 * high - 0.06 * chord, span, 0.12 * chord, "wing");
    if tailed {
        rectangle(0.5 * span - 0.02 * chord, ahead, 0.04 * chord, 0.5 * high, "wing");
    }
    // side view from the left
    let left = span + gap;
    let mid = 0.5 * high;
    rectangle(left, mid - 0.5 * body, length, body, "body");
    rectangle(left + 0.22 * length, mid - 0.06 * chord, chord, 0.12 * chord, "wing");
    if tailed {
        rectangle(left + length - 0.5 * chord, 0.0, 0.5 * chord, mid, "wing");
        rectangle(left + length - 0.2 * chord, 0.0, 0.2 * chord, mid, "surface");
    }
    Drawing {
        title: format!(
            "Span {} m, area {} m², mean chord {} m",
            number(span),
            number(g.area),
            number(chord)
        ),
        said: "Top, front and side view of the aircraft".into(),
        size: [left + length, ahead + high],
        svg,
    }
}
