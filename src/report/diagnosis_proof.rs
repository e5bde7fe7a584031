//! What bears a diagnosis out: what chance reaches, the error on flights that no fit has seen.

use super::Align::{Left, Right};
use super::comparison_page::{growth, unexplained};
use super::comparison_tables::summary;
use super::numbers::{number, percent};
use super::{Figure, Histogram, Rule, Section, Table, Verdict as Statement};
use crate::report::Outcome;
use crate::sysid::compare::{Comparison, ModelResult};
use crate::sysid::diagnose::Diagnosis;

/// Decoys in the table, the strongest first.
const DECOYS: usize = 8;
/// The horizon that the sentence speaks of, s, where there is one.
const TOLD_S: f64 = 5.0;

/// What chance reaches: simulated flights that lack nothing, columns that cannot be effects.
pub(super) fn chance(d: &Diagnosis) -> Section {
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
            "Best candidate of each simulated flight",
            "Evidence",
            "simulated flights",
            &d.nulls.best,
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
    let zero = n.best.iter().filter(|e| **e <= 0.0).count();
    let hidden = match zero {
        0 => String::new(),
        _ => format!(" {zero} found nothing at all and are not drawn."),
    };
    let strongest = n.best.iter().copied().filter(|e| e.is_finite()).fold(f64::NAN, f64::max);
    let most = match strongest.is_finite() {
        true => format!(" The strongest reached {}.", number(strongest)),
        false => String::new(),
    };
    format!(
        "{} flights of the tuned model were simulated with the same commands and sensors and \
         diagnosed alike; whatever is found in them is chance. Thresholds allow {} %.{most}{hidden} \
         Decoys are columns that cannot be effects: reversed in time, or with their phases shuffled.",
        n.count,
        number(100.0 * n.level),
    )
}

fn decoys(d: &Diagnosis) -> Table {
    let mut all: Vec<_> = d.decoys.iter().collect();
    all.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
    let mut table = Table::new("Decoys", &[("Decoy", Left), ("Evidence", Right)]);
    for decoy in all.iter().take(DECOYS) {
        table.push([decoy.name.clone(), number(decoy.evidence)]);
    }
    if all.len() > DECOYS {
        table.push([format!("{} more, all weaker", all.len() - DECOYS), String::new()]);
    }
    table
}

/// Free runs and what is unexplained on flights that no fit has seen, model by model.
pub(super) fn before_and_after(c: &Comparison) -> Section {
    let mut figures = vec![Figure::Verdict(statement(c))];
    figures.extend(growth(c));
    figures.push(unexplained(c));
    figures.extend(summary(c).figures);
    let names = c.flights.iter().map(|f| f.name.as_str()).collect::<Vec<_>>().join(", ");
    let note = format!(
        "The models fly freely on the recorded actuators of {names}, which no fit has seen, from \
         reconstructed states every {} s.",
        c.settings.start_every_s
    );
    Section::new("Before and after", &note, figures)
}

/// The fall of the error in one sentence: from the last but one model, the tuned one, to the last.
fn statement(c: &Comparison) -> Statement {
    let horizons = || c.settings.horizons_s.iter().copied();
    let told = horizons().find(|h| *h == TOLD_S).or(horizons().next_back()).unwrap_or(TOLD_S);
    let error = |m: &ModelResult| {
        m.free_run.iter().find(|s| s.horizon_s == told).map_or(f64::NAN, |s| s.rmse_scaled)
    };
    let [.., before, after] = &c.models[..] else {
        let sentence = "One model alone: there is nothing to compare it with.".into();
        return Statement { outcome: Outcome::Open, sentence, details: Vec::new() };
    };
    let (a, b) = (error(before), error(after));
    let (outcome, what) = match 1.0 - b / a {
        fall if !fall.is_finite() => (Outcome::Open, "cannot be told".to_string()),
        fall if fall > 0.0 => (Outcome::Reached, format!("falls by {} %", percent(fall))),
        fall => (Outcome::Missed, format!("rises by {} %", percent(-fall))),
    };
    let sentence = format!(
        "On flights that no fit has seen, the error after {told} s {what} with {}.",
        after.name
    );
    let detail = |m: &ModelResult| format!("{}: {} of x_c", m.name, number(error(m)));
    Statement { outcome, sentence, details: c.models.iter().map(detail).collect() }
}
