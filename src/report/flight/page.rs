//! The HTML page of one flight: verdict, attitude, air data, surfaces, loop timing, targets and events.

use crate::comparison;
use crate::flight::FlightReport;
use crate::flight::verdict::{degrees, duration_s, verdict};
use crate::flight::{quality, targets};
use crate::{
    Align, Band, Choice, ChoiceOption, Figure, Histogram, LoopTiming, Mark, Page, Panel, Rule,
    Scale, Section, Series, Sight, Style, Table, TimeFigure, sight,
};
use greylag_control::Target;
use greylag_control::quality::attitude_error_deg;
use greylag_logs::Sample;

/// Time without samples above which the lines are interrupted, s. The flight-log format splits a flight at the same gap.
const GAP_S: f64 = 0.1;
/// Largest number of events at which the plots have marks. With more events there are none, because they would hide the lines.
const MARKED_EVENTS: usize = 40;

pub(crate) fn page(report: &FlightReport) -> Page {
    let mut sections = vec![Section::verdict(verdict(report))];
    sections.push(attitude(report));
    sections.extend(quality::section(report));
    sections.extend([air_data(report), surfaces(report)]);
    sections.extend(report.timed().map(|t| loop_timing(report, t)));
    if !report.segments.is_empty() {
        sections.push(targets::section(report));
    }
    if !report.sights.is_empty() {
        sections.push(sights(report));
    }
    sections.extend(report.comparison.as_ref().map(comparison::page::short_section));
    if !report.events.is_empty() {
        sections.push(events(report));
    }
    sections.push(provenance(report));
    Page { title: report.title.clone(), subtitle: subtitle(report), sections }
}

fn subtitle(report: &FlightReport) -> String {
    let samples = &report.flight.samples;
    let duration = duration_s(samples);
    let seed = report.seed.map_or(String::new(), |s| format!(", seed {s}"));
    format!(
        "Controller {}, model {}{seed}. {duration:.1} s, {} samples.",
        report.controller,
        report.model,
        samples.len()
    )
}

fn column(report: &FlightReport, value: impl Fn(&Sample) -> f64) -> Vec<f64> {
    report.flight.samples.iter().map(value).collect()
}

/// A figure of `panels` over the time of the log, with numbered marks at the events.
fn time_figure(report: &FlightReport, panels: Vec<Panel>) -> TimeFigure {
    let mut figure = TimeFigure { marks: marks(report), ..TimeFigure::default() };
    figure.add_track(&column(report, |s| s.time_s), GAP_S, panels);
    figure
}

fn marks(report: &FlightReport) -> Vec<Mark> {
    if report.events.len() > MARKED_EVENTS {
        return Vec::new();
    }
    let timed = report.events.iter().enumerate().filter(|(_, e)| e.time_s.is_finite());
    timed.map(|(i, e)| Mark { time_s: e.time_s, label: (i + 1).to_string() }).collect()
}

/// A sentence that explains the numbered marks; empty without marks.
fn marked(report: &FlightReport) -> &'static str {
    match report.events.len() {
        1..=MARKED_EVENTS => " The numbers above the plots are the events listed at the end.",
        _ => "",
    }
}

fn attitude(report: &FlightReport) -> Section {
    let roll = (column(report, |s| s.attitude_rad[0]), column(report, |s| s.roll_target_rad));
    let pitch = (column(report, |s| s.attitude_rad[1]), column(report, |s| s.pitch_target_rad));
    let panels = vec![
        angle_panel("Roll", report.tolerance_rad, &roll),
        angle_panel("Pitch", report.tolerance_rad, &pitch),
        error_panel("Roll error", report.tolerance_rad, &roll),
        error_panel("Pitch error", report.tolerance_rad, &pitch),
    ];
    let tolerance = degrees(report.tolerance_rad);
    Section::new(
        "Attitude",
        &format!(
            "Attitude against command, and the size of their difference on a scale of decades. \
             The band and the line mark the tolerance, {tolerance}.{}",
            marked(report)
        ),
        vec![Figure::Time(time_figure(report, panels))],
    )
}

