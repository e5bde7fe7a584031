//! The table of the campaign with required, desired and reached values.

use std::collections::BTreeMap;

use comfy_table::{CellAlignment, Table};
use greylag::num::statistics::quantile;

use crate::record::{HeldOut, Record};
use crate::search::total;

/// An effect is expected to be found if its amplitude is at least this multiple of the minimum detectable amplitude.
const EXPECTED: f64 = 3.0;

/// The summary table and a table by effect, as text.
pub fn render(records: &[Record]) -> String {
    let failed = records.iter().filter(|r| r.failure.is_some()).count();
    let mut out = format!("{}\n", summary(records));
    out += &format!("{}\n", by_effect(records));
    out += &format!("{} cases, {failed} of them without an answer\n", records.len());
    let mut reasons: Vec<_> = records
        .iter()
        .filter_map(|r| Some(format!("{}: {}", r.key, r.failure.as_ref()?)))
        .collect();
    out += &never_clear(records);
    reasons.truncate(20);
    reasons.iter().for_each(|reason| out += &format!("  {reason}\n"));
    let seconds: Vec<f64> = records.iter().map(|r| total(&r.seconds)).collect();
    let part = |of: fn(&Record) -> f64| quantile(&records.iter().map(of).collect::<Vec<_>>(), 0.5);
    out + &format!(
        "seconds a case on one core: median {:.1} (flights {:.1}, diagnosis {:.1}, fits {:.1}), longest {:.1}\n",
        quantile(&seconds, 0.5),
        part(|r| r.seconds.flights),
        part(|r| r.seconds.diagnose),
        part(|r| r.seconds.amend),
        quantile(&seconds, 1.0),
    )
}

fn header<const N: usize>(names: [&str; N]) -> Table {
    let mut table = Table::new();
    table.load_style(comfy_table::presets::UTF8_FULL_CONDENSED);
    table.set_header(names);
    table.column_iter_mut().skip(1).for_each(|c| c.set_cell_alignment(CellAlignment::Right));
    table
}

/// Percentage and number of the `records` for which `holds` returns true, as text.
fn share<'a>(
    records: impl IntoIterator<Item = &'a Record>,
    holds: impl Fn(&Record) -> bool,
) -> String {
    let all: Vec<bool> = records.into_iter().map(holds).collect();
    let yes = all.iter().filter(|x| **x).count();
    match all.len() {
        0 => "–".into(),
        n => format!("{:.1} % ({yes} of {n})", 100.0 * yes as f64 / n as f64),
    }
}

/// The median and the quantile `other` of the finite `values`, multiplied by `unit`, as text.
fn two(values: impl Iterator<Item = f64>, other: f64, unit: f64, places: usize) -> String {
    let values: Vec<f64> = values.filter(|x| x.is_finite()).collect();
    if values.is_empty() {
        return "–".into();
    }
    let at = |q: f64| unit * quantile(&values, q);
    format!("{:.places$} / {:.places$} ({})", at(0.5), at(other), values.len())
}

