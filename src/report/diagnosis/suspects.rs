//! The figures about the candidate effects of a diagnosis: their probabilities, their evidence, their curves, and the agreement
//! between flights. A candidate is an effect that the model may lack. Its evidence is a test statistic, which is compared with a
//! threshold. It is asserted if the diagnosis concludes that the model lacks it.

use crate::Align::{Left, Right};
use crate::diagnosis::page::channel_of;
use crate::diagnosis::place::plain;
use crate::kit::numbers::{NORMAL_95, interval, number};
use crate::{
    Choice, ChoiceOption, Evidence, EvidenceGroup, EvidenceRow, Figure, Probabilities,
    ProbabilityRow, Section, Style, Table, Whisker, Whiskers, XyBand, XyFigure, XyMark, XySeries,
};
use greylag_sysid::compare::answer::acts_in;
use greylag_sysid::diagnose::{Candidate, Curve, Diagnosis, Explanation, Parameter};

/// Anchor of the figure in the page, for links to it.
pub(crate) const ANCHOR: &str = "effect";
/// Largest number of candidates with evidence below the threshold in the figure. The table has all candidates.
const BELOW: usize = 8;
/// Largest number of candidates whose curves are drawn although they are not asserted.
const CURVES: usize = 3;
/// Number of measured points above which a plot leaves out some of them.
const POINTS: usize = 1500;
/// Sentence on the probabilities of the explanations. The workbench has the same.
const PROBABLE: &str = "The probability that this is what the model lacks above all: in simulated flights in which that is known, \
                        statements with 90 % were right in about 90 % (docs/validation/probabilities.md).";

pub(crate) fn ranking(d: &Diagnosis) -> Section {
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
        title: "Above chance, but not asserted".into(),
        note: String::new(),
        style: Style::Fourth,
        rows: rest().filter(above).map(row).collect(),
    });
    let below: Vec<&Candidate> = rest().filter(|c| !above(c)).collect();
    let more = below.len().saturating_sub(BELOW);
    groups.push(EvidenceGroup {
        title: "No more than chance".into(),
        note: match more {
            0 => String::new(),
            1 => "One more is in the table below.".into(),
            n => format!("{n} more are in the table below."),
        },
        style: Style::Measured,
        rows: below.into_iter().take(BELOW).map(row).collect(),
    });
    groups.retain(|g| !g.rows.is_empty());
    if groups.is_empty() {
        return Section::default();
    }
    let note = "Evidence is the smaller of what the candidate gains in fit, less a penalty for its \
                parameters, and how surely its coefficients differ from zero over independent \
                stretches of flight. The threshold is what chance reaches on \
                resampled flights that lack nothing. A candidate above it is refused if it does not hold on stretches \
                that the fit did not use, if it is physically impossible, or if the flights disagree.";
    let evidence = Evidence { title: "Evidence against chance".into(), groups };
    let figures = probabilities(d).into_iter().chain([Figure::Evidence(evidence)]).collect();
    Section::new("Suspects", note, figures)
}

/// The probabilities of the explanations; `None` if the diagnosis states none.
fn probabilities(d: &Diagnosis) -> Option<Figure> {
    let listed = d.explanations.iter().filter(|e| e.is_listed());
    let row = |e: &Explanation| ProbabilityRow {
        label: e.words().to_string(),
        probability: e.probability,
    };
    let rows: Vec<ProbabilityRow> = listed.map(row).collect();
    let (title, note) = ("How probable each explanation is".into(), PROBABLE.into());
    (!rows.is_empty()).then_some(Figure::Probabilities(Probabilities { title, note, rows }))
}

/// The rows of the asserted effect `found` and of the effects that the data cannot distinguish from it. Adds their ids to `seen`.
fn tied<'a>(d: &'a Diagnosis, found: &'a Candidate, seen: &mut Vec<&'a str>) -> EvidenceGroup {
    let alike = |c: &&Candidate| found.indistinguishable_from.contains(&c.id);
    let others: Vec<&Candidate> = d.effects.iter().filter(alike).collect();
    seen.push(&found.id);
    seen.extend(others.iter().map(|c| c.id.as_str()));
    let (title, note) = match found.indistinguishable_from.len() {
        0 => (format!("Asserted: {}", found.id), String::new()),
        _ => (
            format!("Asserted: {} or a look-alike", found.id),
            "These data cannot distinguish them; the section What to fly next names flights that can.".to_string(),
        ),
    };
    let plain = |c: &Candidate| EvidenceRow { detail: detail(c).join("; "), ..row(c) };
    let rows = std::iter::once(found).chain(others).map(plain).collect();
    EvidenceGroup { title, note, style: Style::Actual, rows }
}

