//! No number of the X8 stands in `src`, but for those that are units of constants or of files, each with its reason.

use std::path::{Path, PathBuf};

/// Numbers of the X8: reference and stall airspeed, travel, trim throttle, mass.
const NUMBERS: [&str; 6] = ["16.67", "0.5235", "0.118", "9.2", "3.364", "0.1295"];

/// Files that may hold one, and why.
const ALLOWED: [(&str, &str); 9] = [
    (
        "physics/state.rs",
        "the neutral state, from which airspeeds count in effects and observations",
    ),
    ("physics/airframe.rs", "the reference of airframe files of schema 1"),
    ("physics/effects/thrust_decay.rs", "V0 of the formula: a unit of its constant"),
    ("physics/effects/propwash.rs", "throttle and airspeed of the formula: a unit of its constant"),
    ("physics/effects/aeroelastic_loss.rs", "V0 of the formula: a unit of its constant"),
    ("control/pid.rs", "the paper's gains, which `pid` is for"),
    ("logs/mapping/telemetry.rs", "the travel of logs that do not send one"),
    ("sim/missing.rs", "sizes by which amplitudes of hidden effects are written"),
    ("link/wire/sitl.rs", "the travel of the protocol where none is sent"),
];

fn sources(folder: &Path, all: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        match path.is_dir() {
            true => sources(&path, all),
            // a file of its own is what else stands behind #[cfg(test)]
            false if path.ends_with("tests.rs") => {}
            false if path.extension().is_some_and(|e| e == "rs") => all.push(path),
            false => {}
        }
    }
}

/// Whether `line` has `number` as a number of its own, not as a part of another.
fn has(line: &str, number: &str) -> bool {
    line.match_indices(number).any(|(at, _)| {
        let before = line[..at].chars().next_back();
        let after = line[at + number.len()..].chars().next();
        let part = |c: Option<char>| c.is_some_and(|c| c.is_ascii_digit() || c == '.' || c == '_');
        !part(before) && !after.is_some_and(|c| c.is_ascii_digit() || c == '_')
    })
}

/// Lines with a number of the X8, without tests and comments.
fn found(text: &str) -> Vec<String> {
    let code = text.split("#[cfg(test)]").next().unwrap_or_default();
    let lines = code.lines().filter(|line| !line.trim_start().starts_with("//"));
    lines.filter(|l| NUMBERS.iter().any(|n| has(l, n))).map(str::to_owned).collect()
}

#[test]
fn no_number_of_the_x8_stands_in_the_sources() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut all = Vec::new();
    sources(&root, &mut all);
    assert!(all.len() > 300, "{} files", all.len());
    let mut wrong = Vec::new();
    for path in &all {
        let name = path.strip_prefix(&root).unwrap().to_str().unwrap().to_owned();
        let lines = found(&std::fs::read_to_string(path).unwrap());
        if !lines.is_empty() && ALLOWED.iter().all(|(allowed, _)| *allowed != name) {
            wrong.extend(lines.iter().map(|line| format!("{name}: {}", line.trim())));
        }
    }
    for (allowed, _) in ALLOWED {
        let text = std::fs::read_to_string(root.join(allowed)).unwrap();
        let used = !found(&text).is_empty();
        assert!(used, "{allowed} has none any more: take it off the list");
    }
    assert!(wrong.is_empty(), "take it from the airframe or the model:\n{}", wrong.join("\n"));
}

#[test]
fn the_search_finds_numbers_and_no_parts_of_them() {
    assert_eq!(found("const A: f64 = 16.67;\nlet b = 116.67; // 9.2\n// 0.5235\n").len(), 2);
    assert!(found("let a = 9.21; let b = 19.2; let c = 0.1181;").is_empty());
}
