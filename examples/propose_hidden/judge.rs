//! Comparison of a proposed formula with the hidden effect.

use greylag::sysid::diagnose::{Proposal, trend};

use super::draw::{CHANNELS, Drawn, VARIABLES};

/// The variables of a formula. A body rate counts as its dimensionless form.
fn variables(formula: &str) -> Vec<&'static str> {
    let has = |v: &str| {
        let part = |c: char| c.is_alphanumeric() || c == '_';
        formula.split(|c| !part(c)).any(|word| word == v || format!("{word}_hat") == v)
    };
    let mut all: Vec<&str> = VARIABLES.iter().map(|(v, _)| *v).filter(|v| has(v)).collect();
    all.sort_unstable();
    all
}

/// The shape of a formula: the part after its coefficient and the factor of its channel.
fn shape(formula: &str) -> &str {
    let (_, product) = formula.split_once("k*").unwrap_or(("", formula));
    let factors = CHANNELS.iter().filter_map(|(_, factor, _)| {
        product.strip_prefix(factor).and_then(|rest| rest.strip_prefix('*'))
    });
    factors.min_by_key(|rest| rest.len()).unwrap_or(product)
}

/// Whether two shapes are equal, where factors may have another order and constants may differ by a fifth.
fn same_form(found: &str, hidden: &str) -> bool {
    let parts = |text: &str| {
        let (mut words, mut numbers) = (Vec::new(), Vec::new());
        for word in text.split(|c: char| !(c.is_alphanumeric() || c == '_' || c == '.')) {
            match word.parse::<f64>() {
                Ok(number) => numbers.push(number),
                Err(_) => words.push(word.to_owned()),
            }
        }
        words.retain(|w| !w.is_empty());
        words.sort();
        (words, numbers)
    };
    let ((words, numbers), (wanted, thresholds)) = (parts(found), parts(hidden));
    let near = |(a, b): (&f64, &f64)| (a - b).abs() <= 0.2 * b.abs();
    words == wanted
        && numbers.len() == thresholds.len()
        && numbers.iter().zip(&thresholds).all(near)
}

/// Comparison of a proposal with a hidden effect, as JSON.
pub fn judged(p: &Proposal, hidden: Option<&Drawn>) -> serde_json::Value {
    let chosen = p.front.iter().find(|r| r.chosen).map(|r| r.formula.as_str());
    let first = chosen.and_then(|_| p.front.first()).map(|r| r.formula.as_str());
    let right = hidden.zip(first).map(|(h, formula)| {
        let found = shape(formula);
        [
            formula.starts_with(h.channel),
            variables(formula) == h.variables,
            variables(formula) == h.variables && trend(found) == trend(&h.shape),
            same_form(found, &h.shape),
        ]
    });
    serde_json::json!({
        "verdict": p.verdict,
        "proposed": p.effect.is_some(),
        "formula": chosen,
        "grades": p.grades,
        "channel_variables_trend_form": right,
        "refused": p.refused,
        "found": p.front.first().map(|r| r.formula.as_str()),
        "held_out_removed": p.held_out.as_ref().map(|h| h.removed),
        "evidence": p.front.first().map(|r| r.evidence),
        "threshold": p.front.first().map(|r| r.threshold),
        "free": p.free.as_ref().map(|f| serde_json::json!({ "why": f.why, "tried": f.tried, "chosen": f.chosen })),
    })
}