fn summary(records: &[Record]) -> Table {
    // a case without a diagnosis counts as not found. A case is omitted if its amplitude is too small compared with the
    // minimum detectable amplitude of its own diagnosis
    let part = |name: &'static str| move |r: &&Record| r.part == name;
    let effects: Vec<&Record> = records.iter().filter(part("effects")).collect();
    let visible = |r: &&Record| r.reached >= EXPECTED;
    let clear: Vec<&Record> = effects.iter().copied().filter(visible).collect();
    let nulls: Vec<&Record> = records.iter().filter(part("nulls")).collect();
    let robbed: Vec<&Record> = records.iter().filter(part("without")).filter(visible).collect();
    let pairs: Vec<&Record> = records.iter().filter(part("pairs")).filter(visible).collect();
    let found = clear.iter().flat_map(|r| &r.parameters);
    let wrong_by = found.clone().map(|p| ((p.value - p.truth) / p.truth).abs());
    let covered = found.clone().filter(|p| (p.ci95[0]..=p.ci95[1]).contains(&p.truth)).count();
    let held = |of: fn(&HeldOut) -> f64| {
        clear.iter().filter_map(|r| r.held_out.as_ref()).map(of).collect::<Vec<_>>()
    };
    let ratio = held(|h| h.amended / h.oracle);
    let closed = held(|h| (h.tuned - h.amended) / (h.tuned - h.oracle));
    let special = ["lift_stall", "actuator_lag", "dead_zone"];
    let special = clear.iter().filter(|r| r.truth.iter().any(|t| special.contains(&t.as_str())));
    let special = special.filter_map(|r| r.held_out.as_ref()).map(|h| h.amended / h.oracle);
    let mut table = header(["", "must", "aim", "reached"]);
    let mut row = |name: &str, must: &str, aim: &str, reached: String| {
        table.add_row([name, must, aim, &reached]);
    };
    row(
        "truth ranked first (≥ 3 × minimum detectable)",
        "90 %",
        "95 %",
        share(clear.iter().copied(), first),
    );
    row(
        "truth in the first three or in the tie class",
        "95 %",
        "98 %",
        share(clear.iter().copied(), near),
    );
    row("nulls with any assertion", "≤ 5 %", "≤ 1 %", share(nulls, |r| !r.asserted.is_empty()));
    let installed = || records.iter().filter(part("installed"));
    row(
        "one instrument wrong, nothing of the aircraft: an effect of it asserted",
        "≤ 2 %",
        "≤ 0.5 %",
        share(installed(), |r| !r.asserted.is_empty()),
    );
    row(
        "the same: something said to be missing",
        "≤ 3 %",
        "≤ 1 %",
        share(installed(), |r| ["effect", "unexplained"].contains(&r.verdict.as_str())),
    );
    row(
        "the same: the instrument named",
        "85 %",
        "95 %",
        share(installed(), |r| {
            r.installed.as_ref().is_some_and(|name| r.instruments.contains(name))
        }),
    );
    row(
        "nulls with an error of installation asserted",
        "≤ 3 %",
        "≤ 1 %",
        share(records.iter().filter(part("nulls")), |r| !r.instruments.is_empty()),
    );
    row(
        "wrong assertion, truth in the catalogue",
        "≤ 3 %",
        "1 %",
        share(effects.iter().copied(), wrong),
    );
    row(
        "abstains, truth (≥ 3 × minimum detectable) not in the catalogue",
        "80 %",
        "90 %",
        share(robbed, |r| r.failure.is_none() && r.asserted.is_empty()),
    );
    row(
        "both of a pair found (both ≥ 3 × minimum detectable)",
        "70 %",
        "85 %",
        share(pairs, |r| r.truth.iter().all(|id| r.names(id))),
    );
    row("parameter error, median / p90, %", "5 / 15", "3 / 10", two(wrong_by, 0.9, 100.0, 1));
    row(
        "95 % intervals that cover the truth",
        "88–98 %",
        "92–97 %",
        match found.count() {
            0 => "–".into(),
            n => format!("{:.1} % ({covered} of {n})", 100.0 * covered as f64 / n as f64),
        },
    );
    row(
        "held-out 5 s error ÷ oracle, median / p90",
        "1.5 / 3",
        "1.2 / 2",
        two(ratio.into_iter(), 0.9, 1.0, 2),
    );
    row(
        "gap closed, median / p10, %",
        "90 / 70",
        "95 / 85",
        two(closed.into_iter(), 0.1, 100.0, 0),
    );
    row(
        "stall, lag, dead zone: error ÷ oracle, median / largest",
        "3",
        "1.5",
        two(special, 1.0, 1.0, 2),
    );
    table
}

