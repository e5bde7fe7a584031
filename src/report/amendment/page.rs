//! Page about one amendment: the error before and after it, the added effects, and all coefficients. An amendment adds effects
//! to a model and re-estimates the coefficients.

use crate::Align::{Left, Right};
use crate::amendment::AmendmentReport;
use crate::comparison::place;
use crate::diagnosis::{proof, suspects, tables};
use crate::kit::html::file_names;
use crate::kit::numbers::{NORMAL_95, interval, number, percent};
use crate::{
    AnswerBox, Curves, Figure, Finding, Findings, First, Page, Section, Series, Style, Table,
};
use greylag_sysid::amend::{Amendment, FittedFlight, Parameter};
use greylag_sysid::compare::HorizonScore;
use greylag_sysid::compare::answer::Method;
use greylag_sysid::diagnose::Tuned;

/// Number of sentences about the amendment that are shown prominently.
const LEADING: usize = 2;

/// The page of `report`: first the answer, then the evidence for it.
pub fn amendment_page(report: &AmendmentReport) -> Page {
    let a = report.amendment;
    let answer = report.answer.unwrap_or(&a.answer).clone();
    let acts = answer.numbers.acts.clone();
    let place = report.held_out.map_or(String::new(), |c| place::of_models(&c.models, &acts));
    let answer = Figure::Answer(Box::new(AnswerBox { answer, place, first: First::Error }));
    let mut sections = vec![Section::new("", "", vec![answer])];
    sections.push(match report.held_out {
        Some(comparison) => proof::before_and_after(comparison, &place::named(&acts)),
        None => before_and_after(a),
    });
    sections.push(added(a));
    sections.push(effects(a));
    sections.push(in_words(a));
    sections.push(tables::tuned(&tuned(a), &bounded(a), report.prior, Method::OutputError));
    sections.push(sensors(a).folded());
    sections.push(notes(a).folded());
    sections.push(provenance(report).folded());
    sections.retain(|s| !s.figures.is_empty());
    let subtitle = format!("{} with {}.", a.model, file_names(&report.log_files));
    Page { title: report.title.clone(), subtitle, sections }
}

/// Section with the sentences of the amendment; the first [`LEADING`] sentences are prominent.
fn in_words(a: &Amendment) -> Section {
    let finding = |s: &String| Finding { sentence: s.clone(), link: None };
    let [lead, rest] = [
        &a.sentences[..LEADING.min(a.sentences.len())],
        &a.sentences[LEADING.min(a.sentences.len())..],
    ]
    .map(|some| some.iter().map(finding).collect::<Vec<_>>());
    match lead.is_empty() {
        true => Section::default(),
        false => Section::new(
            "In words",
            "",
            vec![Figure::Findings(Findings { lead, rest, ..Findings::default() })],
        ),
    }
}

/// Section with the prediction errors of the model as given, re-estimated and amended, at each horizon.
fn before_and_after(a: &Amendment) -> Section {
    let models = [("as given", &a.given), ("tuned", &a.before), ("amended", &a.after)];
    let columns = [
        ("Model", Left),
        ("Horizon (s)", Right),
        ("Runs", Right),
        ("Diverged (%)", Right),
        ("NRMSE", Right),
    ];
    let mut table = Table::new("Errors on flights that no fit has seen", &columns);
    for (name, scores) in models {
        for s in scores {
            let diverged = percent(s.divergence_rate);
            let [horizon, runs] = [s.horizon_s.to_string(), s.runs.to_string()];
            table.push([name.to_string(), horizon, runs, diverged, number(s.rmse_scaled)]);
        }
    }
    let error = |scores: &[HorizonScore], h: &f64| {
        scores.iter().find(|s| s.horizon_s == *h).map_or(f64::NAN, |s| s.rmse_scaled)
    };
    let horizons = &a.settings.horizons_s;
    let series = models.into_iter().enumerate().filter(|(_, (_, scores))| !scores.is_empty()).map(
        |(i, (name, scores))| {
            let values = horizons.iter().map(|h| error(scores, h)).collect();
            Series::new(name, Style::nth(i), values)
        },
    );
    let curves = Curves {
        title: "Error over the horizon".into(),
        x_label: "Time after the start (s)".into(),
        y_label: "NRMSE".into(),
        x: horizons.clone(),
        series: series.collect(),
        ..Curves::default()
    };
    if table.rows.is_empty() {
        return Section::default();
    }
    let note = format!(
        "Free runs on the recorded actuators of {}, which no fit has seen. “Tuned”: fitted to free runs (output error).",
        a.held_out.join(", ")
    );
    Section::new("Before and after", &note, vec![Figure::Curves(curves), Figure::Table(table)])
}

fn effects(a: &Amendment) -> Section {
    let columns =
        [("Effect", Left), ("In the model", Left), ("What it is, and what is against it", Left)];
    let mut table = Table::new("Effects", &columns);
    for e in &a.effects {
        let mut text = vec![e.description.trim_end_matches('.').to_string()];
        text.extend(e.refused.iter().map(|why| format!("refused: {why}")));
        if !e.refused.is_empty() {
            text.push(format!("to decide, fly: {}", e.fly_next));
        }
        let added = if e.joined { "yes" } else { "no" };
        table.push([e.id.clone(), added.to_string(), text.join("; ")]);
    }
    match table.rows.is_empty() {
        true => Section::default(),
        false => Section::new("Effects asked for", "", vec![Figure::Table(table)]),
    }
}

