//! The page of the catalogue of effects.

use std::fmt::Write;

use greylag::physics::catalogue::on_air;
use greylag::physics::effects::Description;
use greylag::physics::{Channel, inputs};
use greylag::sysid::flight_path::measurement_effects::MEASUREMENT_EFFECTS;

/// Where the page stands.
pub const PAGE: &str = "docs/reference/effects.md";

const HEAD: &str = "# Effects

This page is generated from the catalogue that `greylag effects list` and `greylag effects show ID` print.
`tests/house/docs.rs` keeps it current.

Channels: D drag, L lift, Y side force, T force along body x, l m n rolling, pitching and yawing moment.
Q is dynamic pressure times wing area. Angles are in radians.
";

/// The page.
pub fn page() -> String {
    let (missing, prior): (Vec<_>, Vec<_>) = on_air().partition(|about| about.entry.is_some());
    let groups = [
        ("Effects that a model may lack: forces, moments, body", missing),
        (
            "Effects between actuators and surfaces",
            inputs::Kind::ALL.iter().map(|kind| kind.describe()).collect(),
        ),
        ("Errors of the measurement", MEASUREMENT_EFFECTS.into_iter().collect()),
        ("Parts of a prior model", prior),
    ];
    let mut out = HEAD.to_owned();
    for (title, group) in &groups {
        let _ = write!(out, "\n## {title}\n\n| effect | what it is |\n|---|---|\n");
        for about in group {
            let _ = writeln!(out, "| [`{0}`](#{0}) | {1} |", about.id, about.description);
        }
    }
    for about in groups.iter().flat_map(|(_, group)| group) {
        out += &section(about);
    }
    out
}

fn section(about: &Description) -> String {
    let mut out = format!("\n### {}\n\n{}\n\n", about.id, about.description);
    let mut item = |name: &str, text: String| {
        if !text.is_empty() {
            let _ = writeln!(out, "- {name}: {text}");
        }
    };
    item("formula", format!("`{}`", about.formula));
    if let Some(entry) = about.entry {
        let letters: Vec<_> = entry.channels.iter().map(letter).collect();
        item("channels", letters.join(" "));
        item("look-alikes", code(entry.look_alikes));
        item("separated by", entry.separated_by.to_owned());
    }
    item("replaces", code(about.replaces));
    item("source", about.source.to_owned());
    if let Some(table) = about.table {
        item("table", format!("`{table}` over `alpha_rad`, which only a model file can give"));
    }
    if let Some(grid) = about.grid {
        let over = "over `throttle` and `airspeed_mps`, which only a model file can give";
        item("table", format!("`{grid}` {over}"));
    }
    if !about.coefficients.is_empty() {
        out += "\n| parameter | meaning | range | unit |\n|---|---|---|---|\n";
    }
    for c in about.coefficients {
        let meaning = c.meaning.replace('|', "\\|");
        let _ = writeln!(
            out,
            "| `{}` | {meaning} | {} to {} | {} |",
            c.name, c.bounds.0, c.bounds.1, c.unit
        );
    }
    out
}

fn code(names: &[&str]) -> String {
    names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
}

fn letter(channel: &Channel) -> &'static str {
    match channel {
        Channel::Drag => "D",
        Channel::Lift => "L",
        Channel::Side => "Y",
        Channel::BodyX => "T",
        Channel::Roll => "l",
        Channel::Pitch => "m",
        Channel::Yaw => "n",
    }
}
