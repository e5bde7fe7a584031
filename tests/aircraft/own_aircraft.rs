//! The first minutes with an aircraft of one's own: from mass, span and area to a checked model, from a log to a fitted one.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use crate::compare_support::{REALISTIC, fly};
use greylag::logs::csv;
use serde_json::Value;

fn greylag(words: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_greylag")).args(words).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

#[test]
fn what_new_makes_needs_no_mending_and_check_says_the_same() {
    let scratch = tempfile::tempdir().unwrap();
    for (name, more) in [
        ("glider", &["--mass-kg", "2.1", "--span-m", "1.6", "--area-m2", "0.3"][..]),
        (
            "wing",
            &["--mass-kg", "3.4", "--span-m", "2.1", "--area-m2", "0.75", "--tail", "flying-wing"],
        ),
        ("trainer", &["--mass-kg", "11", "--span-m", "2.9", "--area-m2", "0.55"]),
    ] {
        let folder = scratch.path().join(name);
        let made = greylag(&[&["aircraft", "new", folder.to_str().unwrap()], more].concat());
        let said = text(&made.stdout);
        let model = folder.join("model.toml");
        let [found, page] = ["check.json", "page.html"].map(|f| folder.join(f));
        let checked = greylag(&[
            "aircraft",
            "check",
            "--model",
            model.to_str().unwrap(),
            "--json",
            found.to_str().unwrap(),
            "--report",
            page.to_str().unwrap(),
        ]);
        assert_eq!(made.status.code(), checked.status.code(), "{name}: {said}");
        // its own defaults are no fault
        assert_eq!(made.status.code(), Some(0), "{name}: {said}{}", text(&made.stderr));
        assert!(!said.contains("correct:"), "{name}: {said}");
        // no flight exists yet, so what comes next is said in words, without placeholders
        assert!(said.contains("next: fly it") && !said.contains("FLIGHTS"), "{name}: {said}");
        let found = json(&found);
        let levels = found["levels"].as_array().unwrap();
        assert!(levels.len() > 3);
        for level in levels {
            let throttle = level["throttle"].as_f64().unwrap();
            assert!((0.0..=1.0).contains(&throttle), "{name}: {level}");
            // the envelope ends where level flight does: nothing in it is a descent
            assert!(level["path"].as_f64().unwrap().abs() < 0.01, "{name}: {level}");
        }
        let html = fs::read_to_string(&page).unwrap();
        for part in ["<svg role=\"img\"", "Straight flight", "Modes", "Control response"] {
            assert!(html.contains(part), "{name}: the page lacks {part}");
        }
    }
}

#[test]
fn the_airspeed_beyond_which_level_flight_ends_is_said() {
    let scratch = tempfile::tempdir().unwrap();
    let folder = scratch.path().join("glider");
    let new = [
        "aircraft",
        "new",
        folder.to_str().unwrap(),
        "--mass-kg",
        "2.1",
        "--span-m",
        "1.6",
        "--area-m2",
        "0.3",
    ];
    assert!(greylag(&new).status.success());
    let airframe = fs::read_to_string(folder.join("airframe.toml")).unwrap();
    let end = airframe.lines().find_map(|l| l.strip_prefix("airspeed_max_mps = ")).unwrap();
    let faster = airframe.replace(&format!("airspeed_max_mps = {end}"), "airspeed_max_mps = 40.0");
    fs::write(folder.join("airframe.toml"), faster).unwrap();
    let model = folder.join("model.toml");
    let page = folder.join("aircraft.html");
    let [file, out] = [&model, &page].map(|path| path.to_str().unwrap());
    let said = text(&greylag(&["aircraft", "check", "--model", file, "--report", out]).stdout);
    let (_, rest) = said.split_once("cannot fly level above ").unwrap_or_else(|| panic!("{said}"));
    let fastest: f64 = rest.split(' ').next().unwrap().parse().unwrap();
    // `new` ended the envelope there, to a tenth
    assert!((fastest - end.parse::<f64>().unwrap()).abs() < 0.11, "{fastest} {end}");
    // the page promises no level flight beyond it, and the command that comes next runs as printed
    let html = fs::read_to_string(&page).unwrap();
    let (_, level) = html.split_once("It flies level from ").unwrap_or_else(|| panic!("{html}"));
    assert!(!level.split_once(" m/s").unwrap().0.contains("40"), "{level}");
    for part in ["Sound by its own numbers; no flight was compared", "No flight has been fitted"] {
        assert!(html.contains(part), "the page lacks {part}");
    }
    let (_, next) = said.split_once("next: greylag ").unwrap_or_else(|| panic!("{said}"));
    let next: Vec<&str> = next.trim().split(' ').collect();
    assert_eq!(next[0], "evaluate", "{next:?}");
    let flown = greylag(&[&next[..], &["--every", "60"]].concat());
    assert!(flown.status.success(), "{}", text(&flown.stderr));
}

#[test]
fn mass_span_area_and_logs_make_a_model_that_predicts_another_flight() {
    let scratch = tempfile::tempdir().unwrap();
    let log = |k: u64| {
        let path = scratch.path().join(format!("flight-{k}.csv"));
        csv::save(&fly(k, 60.0, REALISTIC), &path).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let (a, b, other) = (log(1), log(2), log(3));
    let folder = scratch.path().join("own");
    let begun = std::time::Instant::now();
    let made = greylag(&[
        "aircraft",
        "from-log",
        folder.to_str().unwrap(),
        "--mass-kg",
        "3.364",
        "--span-m",
        "2.1",
        "--area-m2",
        "0.75",
        "--tail",
        "flying-wing",
        "--log",
        &a,
        &b,
    ]);
    let said = text(&made.stdout);
    assert!(matches!(made.status.code(), Some(0 | 3)), "{said}{}", text(&made.stderr));
    // the flight that was held out stays unseen: it is in no fit and in no diagnosis
    let next: Vec<&str> = said.lines().filter(|line| line.starts_with("next: ")).collect();
    let own = folder.display();
    let diagnosed = format!("next: greylag diagnose --model {own}/model.toml --log {a}");
    let checked = format!("next: greylag aircraft check --model {own}/model.toml");
    // what the check finds comes first
    assert_eq!(next, [if said.contains("correct: ") { checked } else { diagnosed }]);
    let judges = format!(
        "{b} was held out, so it judges the model: greylag compare --model {own}/prior/model.toml {own}/model.toml --log {b}"
    );
    assert!(said.contains(&judges), "{said}");
    assert!(fs::read_to_string(folder.join("aircraft.html")).unwrap().contains("<svg"));
    assert!(folder.join("fit.html").exists());
    let found = scratch.path().join("found.json");
    let [prior, fitted] =
        ["prior/model.toml", "model.toml"].map(|m| folder.join(m).display().to_string());
    let compared = greylag(&[
        "compare",
        "--model",
        &prior,
        &fitted,
        "--log",
        &other,
        "--json",
        found.to_str().unwrap(),
    ]);
    assert!(compared.status.success(), "{}", text(&compared.stderr));
    // two commands: fit with pages, and compare. Five minutes are what a newcomer was promised
    let minutes = begun.elapsed().as_secs_f64() / 60.0;
    println!(
        "mass, span, area and two logs of 60 s to a model judged by another flight: {minutes:.2} min"
    );
    assert!(minutes < 5.0, "{minutes} min");
    let numbers = json(&found)["answer"]["numbers"].clone();
    assert_eq!(numbers["fitted_flights"], 0, "{numbers}");
    // textbook estimates are off by tens of percent; a fit that halves their error has learned from the flights
    assert!(numbers["change_percent"].as_f64().unwrap() < -50.0, "{numbers}");
}
