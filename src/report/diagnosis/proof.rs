//! Support for a diagnosis: the evidence that arises by chance, and the error on held-out flights, which no fit has used.
//! Evidence is the test statistic of a candidate effect.

use crate::Align::{Left, Right};
use crate::comparison::page::{growth, unexplained};
use crate::comparison::tables::summary;
use crate::kit::numbers::{evidence, number, percent};
use crate::{Figure, Finding, Findings, Histogram, Rule, Section, Table};
use greylag_sysid::compare::{ChannelId, Comparison, ModelResult};
use greylag_sysid::diagnose::Diagnosis;

/// Smallest evidence that the histogram shows. Smaller values would stretch its logarithmic axis.
const DRAWN: f64 = 0.1;
/// Number of decoys (placebo regressors) in the table, in order of decreasing evidence.
const DECOYS: usize = 8;
/// Preferred horizon for the error in the sentence, s. If the comparison does not have it, the last horizon is used.
const SHOWN_S: f64 = 5.0;

/// Section on the evidence that arises by chance: in surrogate flights without a missing effect (nulls), and for
/// placebo regressors (decoys).
pub(crate) fn chance(d: &Diagnosis) -> Section {
    let mut figures = Vec::new();
    let best = d.effects.iter().find(|c| c.asserted).or(d.effects.first());
    if !d.nulls.best.is_empty() {
        let decoy = d.decoys.iter().map(|x| x.evidence).filter(|e| e.is_finite());
        let decoy = decoy.fold(f64::NAN, f64::max);
        let mut rules = Vec::new();
        if let Some(best) = best {
            rules.push(Rule { value: best.threshold, label: "threshold".into() });
            rules.push(Rule { value: best.evidence, label: best.id.clone() });
        }
        rules.push(Rule { value: decoy, label: "best decoy".into() });
        rules.retain(|r| r.value.is_finite() && r.value > 0.0);
        figures.push(Figure::Histogram(Histogram::log(
            "Best candidate of each null",
            "Evidence",
            "nulls",
            &d.nulls.best.iter().copied().filter(|e| *e >= DRAWN).collect::<Vec<_>>(),
            rules,
        )));
    }
    if !d.decoys.is_empty() {
        figures.push(Figure::Table(decoys(d)));
    }
    Section::new("What chance reaches", &chance_note(d), figures)
}

fn chance_note(d: &Diagnosis) -> String {
    let n = &d.nulls;
    let hidden = match n.best.iter().filter(|e| **e < DRAWN).count() {
        0 => String::new(),
        found => format!(" In {found} nothing reached {DRAWN}; they are not drawn."),
    };
    let strongest = n.best.iter().copied().filter(|e| e.is_finite()).fold(f64::NAN, f64::max);
    let most = match strongest.is_finite() {
        true => format!(" The strongest reached {}.", evidence(strongest)),
        false => String::new(),
    };
    format!(
        "{} nulls were drawn that lack nothing: these flights under the tuned model, with what the \
         richest fit leaves as noise, its sign drawn anew for every stretch of some seconds, and the \
         coefficients wrong by chance within their widths. What is found in them is chance. Thresholds allow {} %.{most}{hidden} \
         Decoys are columns that cannot be effects: reversed in time, or with their phases shuffled.",
        n.count,
        (1e4 * n.level).round() / 100.0,
    )
}

fn decoys(d: &Diagnosis) -> Table {
    let mut all: Vec<_> = d.decoys.iter().collect();
    all.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
    let mut table = Table::new("Decoys", &[("Decoy", Left), ("Evidence", Right)]);
    for decoy in all.iter().take(DECOYS) {
        table.push([decoy.name.clone(), evidence(decoy.evidence)]);
    }
    if all.len() > DECOYS {
        table.push([format!("{} more, all weaker", all.len() - DECOYS), String::new()]);
    }
    table
}

/// The section [`before_and_after`], preceded by a sentence on the change of the error, for a page whose answer is about other
/// flights.
pub(crate) fn stated(c: &Comparison) -> Section {
    let mut section = before_and_after(c, &[]);
    section.figures.insert(0, Figure::Findings(statement(c)));
    section
}

/// Section with the errors of free runs (open-loop simulations) and the unexplained shares of each model, on flights that
/// no fit has used. The channels `named` by the page's answer come first.
pub(crate) fn before_and_after(c: &Comparison, named: &[ChannelId]) -> Section {
    let mut figures = growth(c);
    figures.extend(unexplained(c, named));
    // Only the table by horizon is shown; the errors of single states are on the page of the comparison.
    figures.extend(summary(c).figures.into_iter().take(1));
    let names = c.flights.iter().map(|f| f.name.as_str()).collect::<Vec<_>>().join(", ");
    let note = format!(
        "The models fly freely on the recorded actuators of {names}, which no fit has seen, from \
         reconstructed states every {} s.",
        c.settings.start_every_s
    );
    Section::new("Before and after", &note, figures)
}

/// Sentence on the change of the free-run error from the last model but one to the last, and the error of each model.
fn statement(c: &Comparison) -> Findings {
    let horizons = || c.settings.horizons_s.iter().copied();
    let shown = horizons().find(|h| *h == SHOWN_S).or(horizons().next_back()).unwrap_or(SHOWN_S);
    let error = |m: &ModelResult| {
        m.free_run.iter().find(|s| s.horizon_s == shown).map_or(f64::NAN, |s| s.rmse_scaled)
    };
    let plain = |sentence: String| Finding { sentence, link: None };
    let lead = match &c.models[..] {
        [.., before, after] => {
            let what = match 1.0 - error(after) / error(before) {
                fall if !fall.is_finite() => "cannot be determined".to_string(),
                fall if fall >= 0.0 => format!("falls by {} %", percent(fall)),
                fall => format!("rises by {} %", percent(-fall)),
            };
            format!(
                "On flights that no fit has seen, the error after {shown} s {what} from “{}” to “{}”.",
                before.name, after.name
            )
        }
        _ => "There is one model only, and nothing to compare it with.".into(),
    };
    let detail = |m: &ModelResult| {
        plain(format!("{}: {} of the characteristic values x_c", m.name, number(error(m))))
    };
    let rest = c.models.iter().map(detail).collect();
    Findings { lead: vec![plain(lead)], rest, ..Findings::default() }
}
