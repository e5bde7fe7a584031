//! The suspects of a diagnosis: evidence, curves, agreement between flights.

use super::diagnosis_page::channel_of;
use super::numbers::{NORMAL_95, interval, number};
use super::{
    Choice, ChoiceOption, Evidence, EvidenceGroup, EvidenceRow, Figure, Section, Style, Whisker,
    Whiskers, XyBand, XyFigure, XyMark, XySeries,
};
use crate::sysid::diagnose::{Candidate, Curve, Diagnosis};

/// Where sentences on an effect lead to.
pub(super) const ANCHOR: &str = "effect";
/// Candidates under their thresholds that are drawn; the table has all.
const BELOW: usize = 8;
/// Candidates that are not asserted whose curves are drawn.
const CURVES: usize = 3;
/// Points drawn of the measured scatter.
const POINTS: usize = 1500;

pub(super) fn ranking(d: &Diagnosis) -> Section {
    let mut seen: Vec<&str> = Vec::new();
    let mut groups = Vec::new();
    for found in d.effects.iter().filter(|c| c.asserted) {
        if !seen.contains(&found.id.as_str()) {
            groups.push(tied(d, found, &mut seen));
        }
    }
    let rest = || d.effects.iter().filter(|c| !seen.contains(&c.id.as_str()));
    let above = |c: &&Candidate| c.evidence > c.threshold;
    groups.push(EvidenceGroup {
        title: "Above chance, but refused".into(),
        note: String::new(),
        style: Style::Fourth,
        rows: rest().filter(above).map(row).collect(),
    });
    let below: Vec<&Candidate> = rest().filter(|c| !above(c)).collect();
    let more = below.len().saturating_sub(BELOW);
    groups.push(EvidenceGroup {
        title: "No more than chance".into(),
        note: if more > 0 { format!("{more} more are in the table below.") } else { String::new() },
        style: Style::Measured,
        rows: below.into_iter().take(BELOW).map(row).collect(),
    });
    groups.retain(|g| !g.rows.is_empty());
    if groups.is_empty() {
        return Section::default();
    }
    let note = "Evidence is the smaller of what the candidate gains in fit, less a penalty for its \
                parameters, and how surely its coefficients differ from nought over independent \
                stretches of flight. What chance reaches was found in simulated flights that lack \
                nothing. A candidate above it is refused where it does not hold on stretches that \
                the fit did not see, leaves what is physically possible, or the flights disagree.";
    let figure = Evidence { title: "Evidence against chance".into(), groups };
    Section::new("Suspects", note, vec![Figure::Evidence(figure)])
}

/// An asserted effect with those that the data cannot tell from it.
fn tied<'a>(d: &'a Diagnosis, found: &'a Candidate, seen: &mut Vec<&'a str>) -> EvidenceGroup {
    let alike = |c: &&Candidate| found.indistinguishable_from.contains(&c.id);
    let others: Vec<&Candidate> = d.effects.iter().filter(alike).collect();
    seen.push(&found.id);
    seen.extend(others.iter().map(|c| c.id.as_str()));
    let (title, note) = match found.indistinguishable_from.len() {
        0 => (format!("Asserted: {}", found.id), String::new()),
        _ => (
            format!("Asserted: {} or a look-alike", found.id),
            "These data cannot tell them apart; what to fly does.".to_string(),
        ),
    };
    let rows = std::iter::once(found).chain(others).map(row).collect();
    EvidenceGroup { title, note, style: Style::Actual, rows }
}

fn row(c: &Candidate) -> EvidenceRow {
    let mut detail = vec![c.description.trim_end_matches('.').to_string()];
    detail.extend(c.refused.iter().map(|why| format!("refused: {why}")));
    if !c.asserted && !c.indistinguishable_from.is_empty() {
        detail.push(format!("not to be told from {}", c.indistinguishable_from.join(", ")));
    }
    EvidenceRow {
        label: c.id.clone(),
        detail: detail.join("; "),
        value: c.evidence,
        threshold: c.threshold,
    }
}