fn row(c: &Candidate) -> EvidenceRow {
    let mut detail = detail(c);
    if !c.indistinguishable_from.is_empty() {
        detail
            .push(format!("cannot be distinguished from {}", c.indistinguishable_from.join(", ")));
    }
    EvidenceRow {
        label: c.id.clone(),
        detail: detail.join("; "),
        value: c.evidence,
        threshold: c.threshold,
    }
}

fn detail(c: &Candidate) -> Vec<String> {
    let what = c.description.trim_end_matches('.').to_string();
    let refused = c.refused.iter().map(|why| format!("refused: {}", why.trim_end_matches('.')));
    std::iter::once(what).chain(refused).collect()
}

/// The candidates of the section [`curves`]: the asserted ones that have curves, then the nearest of the others. Without an
/// asserted effect, the nearest candidate comes first even if it has no curve, because the answer names it.
fn shown(d: &Diagnosis) -> Vec<&Candidate> {
    let none = d.effects.iter().all(|c| !c.asserted);
    let nearest = d.effects.first().filter(|c| none && !c.parameters.is_empty());
    let drawn = |asserted: bool| {
        d.effects.iter().filter(move |c| c.asserted == asserted && c.curve.is_some())
    };
    let undrawn = nearest.filter(|c| c.curve.is_none());
    drawn(true).chain(undrawn).chain(drawn(false).take(CURVES)).collect()
}

pub(crate) fn curves(d: &Diagnosis) -> Section {
    let shown = shown(d);
    let Some(first) = shown.first() else { return Section::default() };
    let option = |c: &&Candidate| ChoiceOption { name: c.id.clone(), figures: figures(c) };
    let options: Vec<ChoiceOption> = shown.iter().map(option).collect();
    let found: Vec<&str> = d.effects.iter().filter(|c| c.asserted).map(|c| c.id.as_str()).collect();
    let mut beside = match (found.len(), options.len()) {
        (0, _) => {
            " An interval without zero proves no suspect: its evidence must exceed chance, and no check may refuse it."
                .into()
        }
        (some, all) if some < all => {
            format!(" Missing: {}; the others are no more than suspects.", found.join(", "))
        }
        _ => String::new(),
    };
    let acts = d.effects.iter().filter(|c| c.asserted && !c.acts.is_empty());
    for c in acts {
        let channels = acts_in(&c.acts, found.len(), d.compared().method);
        beside += &format!(" {} acts {channels}.", c.id);
    }
    if first.curve.is_none() {
        beside += &format!(" {}, the nearest, has no curve over a single variable.", first.id);
    }
    let note = format!(
        "Partial residuals (points, averages over about 0.4 s): the measured value less all other terms of the \
         fit, and what the effect contributes in it, with its 95 % interval. Tuning without the effect leaves less, \
         because other coefficients take up a part of it.{beside}"
    );
    // the title must not present candidates that are not asserted as findings
    let title = if found.is_empty() { "Nearest suspects, none proven" } else { "The effect" };
    let choice = Choice { anchor: ANCHOR.into(), label: "Effect".into(), options };
    Section::new(title, &note, vec![Figure::Choice(choice)])
}

fn figures(c: &Candidate) -> Vec<Figure> {
    let curve = c.curve.as_ref().map(|curve| Figure::Xy(plot(c, curve)));
    curve.into_iter().chain([Figure::Table(parameters(c))]).collect()
}