fn sights(report: &FlightReport) -> Section {
    let option = |sight: &Sight| {
        let [roll, pitch] = sight.target.map(f64::to_degrees);
        ChoiceOption {
            name: format!("{roll:.0}°, {pitch:.0}° at {:.1} s", sight.time_s),
            figures: sight.fans().to_vec(),
        }
    };
    let choice = Choice {
        anchor: "sights".into(),
        label: "Moment".into(),
        options: report.sights.iter().map(option).collect(),
    };
    let note = "A moment after each command: some of the candidates of the last iteration and what was flown, \
                in the planner's own model. Found by replaying the recording.";
    let table = Figure::Table(sight::phases(&report.sights));
    Section::new("What the planner saw", note, vec![Figure::Choice(choice), table])
}

fn to_degrees(rad: &[f64]) -> Vec<f64> {
    rad.iter().map(|v| v.to_degrees()).collect()
}

fn angle_panel(title: &str, tolerance_rad: f64, (actual, command): &(Vec<f64>, Vec<f64>)) -> Panel {
    let series = vec![
        Series::new("actual", Style::Actual, to_degrees(actual)),
        Series::new("commanded", Style::Command, to_degrees(command)),
    ];
    let band =
        Band { around: 1, half_width: tolerance_rad.to_degrees(), label: "tolerance".into() };
    Panel { bands: vec![band], ..Panel::new(title, "°", series) }
}

fn error_panel(title: &str, tolerance_rad: f64, (actual, command): &(Vec<f64>, Vec<f64>)) -> Panel {
    // the error is wrapped to ±180°, because the roll angle jumps by 360° when an inverted aircraft passes 180°
    let size = |(a, c): (&f64, &f64)| {
        let target = Target { roll: *c, pitch: 0.0, airspeed: f64::NAN };
        attitude_error_deg([*a, 0.0], &target)[0].abs()
    };
    let error = actual.iter().zip(command).map(size).collect();
    let tolerance = tolerance_rad.to_degrees();
    Panel {
        // the scale begins two decades below the tolerance, because smaller errors are irrelevant
        scale: Scale::Log { floor: positive_or(tolerance / 100.0, 1e-3) },
        rules: vec![Rule { value: tolerance, label: "tolerance".into() }],
        ..Panel::new(title, "°", vec![Series::new("error", Style::Actual, error)])
    }
}

fn positive_or(value: f64, otherwise: f64) -> f64 {
    if value.is_finite() && value > 0.0 { value } else { otherwise }
}

fn air_data(report: &FlightReport) -> Section {
    let airspeed = Series::new("true airspeed", Style::Actual, column(report, |s| s.airspeed_mps));
    let alpha = column(report, |s| s.alpha_rad.to_degrees());
    let beta = column(report, |s| s.beta_rad.to_degrees());
    let altitude =
        Series::new("above mean sea level", Style::Actual, column(report, |s| s.altitude_m));
    let panels = vec![
        Panel::new("Airspeed", "m/s", vec![airspeed]),
        Panel::new(
            "Air angles",
            "°",
            vec![
                Series::new("angle of attack α", Style::Actual, alpha),
                Series::new("sideslip β", Style::Second, beta),
            ],
        ),
        Panel::new("Altitude", "m", vec![altitude]),
    ];
    Section::new("Air data", "", vec![Figure::Time(time_figure(report, panels))])
}

fn surfaces(report: &FlightReport) -> Section {
    let pair = |title: &str, unit: &str, acting: Vec<f64>, command: Vec<f64>| {
        let series = vec![
            // the two lines lie close together: in this order the actual one is drawn over the commanded one
            Series::new("commanded", Style::Command, command),
            Series::new("acting", Style::Actual, acting),
        ];
        Panel::new(title, unit, series)
    };
    let (aileron, elevator) = (report.travel.aileron_rad, report.travel.elevator_rad);
    let panels = vec![
        pair(
            "Aileron",
            "°",
            column(report, |s| s.aileron_rad.to_degrees()),
            column(report, |s| (s.aileron_cmd * aileron).to_degrees()),
        ),
        pair(
            "Elevator",
            "°",
            column(report, |s| s.elevator_rad.to_degrees()),
            column(report, |s| (s.elevator_cmd * elevator).to_degrees()),
        ),
        pair(
            "Throttle",
            "%",
            column(report, |s| 100.0 * s.throttle),
            column(report, |s| 100.0 * s.throttle_cmd),
        ),
    ];
    let note = format!(
        "Commands are drawn as the deflection they ask for: full command is {:.1}° of aileron, \
         {:.1}° of elevator.",
        aileron.to_degrees(),
        elevator.to_degrees()
    );
    Section::new("Surfaces", &note, vec![Figure::Time(time_figure(report, panels))])
}