pub(super) fn curves(d: &Diagnosis) -> Section {
    let with = |asserted: bool| {
        let of = d.effects.iter().filter(move |c| c.asserted == asserted);
        of.filter_map(|c| Some((c, c.curve.as_ref()?)))
    };
    let options: Vec<ChoiceOption> = with(true)
        .chain(with(false).take(CURVES))
        .map(|(c, curve)| ChoiceOption { name: c.id.clone(), figures: figures(c, curve) })
        .collect();
    if options.is_empty() {
        return Section::default();
    }
    let note = "What the flights show that the tuned model without the effect does not (points, \
                averages over about 0.4 s), and what the effect contributes as fitted, with its \
                95 % interval.";
    let choice = Choice { anchor: ANCHOR.into(), label: "Effect".into(), options };
    Section::new("The effect", note, vec![Figure::Choice(choice)])
}

fn figures(c: &Candidate, curve: &Curve) -> Vec<Figure> {
    vec![Figure::Xy(plot(c, curve)), Figure::Whiskers(parameters(c))]
}

fn plot(c: &Candidate, curve: &Curve) -> XyFigure {
    let every = curve.x.len().div_ceil(POINTS).max(1);
    let some = |list: &[f64]| list.iter().copied().step_by(every).collect::<Vec<f64>>();
    let column = |k: usize| curve.contribution.iter().map(|x| x[k]).collect::<Vec<f64>>();
    XyFigure {
        title: format!("{} over {}", channel_of(&curve.channel), curve.variable),
        x_label: curve.variable.clone(),
        y_label: format!("Measured − tuned model ({})", curve.unit),
        bands: vec![XyBand {
            label: "95 % interval".into(),
            x: curve.at.clone(),
            low: column(1),
            high: column(2),
        }],
        series: vec![
            XySeries {
                label: "measured".into(),
                style: Style::Measured,
                mark: XyMark::Dots,
                x: some(&curve.x),
                y: some(&curve.residual),
            },
            XySeries {
                label: c.id.clone(),
                style: Style::Command,
                mark: XyMark::Line,
                x: curve.at.clone(),
                y: column(0),
            },
        ],
    }
}

/// Each parameter in its own half widths: what it is, how far from nought.
fn parameters(c: &Candidate) -> Whiskers {
    let rows = c.parameters.iter().map(|p| {
        let half = 0.5 * (p.ci95[1] - p.ci95[0]).abs();
        let scaled = |x: f64| if half > 0.0 { x / half } else { f64::NAN };
        Whisker {
            label: match p.unit.is_empty() {
                true => p.name.clone(),
                false => format!("{}: {}", p.name, p.unit),
            },
            style: Style::Actual,
            value: scaled(p.value),
            interval: p.ci95.map(scaled),
            text: format!("{} ({})", number(p.value), interval(p.ci95[0], p.ci95[1])),
        }
    });
    Whiskers {
        title: "Parameters".into(),
        unit: "in half widths of the 95 % interval".into(),
        lines: vec![(0.0, "none:".into())],
        rows: rows.collect(),
    }
}

pub(super) fn agreement(d: &Diagnosis) -> Section {
    let figures: Vec<Figure> = d
        .effects
        .iter()
        .filter(|c| (c.asserted || c.evidence > c.threshold) && !c.by_flight.is_empty())
        .filter_map(|c| Some(Figure::Whiskers(by_flight(c)?)))
        .collect();
    let note = "The first parameter fitted on each flight alone, with its 95 % interval: flights \
                that disagree point to something else than this effect.";
    Section::new("Do the flights agree?", note, figures)
}

fn by_flight(c: &Candidate) -> Option<Whiskers> {
    let first = c.parameters.first()?;
    let text =
        |value: f64, ends: [f64; 2]| format!("{} ({})", number(value), interval(ends[0], ends[1]));
    let own = c.by_flight.iter().map(|f| {
        let ends = [f.value - NORMAL_95 * f.sd, f.value + NORMAL_95 * f.sd];
        Whisker {
            label: f.flight.clone(),
            style: Style::Second,
            value: f.value,
            interval: ends,
            text: text(f.value, ends),
        }
    });
    let all = Whisker {
        label: "all flights".into(),
        style: Style::Actual,
        value: first.value,
        interval: first.ci95,
        text: text(first.value, first.ci95),
    };
    Some(Whiskers {
        title: format!("{}: {}", c.id, first.name),
        unit: first.unit.clone(),
        lines: vec![(0.0, "none:".into())],
        rows: own.chain([all]).collect(),
    })
}