fn plot(c: &Candidate, curve: &Curve) -> XyFigure {
    let every = curve.x.len().div_ceil(POINTS).max(1);
    let some = |list: &[f64]| list.iter().copied().step_by(every).collect::<Vec<f64>>();
    let column = |k: usize| curve.contribution.iter().map(|x| x[k]).collect::<Vec<f64>>();
    XyFigure {
        title: format!("{} over {}", channel_of(&curve.channel), plain(&curve.variable)),
        x_label: curve.variable.clone(),
        y_label: format!("Partial residual ({})", curve.unit),
        bands: vec![XyBand {
            label: "95 % interval".into(),
            x: curve.at.clone(),
            low: column(1),
            high: column(2),
        }],
        series: vec![
            XySeries {
                label: "partial residuals".into(),
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

fn parameters(c: &Candidate) -> Table {
    let columns = [("Parameter", Left), ("Value", Right), ("95 % interval", Right), ("Unit", Left)];
    let mut table = Table::new(&format!("Parameters of {}", c.id), &columns);
    for p in &c.parameters {
        let ends = interval(p.ci95[0], p.ci95[1]);
        table.push([p.name.clone(), number(p.value), ends, p.unit.clone()]);
    }
    table
}

pub(crate) fn agreement(d: &Diagnosis) -> Section {
    let shown = d.effects.iter().filter(|c| c.asserted || c.evidence > c.threshold);
    let mut all: Vec<(f64, Whiskers)> = Vec::new();
    for c in shown {
        for p in c.parameters.iter().filter(|p| !p.by_flight.is_empty()) {
            let apart = disagreement(p.by_flight.iter().map(|f| [f.value, f.sd]));
            all.push((apart, by_flight(c, p)));
        }
    }
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    let figures = all.into_iter().map(|(_, figure)| Figure::Whiskers(figure)).collect();
    let note = "Each parameter fitted on each flight alone, with its 95 % interval. The one on which the flights differ \
                most, in standard deviations, comes first: flights that disagree point to something else than this \
                effect. “all flights” is the final value, fitted together with the model's own coefficients, and may \
                lie beside those of the flights.";
    Section::new("Do the flights agree?", note, figures)
}

fn by_flight(c: &Candidate, p: &Parameter) -> Whiskers {
    let flights = p.by_flight.iter().map(|f| (f.flight.as_str(), f.value, f.sd));
    let title = format!("{}: {}", c.id, p.name);
    flight_by_flight(title, &p.unit, flights, (p.value, p.ci95))
}

/// Root mean square of the distances of the flights' estimates from their weighted mean, each in units of its standard deviation.
/// `flights` has an estimate and its standard deviation for each flight. 0 if fewer than two are finite.
pub(crate) fn disagreement(flights: impl Iterator<Item = [f64; 2]>) -> f64 {
    let known: Vec<[f64; 2]> =
        flights.filter(|[value, sd]| value.is_finite() && sd.is_finite() && *sd > 0.0).collect();
    if known.len() < 2 {
        return 0.0;
    }
    let total: f64 = known.iter().map(|[_, sd]| sd.powi(-2)).sum();
    let mean = known.iter().map(|[value, sd]| value * sd.powi(-2)).sum::<f64>() / total;
    let square: f64 = known.iter().map(|[value, sd]| ((value - mean) / sd).powi(2)).sum();
    (square / (known.len() - 1) as f64).sqrt()
}

/// A figure with the estimates of a coefficient from each flight alone (flight, value, standard deviation). Its last row is the
/// estimate from all flights together (value with its 95 % interval).
pub(crate) fn flight_by_flight<'a>(
    title: String,
    unit: &str,
    flights: impl Iterator<Item = (&'a str, f64, f64)>,
    (value, ends): (f64, [f64; 2]),
) -> Whiskers {
    let row = |label: &str, style: Style, value: f64, ends: [f64; 2]| Whisker {
        label: label.into(),
        style,
        value,
        interval: ends,
        text: format!("{} ({})", number(value), interval(ends[0], ends[1])),
    };
    let mut rows: Vec<Whisker> = flights
        .map(|(flight, value, sd)| {
            row(flight, Style::Second, value, [value - NORMAL_95 * sd, value + NORMAL_95 * sd])
        })
        .collect();
    rows.push(row("all flights", Style::Actual, value, ends));
    let legend = "dashed: none of it".into();
    Whiskers {
        title,
        unit: unit.into(),
        scale: crate::Scale::Linear,
        lines: vec![0.0],
        legend,
        rows,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flights_that_differ_beyond_their_deviations_disagree() {
        let of = |all: &[[f64; 2]]| disagreement(all.iter().copied());
        assert_eq!(of(&[[1.0, 0.1]]), 0.0);
        assert_eq!(of(&[[1.0, 0.1], [f64::NAN, 0.1], [2.0, 0.0]]), 0.0);
        // both estimates lie 0.5 from the mean, which is 5 standard deviations: √(2 × 25)
        assert!((of(&[[1.0, 0.1], [2.0, 0.1]]) - 50f64.sqrt()).abs() < 1e-9);
        assert!(of(&[[1.0, 0.5], [1.2, 0.5]]) < 1.0);
    }
}
