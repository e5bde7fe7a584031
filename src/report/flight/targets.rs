//! Section on the targets (commanded attitudes) of a flight: the path in roll and pitch, and the settled error of each target.
//! The settled error is the RMS error in the last fifth of the time of the target.

use crate::flight::FlightReport;
use crate::flight::verdict::signed;
use crate::{Align, Figure, Row, Section, Style, Table, XyFigure, XyMark, XySeries};

/// Largest number of samples in the plotted path of roll and pitch.
const PATH_POINTS: usize = 20_000;

/// The section on the targets: a table, and a plot of pitch over roll.
pub(crate) fn section(report: &FlightReport) -> Section {
    let mut table = Table::new(
        "Segments",
        &[
            ("Target", Align::Right),
            ("From (s)", Align::Right),
            ("To (s)", Align::Right),
            ("Roll (°)", Align::Right),
            ("Pitch (°)", Align::Right),
            ("Group", Align::Left),
            ("Settled error (°)", Align::Right),
            ("Tracked", Align::Left),
        ],
    );
    for (i, s) in report.segments.iter().enumerate() {
        let tracked = if s.tracked(report.tolerance_rad) { "yes" } else { "no" };
        let error = s.settled_error_rad.to_degrees();
        table.rows.push(Row {
            cells: vec![
                (i + 1).to_string(),
                format!("{:.2}", s.start_s),
                format!("{:.2}", s.end_s),
                signed(s.roll_target_rad),
                signed(s.pitch_target_rad),
                s.difficulty.name().into(),
                if error.is_finite() { format!("{error:.4}") } else { "unknown".into() },
                tracked.into(),
            ],
            span_s: Some([s.start_s, s.end_s]),
            ..Row::default()
        });
    }
    Section::new(
        "Targets",
        "Settled error is the mean of the roll and pitch RMS errors over the last fifth of a \
         segment. Select a target to see its time in every plot.",
        vec![Figure::Table(table), Figure::Xy(target_plane(report))],
    )
}

/// Plot of pitch over roll: the flown path, and the tracked and missed targets.
fn target_plane(report: &FlightReport) -> XyFigure {
    let targets = |label: &str, style, mark, tracked: bool| {
        let of =
            || report.segments.iter().filter(move |s| s.tracked(report.tolerance_rad) == tracked);
        XySeries {
            label: label.into(),
            style,
            mark,
            x: of().map(|s| s.roll_target_rad.to_degrees()).collect(),
            y: of().map(|s| s.pitch_target_rad.to_degrees()).collect(),
        }
    };
    let every = report.flight.samples.len().div_ceil(PATH_POINTS).max(1);
    let angle = |axis: usize| {
        let drawn = report.flight.samples.iter().step_by(every);
        drawn.map(|s| s.attitude_rad[axis].to_degrees()).collect()
    };
    let path = XySeries {
        label: match every {
            1 => "path flown".into(),
            n => format!("path flown, one sample in {n}"),
        },
        style: Style::Actual,
        mark: XyMark::Path,
        x: angle(0),
        y: angle(1),
    };
    let reached = targets("target, tracked", Style::Second, XyMark::Circles, true);
    let missed = targets("target, not tracked", Style::Command, XyMark::Crosses, false);
    XyFigure {
        bands: Vec::new(),
        title: "Roll and pitch plane".into(),
        x_label: "Roll (°)".into(),
        y_label: "Pitch (°)".into(),
        series: [path, reached, missed].into_iter().filter(|s| !s.x.is_empty()).collect(),
    }
}
