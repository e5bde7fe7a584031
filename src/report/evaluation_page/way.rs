//! Sections of the evaluation page on the transient response to a commanded attitude (target). They contain a plot of the error
//! against the surface travel, a table of all measures, and their definitions. Surface travel is the sum of the magnitudes of all
//! changes of the surface commands.

use super::{EvaluationReport, Left, Right, label, with_interval};
use crate::kit::numbers::number;
use crate::{Choice, ChoiceOption, Figure, Section, Style, Table, XyFigure, XyMark, XySeries};
use greylag_control::quality::{MEASURES, Measure};
use greylag_sim::evaluation::{Evaluation, Score};
use greylag_sim::summary::Spread;

/// Name of the share of flights that keep the limits of load factor and angle of attack.
const KEPT: &str = "Load factor and angle of attack kept";
/// Number of distinct colours. Further controllers repeat the colours with wider lines.
const COLOURS: usize = 4;

/// The sections on transients; empty if the evaluation has no transient measures.
pub(super) fn sections(report: &EvaluationReport) -> Vec<Section> {
    let measured =
        report.evaluations.iter().any(|e| e.groups.iter().any(|g| !g.measures.is_empty()));
    if !measured {
        return Vec::new();
    }
    vec![picture(report), measures(report)]
}

fn by_group(report: &EvaluationReport, anchor: &str, figure: &dyn Fn(&str) -> Figure) -> Figure {
    let option =
        |group: &str| ChoiceOption { name: group.replace('_', " "), figures: vec![figure(group)] };
    let groups = report.groups();
    // the group "all" (the targets of Table II of T. Guerin et al. 2026, see src/lib.rs) comes first, then the other groups
    let (all, parts): (Vec<&str>, Vec<&str>) = groups.into_iter().partition(|g| *g == "all");
    Figure::Choice(Choice {
        anchor: anchor.into(),
        label: "Targets".into(),
        options: all.into_iter().chain(parts).map(option).collect(),
    })
}

/// Plot of the integral of the attitude error against the surface travel, with one cross per controller.
fn picture(report: &EvaluationReport) -> Section {
    let figure = |group: &str| {
        let crosses = report.evaluations.iter().enumerate().filter_map(|(k, e)| {
            let score = e.score(group)?;
            let [x, y] =
                ["surface_travel", "error_integral_deg_s"].map(|id| score.measures.get(id));
            Some(cross(label(e, report.evaluations), k, x?, y?))
        });
        Figure::Xy(XyFigure {
            title: format!("Error against surface travel, {}", group.replace('_', " ")),
            x_label: "Surface travel, median".into(),
            y_label: "Integral of error, median (° s)".into(),
            bands: Vec::new(),
            series: crosses.collect(),
        })
    };
    let note = "Down and left is better. A controller is where its cross meets: the medians over the targets; the arms are \
                their 95 % bootstrap intervals.";
    Section::new("Error against surface travel", note, vec![by_group(report, "travel", &figure)])
}

fn cross(label: String, k: usize, x: &Spread, y: &Spread) -> XySeries {
    let ([left, right], [low, high]) = (x.median_ci95, y.median_ci95);
    XySeries {
        label,
        style: Style::nth(k),
        mark: if k < COLOURS { XyMark::Path } else { XyMark::Line },
        x: vec![left, x.median, right, f64::NAN, x.median, x.median, x.median],
        y: vec![y.median, y.median, y.median, f64::NAN, low, y.median, high],
    }
}

/// Table with every measure of every controller.
fn measures(report: &EvaluationReport) -> Section {
    let figure = |group: &str| {
        let scored: Vec<(&Evaluation, &Score)> =
            report.evaluations.iter().filter_map(|e| Some((e, e.score(group)?))).collect();
        let names: Vec<String> = scored.iter().map(|(e, _)| label(e, report.evaluations)).collect();
        let mut columns = vec![("Measure", Left)];
        columns.extend(names.iter().map(|name| (name.as_str(), Right)));
        let mut table = Table::new("Measures", &columns);
        let kept = |score: &Score| format!("{} %", number(100.0 * score.kept_rate));
        let little = |score: &Score| format!("{} %", number(100.0 * score.little_overshoot_rate));
        push(&mut table, KEPT.into(), &scored, &kept);
        for m in MEASURES.iter().filter(|m| moves(&scored, m)) {
            push(&mut table, titled(m), &scored, &|score| cell(score, m));
            if m.id == "overshoot_pitch_deg" {
                push(&mut table, "Overshoot at most 1° or 3 %".into(), &scored, &little);
            }
        }
        Figure::Table(table)
    };
    let mut definitions = Table::new("Definitions", &[("Measure", Left), ("Definition", Left)]);
    let within = "Share of the flights whose load factor and angle of attack pass the airframe file's limits by at most \
                    5 % (a transient).";
    definitions.push([KEPT.into(), within.into()]);
    MEASURES.iter().for_each(|m| definitions.push([titled(m), m.definition.into()]));
    let figures = vec![by_group(report, "measures", &figure), Figure::Table(definitions)];
    let note = format!(
        "Median over the targets with its 95 % bootstrap interval, then the worst of all. {}",
        limits(report)
    );
    Section::new("Transient response", &note, figures)
}

fn push(
    table: &mut Table,
    title: String,
    scored: &[(&Evaluation, &Score)],
    cell: &dyn Fn(&Score) -> String,
) {
    let cells = scored.iter().map(|(_, score)| cell(score));
    table.push(std::iter::once(title).chain(cells).collect::<Vec<_>>());
}

/// Whether a measure is nonzero for any controller. Without a rudder, for example, the measures of the rudder are zero.
fn moves(scored: &[(&Evaluation, &Score)], m: &Measure) -> bool {
    scored.iter().any(|(_, score)| score.measures.get(m.id).is_some_and(|s| s.worst != 0.0))
}

fn cell(score: &Score, m: &Measure) -> String {
    score.measures.get(m.id).map_or_else(
        || "–".into(),
        |s| format!("{}, worst {}", with_interval(s.median, s.median_ci95), number(s.worst)),
    )
}

fn titled(m: &Measure) -> String {
    let unit = if m.unit.is_empty() { String::new() } else { format!(" ({})", m.unit) };
    let mut letters = m.title.chars();
    let first: String = letters.next().map(|c| c.to_uppercase().collect()).unwrap_or_default();
    format!("{first}{}{unit}", letters.as_str())
}

/// Text with the limits of the airframe file that the measures refer to; empty if the evaluation has none.
fn limits(report: &EvaluationReport) -> String {
    let Some(limits) = report.evaluations.iter().find_map(|e| e.limits) else {
        return String::new();
    };
    let [[least, most], [slow, fast]] = [limits.load_factor, limits.airspeed_mps];
    format!(
        "Limits of the airframe file: load factor {} to {}, stall {}°, airspeed {} to {} m/s, bank {}°, surface rate {} a second; \
         – where none is stated.",
        number(least),
        number(most),
        number(limits.stall_deg),
        number(slow),
        number(fast),
        number(limits.bank_deg),
        number(limits.slew_per_s)
    )
}
