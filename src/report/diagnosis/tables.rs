//! Tables of a diagnosis: advice, detection limits, coefficients, sensors, trims, candidates, notes, provenance. A diagnosis
//! tests which effects of the catalogue a model lacks, and asserts those with enough evidence.

use std::path::Path;

use crate::Align::{Left, Right};
use crate::diagnosis::DiagnosisReport;
use crate::kit::numbers::{NORMAL_95, evidence, interval, number, percent};
use crate::{Figure, Finding, Findings, Section, Style, Table, Whisker, Whiskers};
use greylag_logs::quoted;
use greylag_sysid::amend::Prior;
use greylag_sysid::compare::answer::Method;
use greylag_sysid::diagnose::{Advice, Candidate, Diagnosis, Tuned};

pub(crate) fn advice(report: &DiagnosisReport) -> Section {
    let d = report.diagnosis;
    let word = |id: &String| report.effect_files.get(id).unwrap_or(id).clone();
    let finding = |a: &Advice| {
        let command = match &a.between {
            Some([a, b]) => format!(
                " Its schedule: greylag design --model {} --between {} {}",
                quoted(Path::new(&report.model_file)),
                word(a),
                word(b)
            ),
            None => String::new(),
        };
        let [manoeuvre, why] = [&a.manoeuvre, &a.why].map(|x| x.trim_end_matches('.'));
        Finding { sentence: format!("{manoeuvre}: {why}.{command}"), link: None }
    };
    let lead: Vec<Finding> = d.advice.iter().take(1).map(finding).collect();
    if lead.is_empty() {
        return Section::default();
    }
    let rest = d.advice.iter().skip(1).map(finding).collect();
    let figure = Figure::Findings(Findings { lead, rest, ..Findings::default() });
    Section::new("What to fly next", "The most useful first.", vec![figure])
}

/// Detection limits: for each effect that is not asserted, the smallest value that the flights would have shown.
pub(crate) fn unseen(d: &Diagnosis) -> Section {
    let columns = [("Effect", Left), ("Not seen below", Right), ("of", Left), ("What it is", Left)];
    let mut table = Table::new("What could not have been seen", &columns);
    for c in d.effects.iter().filter(|c| !c.asserted) {
        let amount = c.minimum_detectable.map_or_else(|| "any amount".into(), number);
        let what = c.parameters.first().map_or(String::new(), |p| match p.unit.is_empty() {
            true => p.name.clone(),
            false => format!("{}, {}", p.name, p.unit),
        });
        let description = c.description.trim_end_matches('.').to_string();
        table.push([c.id.clone(), amount, what, description]);
    }
    let note = "An effect that is not asserted may still be there: with these flights it could not \
                have been seen below this amount.";
    section("What could not have been seen", note, table)
}

/// The re-estimated coefficients of the model with their values in the model file (priors). The largest changes, in standard
/// deviations of the prior, come first.
///
/// `bounded` names the coefficients whose value is at a bound. `prior` and `method` are those of the fit.
pub(crate) fn tuned(tuned: &[Tuned], bounded: &[&str], prior: Prior, method: Method) -> Section {
    if tuned.is_empty() {
        return Section::default();
    }
    let mut sorted: Vec<&Tuned> = tuned.iter().collect();
    let pull = |t: &Tuned| ((t.value - t.prior) / t.prior_sd).abs();
    sorted.sort_by(|a, b| pull(b).total_cmp(&pull(a)));
    let figure = Whiskers {
        title: "Prior to tuned".into(),
        unit: "in standard deviations of the prior; ± in the text is 95 %".into(),
        scale: crate::Scale::Linear,
        lines: vec![-2.0, 0.0, 2.0],
        legend: "dashed: the prior and ± 2".into(),
        rows: sorted.iter().map(|t| tuned_row(t, bounded.contains(&t.name.as_str()))).collect(),
    };
    let far = sorted.iter().filter(|t| pull(t) > 2.0).count();
    let note = match prior {
        Prior::File => format!(
            "The model's own coefficients were fitted along by {}, held near their values in the file as \
             strongly as the file says they are known. {} of {} moved by more than two standard \
             deviations.",
            method.name(),
            if far == 0 { "None".into() } else { far.to_string() },
            sorted.len()
        ),
        Prior::Bounds => format!(
            "The model's own coefficients were fitted by {}, held only within what is possible.",
            method.name()
        ),
    };
    Section::new("Tuned coefficients", &note, vec![Figure::Whiskers(figure)])
}

/// `bounded` states whether the value is at a bound; it then has no interval.
fn tuned_row(t: &Tuned, bounded: bool) -> Whisker {
    let scaled = |x: f64| (x - t.prior) / t.prior_sd;
    let half = NORMAL_95 * t.sd;
    let error = if bounded { ", at its bound".into() } else { format!(" ± {}", number(half)) };
    Whisker {
        label: t.name.clone(),
        style: if scaled(t.value).abs() > 2.0 { Style::Command } else { Style::Actual },
        value: scaled(t.value),
        interval: match bounded {
            true => [f64::NAN; 2],
            false => [scaled(t.value - half), scaled(t.value + half)],
        },
        text: format!("{} → {}{error}", number(t.prior), number(t.value)),
    }
}