/// Section on the coefficients of the added effects, with the estimates from each flight alone.
fn added(a: &Amendment) -> Section {
    let columns =
        [("Coefficient", Left), ("Value", Right), ("95 % interval", Right), ("What it is", Left)];
    let mut table = Table::new("Coefficients of the effects", &columns);
    let mut single = Vec::new();
    for p in a.parameters.iter().filter(|p| p.added) {
        let bound = if p.at_bound { " (at a bound of what is possible)" } else { "" };
        let what = format!("{}{bound}", p.meaning);
        let ends = if p.at_bound { "none".into() } else { interval(p.ci95[0], p.ci95[1]) };
        table.push([p.name.clone(), number(p.value), ends, what]);
        if !p.by_flight.is_empty() {
            let apart = suspects::disagreement(p.by_flight.iter().map(|f| [f.value, f.sd]));
            single.push((apart, Figure::Whiskers(by_flight(p))));
        }
    }
    if table.rows.is_empty() {
        return Section::default();
    }
    single.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut figures = vec![Figure::Table(table)];
    figures.extend(single.into_iter().map(|(_, figure)| figure));
    let note = "As fitted by output error together with the model's own coefficients; below, what \
                each flight alone says, to first order. The coefficient on which they differ most \
                comes first.";
    Section::new("The effects as fitted", note, figures)
}

fn by_flight(p: &Parameter) -> crate::Whiskers {
    let flights = p.by_flight.iter().map(|f| (f.flight.as_str(), f.value, f.sd));
    suspects::flight_by_flight(p.name.clone(), "", flights, (p.value, p.ci95))
}

/// The coefficients that the model had before effects were added, with their prior and estimated values.
fn tuned(a: &Amendment) -> Vec<Tuned> {
    let own = a.parameters.iter().filter(|p| !p.added);
    own.map(|p| Tuned {
        name: p.name.clone(),
        prior: p.prior,
        prior_sd: p.prior_sd,
        value: p.value,
        sd: p.sd,
    })
    .collect()
}

/// Names of the coefficients whose estimate is at a bound. Such an estimate has no interval, because its standard deviation is that
/// of a fit without bounds.
fn bounded(a: &Amendment) -> Vec<&str> {
    a.parameters.iter().filter(|p| p.at_bound).map(|p| p.name.as_str()).collect()
}

fn sensors(a: &Amendment) -> Section {
    let columns = [
        ("Flight", Left),
        ("What", Left),
        ("Value", Right),
        ("95 % interval", Right),
        ("Unit", Left),
    ];
    let mut table = Table::new("Sensors", &columns);
    for f in &a.flights {
        for (what, [value, sd], factor, unit) in constants(f) {
            let (value, half) = (factor * value, factor * NORMAL_95 * sd);
            let ends = interval(value - half, value + half);
            table.push([f.flight.clone(), what.into(), number(value), ends, unit.to_string()]);
        }
        for c in &f.own {
            let angle = c.name.starts_with("askew");
            let (factor, unit) = if angle { (1f64.to_degrees(), "°") } else { (1.0, "") };
            let (value, half) = (factor * c.value, factor * NORMAL_95 * c.sd);
            let ends = interval(value - half, value + half);
            let what = if angle { "axes turned: " } else { "trim: " };
            let what = format!("{what}{}", c.name);
            table.push([f.flight.clone(), what, number(value), ends, unit.to_string()]);
        }
    }
    if table.rows.is_empty() {
        return Section::default();
    }
    let seconds: f64 = a.flights.iter().map(|f| f.seconds).sum();
    let note = format!(
        "Fitted along over {seconds:.0} s of flight, so that no sensor passes for an effect."
    );
    Section::new("Sensors", &note, vec![Figure::Table(table)])
}

/// Sensor errors estimated for a flight: name, value with standard deviation, factor to the displayed unit, and this unit.
fn constants(f: &FittedFlight) -> [(&'static str, [f64; 2], f64, &'static str); 4] {
    let degree = 1f64.to_degrees();
    [
        ("actuators late by", f.actuators_late_s, 1e3, "ms"),
        ("airspeed's scale off by", f.airspeed_scale, 100.0, "%"),
        ("α bias left", f.alpha_bias_rad, degree, "°"),
        ("β bias left", f.beta_bias_rad, degree, "°"),
    ]
}

fn notes(a: &Amendment) -> Section {
    let mut table = Table::new("Notes", &[("Note", Left)]);
    a.notes.iter().for_each(|note| table.push([note.clone()]));
    match table.rows.is_empty() {
        true => Section::default(),
        false => {
            Section::new("Notes", "What was assumed, skipped or lost.", vec![Figure::Table(table)])
        }
    }
}

fn provenance(report: &AmendmentReport) -> Section {
    let a = report.amendment;
    let mut table = Table::new("Provenance", &[("Item", Left), ("Value", Left)]);
    let mut push = |item: &str, value: String| table.push([item.to_string(), value]);
    push("Program", format!("greylag {}", a.version));
    report.model_files.iter().for_each(|file| push("Model", file.clone()));
    report.log_files.iter().for_each(|file| push("Log", file.clone()));
    push("Held out", a.held_out.join(", "));
    let lengths: Vec<String> = a.settings.lengths_s.iter().map(f64::to_string).collect();
    push("Shots", format!("{} s", lengths.join(", ")));
    push("Improvement judged at", format!("{} s", a.settings.judged_at_s));
    push("Command line", report.command_line.clone());
    report.versions.iter().for_each(|(program, version)| push(program, version.clone()));
    push("Plots", "uPlot 1.6.32 (MIT)".into());
    Section::new("Provenance", "", vec![Figure::Table(table)])
}
