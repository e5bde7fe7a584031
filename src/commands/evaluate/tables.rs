//! Tables of an evaluation on the terminal. An evaluation scores a controller on flights to target attitudes. Each group
//! of targets has a table, with a column for each controller.

use comfy_table::{ContentArrangement, Table};

use crate::commands::terminal::broken;
use crate::control::quality::{Measure, measure};
use crate::report::{evaluation_answer, evaluation_model};
use crate::sim::evaluation::{Evaluation, Score};
use crate::sim::published::published;

/// Largest width of a table, characters.
const WIDTH: u16 = 100;
/// Largest number of controllers in a table.
const BESIDE: usize = 4;

/// Identifiers of the measures that the terminal shows. JSON file and HTML page have all measures.
const SHOWN: [&str; 13] = [
    "error_integral_deg_s",
    "to_one_deg_s",
    "to_five_percent_s",
    "overshoot_roll_deg",
    "overshoot_pitch_deg",
    "load_factor_max",
    "load_factor_min",
    "alpha_max_deg",
    "sideslip_max_deg",
    "airspeed_min_mps",
    "surface_travel",
    "surface_saturated",
    "outside_s",
];

/// Prints the tables, the definitions of their terms, and the conclusion. `limited` states that the envelope limiter was used.
pub(super) fn print(evaluations: &[Evaluation], limited: bool) {
    tables(evaluations).iter().for_each(|table| println!("{table}"));
    if let Some(model) = evaluation_model(evaluations) {
        println!("{}", broken(&format!("model of all controllers that need one: {model}")));
    }
    println!(
        "medians with 95 % intervals (bootstrap over the targets), then the worst; definitions: --report"
    );
    println!(
        "all: easy with hard_corners, the targets of the paper's Table II; its means: Table XI"
    );
    println!("load factor and α kept: at most 5 % beyond the limits of the airframe file");
    // printed last, because a user sees the end of the output first
    println!();
    let said = evaluation_answer(evaluations, limited);
    said.iter().for_each(|sentence| println!("{}", broken(sentence)));
}

pub(super) fn tables(evaluations: &[Evaluation]) -> Vec<Table> {
    let Some(first) = evaluations.first() else { return Vec::new() };
    let groups = first.groups.iter().map(|score| score.targets.as_str());
    let name = &|e: &Evaluation| match evaluation_model(evaluations) {
        Some(_) => e.controller.clone(),
        None => format!("{}\n{}", e.controller, e.model),
    };
    groups
        .flat_map(|group| evaluations.chunks(BESIDE).map(move |some| table(group, some, name)))
        .collect()
}

/// The table of one group of targets. `name` gives the heading of a controller's column.
fn table(group: &str, evaluations: &[Evaluation], name: &dyn Fn(&Evaluation) -> String) -> Table {
    let scored: Vec<(&Evaluation, &Score)> =
        evaluations.iter().filter_map(|e| Some((e, e.score(group)?))).collect();
    let mut table = Table::new();
    table.load_style(comfy_table::presets::UTF8_FULL_CONDENSED);
    table.set_content_arrangement(ContentArrangement::Dynamic).set_width(WIDTH);
    let count = scored.first().map_or(0, |(_, score)| score.count);
    let mut header = vec![format!("{group}, n = {count}")];
    header.extend(scored.iter().map(|(e, _)| name(e)));
    table.set_header(header);
    let mut push = |title: &str, cell: &dyn Fn(&Evaluation, &Score) -> String| {
        let cells = scored.iter().map(|(e, score)| cell(e, score));
        table.add_row(std::iter::once(title.to_owned()).chain(cells));
    };
    for shown in SHOWN.iter().filter_map(|id| measure(id)) {
        push(&titled(shown), &|_, score| spread(shown, score));
    }
    let percent = |share: f64| {
        if share.is_finite() { format!("{:.1}", 100.0 * share) } else { "–".into() }
    };
    push("overshoot ≤ 1° or 3 %, %", &|_, s| percent(s.little_overshoot_rate));
    push("load factor and α kept, %", &|_, s| percent(s.kept_rate));
    push("settled error, °, mean", &|_, s| {
        format!("{} {}", number(s.mean_deg), interval(s.mean_ci95_deg))
    });
    push("the same, IQM; median; worst", &|_, s| {
        [s.iqm_deg, s.median_deg, s.max_deg].map(number).join("; ")
    });
    push("the paper's mean, °", &|e, s| {
        published(&e.controller, &s.targets).map_or("–".into(), |p| number(p.mean_deg.value))
    });
    push("diverged, %", &|_, s| percent(s.divergence_rate));
    push("ms a step: p50; p99; p99.9", &|e, _| {
        let cost = e.ms_per_step;
        [cost.p50, cost.p99, cost.p999].map(number).join("; ")
    });
    table
}

fn titled(measure: &Measure) -> String {
    let unit = if measure.unit.is_empty() { "" } else { ", " };
    format!("{}{unit}{}", measure.title, measure.unit)
}

fn spread(measure: &Measure, score: &Score) -> String {
    score.measures.get(measure.id).map_or("–".into(), |s| {
        format!("{} {}\nworst {}", number(s.median), interval(s.median_ci95), number(s.worst))
    })
}

fn interval([low, high]: [f64; 2]) -> String {
    format!("[{}, {}]", number(low), number(high))
}

/// Formats a number with about three significant digits, without an exponent.
fn number(x: f64) -> String {
    match x.abs() {
        _ if !x.is_finite() => "–".into(),
        size if size >= 99.95 => format!("{x:.0}"),
        size if size >= 9.995 => format!("{x:.1}"),
        size if size >= 0.0995 || size == 0.0 => format!("{x:.2}"),
        size if size >= 0.000_95 => format!("{x:.3}"),
        _ => format!("{x:.5}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::Target;
    use crate::control::quality::{Limits, Track};
    use crate::sim::Outcome;
    use crate::sim::evaluation::courses;
    use crate::sim::targets::TargetFile;
    use std::time::Duration;

    /// The tables of five controllers are at most 100 characters wide, and hold all controllers and groups.
    #[test]
    fn the_tables_fit_a_hundred_columns_and_hold_every_controller() {
        let rows = TargetFile::generate(1).rows;
        let target = Target { roll: 0.0, pitch: 0.0, airspeed: 20.0 };
        let track = Track { moments: Vec::new(), target, before: None, lost_s: 10.0 };
        let outcome = Outcome {
            settled_deg: 180.0,
            settling_s: 10.0,
            cost: vec![Duration::from_millis(368)],
            track,
        };
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8/airframe.toml");
        let limits = Limits::of(&crate::physics::Airframe::load(&path).unwrap());
        let names = ["pid", "hybrid-policy", "hybrid-lqi", "ilqr", "lqi"];
        let model = "prior-severe-learned, params/x8/learned/policy";
        let of = |name| {
            let outcomes = vec![outcome.clone(); rows.len()];
            Evaluation::measured([name, model], &courses(&rows, 20.0), &outcomes, &limits)
        };
        let tables = tables(&names.map(of));
        // easy, corners, outside, all: each with four controllers, then with one
        assert_eq!(tables.len(), 8);
        let text = tables.iter().map(Table::to_string).collect::<Vec<_>>().join("\n");
        assert!(text.lines().all(|line| line.chars().count() <= 100), "{text}");
        for part in
            ["hybrid-lqi", "integral of error", "load factor and α kept", "3600", "hard_outside"]
        {
            assert!(text.contains(part), "{part}: {text}");
        }
    }
}