pub(crate) fn measurement(d: &Diagnosis) -> Section {
    let columns = [
        ("Flight", Left),
        ("What", Left),
        ("Value", Right),
        ("95 % interval", Right),
        ("Unit", Left),
        ("Clearly there", Left),
    ];
    let mut table = Table::new("Sensors and wind", &columns);
    for m in &d.measurement {
        let (factor, unit) = match m.unit.as_str() {
            "rad" => (1f64.to_degrees(), "°"),
            "rad/s" => (1f64.to_degrees(), "°/s"),
            other => (1.0, other),
        };
        let (value, half) = (factor * m.value, factor * NORMAL_95 * m.sd);
        table.push([
            m.flight.clone(),
            if m.name == m.id { m.name.clone() } else { format!("{}: {}", m.id, m.name) },
            number(value),
            interval(value - half, value + half),
            unit.to_string(),
            if m.asserted { "yes".into() } else { "no".to_string() },
        ]);
    }
    let note = match d.settings.per_flight.askew_deg {
        Some(_) => {
            "Decided from kinematics alone, before any aerodynamics, and taken out; axes_askew together with the aerodynamics."
        }
        None => "Decided from kinematics alone, before any aerodynamics, and taken out.",
    };
    section("Sensors and wind", note, table)
}

/// The trim constants that were estimated for each flight; an empty section if there are none.
pub(crate) fn trims(d: &Diagnosis) -> Section {
    let columns = [
        ("Flight", Left),
        ("Trim", Left),
        ("Value", Right),
        ("95 % interval", Right),
        ("Minus the flights' mean", Right),
        ("95 % interval", Right),
        ("Clearly its own", Left),
    ];
    let mut table = Table::new("Trims", &columns);
    let ends = |value: f64, sd: f64| interval(value - NORMAL_95 * sd, value + NORMAL_95 * sd);
    for t in &d.trims {
        let beside = t.beside_mean.map(|[by, sd]| [number(by), ends(by, sd)]);
        let [by, of] = beside.unwrap_or_default();
        table.push([
            t.flight.clone(),
            t.name.clone(),
            number(t.value),
            ends(t.value, t.sd),
            by,
            of,
            if t.asserted { "yes".into() } else { "no".to_string() },
        ]);
    }
    let note = "Fitted together with the aerodynamics, to be added to the model's coefficients in that flight. What all \
                flights have in common is in the model's coefficients as well, so that the difference from the \
                flights' mean is known better.";
    section("Trims of the flights", note, table)
}

pub(crate) fn candidates(d: &Diagnosis) -> Section {
    let columns = [
        ("Effect", Left),
        ("Asserted", Left),
        ("Evidence", Right),
        ("Chance", Right),
        ("Less error unseen (%)", Right),
        ("First in bootstraps (%)", Right),
        ("First parameter", Left),
        ("Channels", Left),
        ("Cannot be distinguished from", Left),
        ("Refused because", Left),
    ];
    let mut table = Table::new("Every candidate", &columns);
    for c in &d.effects {
        table.push([
            c.id.clone(),
            if c.asserted { "yes".into() } else { "no".to_string() },
            evidence(c.evidence),
            evidence(c.threshold),
            percent(c.heldout_error_reduction),
            percent(c.selected_in_bootstraps),
            first(c),
            c.channels.join(", "),
            c.indistinguishable_from.join(", "),
            c.refused.join("; "),
        ]);
    }
    let left = match d.learnable_remainder.is_finite() {
        true => format!(
            "After the asserted effects, a flexible model trained on the other flights could still \
             remove {} % of what is left beyond noise.",
            percent(d.learnable_remainder)
        ),
        false => String::new(),
    };
    section("Every candidate", &left, table)
}

fn first(c: &Candidate) -> String {
    c.parameters.first().map_or(String::new(), |p| {
        format!("{} = {} ({})", p.name, number(p.value), interval(p.ci95[0], p.ci95[1]))
    })
}

pub(crate) fn notes(d: &Diagnosis) -> Section {
    let mut table = Table::new("Notes", &[("Note", Left)]);
    d.notes.iter().for_each(|note| table.push([note.clone()]));
    section("Notes", "What was assumed, skipped or lost.", table)
}

pub(crate) fn provenance(report: &DiagnosisReport) -> Section {
    let d = report.diagnosis;
    let mut table = Table::new("Provenance", &[("Item", Left), ("Value", Left)]);
    let mut push = |item: &str, value: String| table.push([item.to_string(), value]);
    push("Program", format!("greylag {}", d.version));
    push("Model", format!("{} ({})", d.model, report.model_file));
    report.log_files.iter().for_each(|file| push("Log", file.clone()));
    let s = &d.settings;
    push("Seed", s.seed.to_string());
    push("Nulls drawn", s.nulls.to_string());
    push("Bootstraps", s.bootstraps.to_string());
    if !s.without.is_empty() {
        push("Left out of the catalogue", s.without.join(", "));
    }
    push("Command line", report.command_line.clone());
    report.versions.iter().for_each(|(program, version)| push(program, version.clone()));
    push("Plots", "uPlot 1.6.32 (MIT)".into());
    Section::new("Provenance", "", vec![Figure::Table(table)])
}

/// A section with one table. If the table has no rows, the section is empty.
fn section(title: &str, note: &str, table: Table) -> Section {
    match table.rows.is_empty() {
        true => Section::default(),
        false => Section::new(title, note, vec![Figure::Table(table)]),
    }
}