/// The effects that cannot be flown at an amplitude at which they are expected to be found, as text.
fn never_clear(records: &[Record]) -> String {
    let mut most: BTreeMap<&str, f64> = BTreeMap::new();
    for r in records.iter().filter(|r| r.part == "effects") {
        if let Some(id) = r.truth.first() {
            let best = most.entry(id).or_default();
            *best = best.max(r.reached);
        }
    }
    let few = most.iter().filter(|(_, reached)| **reached < EXPECTED);
    let few: Vec<String> = few.map(|(id, reached)| format!("{id} {reached:.1}")).collect();
    if few.is_empty() {
        return String::new();
    }
    format!(
        "not identifiable at what can be flown, beside sensors, clocks and the prior's widths (largest \
         multiple of the minimum detectable): {}\n",
        few.join(", ")
    )
}

/// Whether the true effect is ranked first.
fn first(r: &Record) -> bool {
    r.truth.first().is_some_and(|truth| r.ranked.first() == Some(truth))
}

/// Whether the true effect is among the first three, or reported as indistinguishable from the first.
fn near(r: &Record) -> bool {
    let Some(truth) = r.truth.first() else { return false };
    r.ranked.iter().take(3).any(|id| id == truth)
        || r.ranked.first().is_some_and(|first| r.is_alike(first, truth))
}

/// Whether an effect is asserted that is neither true nor reported as indistinguishable from a true effect.
fn wrong(r: &Record) -> bool {
    let is =
        |id: &String| r.truth.contains(id) || r.truth.iter().any(|truth| r.is_alike(id, truth));
    r.asserted.iter().any(|id| !is(id))
}

fn by_effect(records: &[Record]) -> Table {
    let effects: Vec<&Record> = records.iter().filter(|r| r.part == "effects").collect();
    let mut ids: Vec<&String> = effects.iter().flat_map(|r| &r.truth).collect();
    ids.sort();
    ids.dedup();
    let mut table = header([
        "effect",
        "amplitude × 1",
        "first × 1",
        "× 2",
        "× 5",
        "asserted × 5",
        "parameter error %",
        "error ÷ oracle",
        "mistaken for",
    ]);
    for id in ids {
        let own = |factor: f64| {
            effects
                .iter()
                .copied()
                .filter(move |r| r.factor == factor && r.truth.first() == Some(id))
        };
        let rate = |factor: f64| {
            let all: Vec<bool> = own(factor).map(first).collect();
            let yes = all.iter().filter(|x| **x).count();
            if all.is_empty() { "–".into() } else { format!("{yes}/{}", all.len()) }
        };
        let all = effects.iter().filter(|r| r.truth.first() == Some(id));
        let clear = all.clone().filter(|r| r.reached >= EXPECTED);
        let errors = clear.clone().flat_map(|r| &r.parameters);
        let errors = errors.map(|p| ((p.value - p.truth) / p.truth).abs());
        let ratio = clear.clone().filter_map(|r| r.held_out.as_ref()).map(|h| h.amended / h.oracle);
        let amplitude =
            own(1.0).chain(own(5.0)).next().and_then(|r| Some((r.reached, *r.amplitudes.first()?)));
        table.add_row([
            id.clone(),
            amplitude.map_or("–".into(), |(reached, a)| match id.as_str() {
                "rate_limit" => format!("{:.3e}", a.abs() * reached),
                _ => format!("{:.3e}", a.abs() / reached),
            }),
            rate(1.0),
            rate(2.0),
            rate(5.0),
            share(own(5.0), |r| r.names(id)),
            two(errors, 0.9, 100.0, 1),
            two(ratio, 0.9, 1.0, 2),
            mistaken(clear.copied(), id),
        ]);
    }
    table
}

/// The effects that are ranked first instead of `id`, with their counts.
fn mistaken<'a>(records: impl Iterator<Item = &'a Record>, id: &str) -> String {
    let mut others: Vec<(String, usize)> = Vec::new();
    for other in records.filter_map(|r| r.ranked.first()).filter(|other| *other != id) {
        match others.iter_mut().find(|(name, _)| name == other) {
            Some((_, count)) => *count += 1,
            None => others.push((other.clone(), 1)),
        }
    }
    others.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    others.iter().map(|(name, count)| format!("{name} {count}")).collect::<Vec<_>>().join(", ")
}