fn loop_timing(report: &FlightReport, timing: &LoopTiming) -> Section {
    let [p50, p99, p999, most] = timing.percentiles_us([0.5, 0.99, 0.999, 1.0]).map(|us| us / 1e3);
    let budget = timing.budget_us / 1e3;
    let durations: Vec<f64> = timing.cycles.iter().map(|c| c.duration_us / 1e3).collect();
    let times: Vec<f64> = timing.cycles.iter().map(|c| c.time_s).collect();
    let least = durations.iter().copied().filter(|d| *d > 0.0).fold(f64::INFINITY, f64::min);
    let rule = |value, label: &str| Rule { value, label: label.into() };
    let panel = Panel {
        scale: Scale::Log { floor: positive_or(10f64.powf(least.log10().floor()), 1e-3) },
        rules: vec![rule(budget, "budget")],
        ..Panel::new(
            "Cycle duration",
            "ms",
            vec![Series::new("duration", Style::Actual, durations.clone())],
        )
    };
    let mut over_time = TimeFigure { marks: marks(report), ..TimeFigure::default() };
    over_time.add_track(&times, GAP_S, vec![panel]);
    let quantiles =
        [rule(p50, "p50"), rule(p99, "p99"), rule(p999, "p99.9"), rule(budget, "budget")];
    let histogram = Histogram::log(
        "Cycle durations",
        "Duration (ms)",
        "cycles",
        &durations,
        quantiles.into_iter().filter(|r| r.value.is_finite()).collect(),
    );
    let mut table = Table::new("Loop timing", &[("Duration", Align::Left), ("(ms)", Align::Right)]);
    let rows = [("p50", p50), ("p99", p99), ("p99.9", p999), ("longest", most), ("budget", budget)];
    for (name, ms) in rows {
        table.push([name.to_string(), format!("{ms:.3}")]);
    }
    let late = match timing.late() {
        0 => "none".into(),
        n => n.to_string(),
    };
    let cycles = timing.cycles.len();
    let note =
        format!("From {}, {cycles} cycles; {late} took longer than the budget.", timing.measure);
    let figures = vec![Figure::Time(over_time), Figure::Histogram(histogram), Figure::Table(table)];
    Section::new("Loop timing", &note, figures)
}

fn events(report: &FlightReport) -> Section {
    let mut table = Table::new(
        "Events",
        &[
            ("Mark", Align::Right),
            ("Time (s)", Align::Right),
            ("Kind", Align::Left),
            ("What", Align::Left),
        ],
    );
    for (i, e) in report.events.iter().enumerate() {
        table.push([
            (i + 1).to_string(),
            if e.time_s.is_finite() { format!("{:.2}", e.time_s) } else { "–".into() },
            e.kind.name().into(),
            e.text.clone(),
        ]);
    }
    let note = match report.events.len() {
        0..=MARKED_EVENTS => "The numbers stand above the plots.",
        _ => "Too many to mark in the plots.",
    };
    Section::new("Events", note, vec![Figure::Table(table)])
}

fn provenance(report: &FlightReport) -> Section {
    let mut table = Table::new("Provenance", &[("Item", Align::Left), ("Value", Align::Left)]);
    let mut push = |item: &str, value: String| table.push([item.to_string(), value]);
    push("Controller", report.controller.clone());
    push("Model", report.model.clone());
    push("Seed", report.seed.map_or("none".into(), |s| s.to_string()));
    push("Command line", report.command_line.clone());
    for (program, version) in &report.versions {
        push(program, version.clone());
    }
    push("Plots", "uPlot 1.6.32 (MIT)".into());
    Section::new("Provenance", "", vec![Figure::Table(table)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_across_the_jump_of_the_roll_angle_is_small() {
        let angles = [179.0, -20.0, f64::NAN].map(f64::to_radians).to_vec();
        let commands = [-179.0, 10.0, 0.0].map(f64::to_radians).to_vec();
        let panel = error_panel("Roll error", 0.01, &(angles, commands));
        let error = &panel.series[0].values;
        assert!((error[0] - 2.0).abs() < 1e-9 && (error[1] - 30.0).abs() < 1e-9, "{error:?}");
        assert!(error[2].is_nan());
    }
}
