//! Flights of programs that share no code with Greylag: nothing is named that the aircraft does not have.
//!
//! `tests/truth` flies them: a continuous-time 6-DoF in Python, and official JSBSim at 400 Hz.
//! Skipped unless `GREYLAG_JSBSIM_PYTHON` names a Python with jsbsim and numpy.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

/// Length of the flights, s: the shortest in which every manoeuvre of a flight's first half is flown.
const FLIGHT_S: &str = "25";
/// Effects of a force and of an input: each shows in the first half of the flights.
const EFFECTS: &str = "thrust_line_offset,dead_zone";

fn python() -> Option<String> {
    let named = std::env::var("GREYLAG_JSBSIM_PYTHON").ok();
    if named.is_none() {
        println!("skipped: name a Python with jsbsim 1.3.3 and numpy in GREYLAG_JSBSIM_PYTHON");
    }
    named
}

fn script(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/truth").join(name)
}

/// Runs a script of `tests/truth`, which must succeed.
fn run(python: &str, name: &str, arguments: &[&str]) {
    let output = Command::new(python).arg(script(name)).args(arguments).output().unwrap();
    let said = [&output.stdout[..], &output.stderr[..]].map(String::from_utf8_lossy).concat();
    assert!(output.status.success(), "{name} {arguments:?}: {said}");
}

/// What `diagnose` says of two nulls and two effects of `truth`, a record a case.
fn answers(python: &str, truth: &str) -> Vec<Value> {
    let folder = tempfile::tempdir().unwrap();
    let [cases, results] = ["cases", "results.jsonl"].map(|name| folder.path().join(name));
    let (cases, results) = (cases.to_str().unwrap(), results.to_str().unwrap());
    let what = ["--seed", "5", "--nulls", "2", "--effects", EFFECTS, "--duration", FLIGHT_S];
    run(python, "make_cases.py", &[&["--truth", truth, "--out", cases][..], &what].concat());
    let greylag = env!("CARGO_BIN_EXE_greylag");
    run(python, "score.py", &["--greylag", greylag, "--cases", cases, "--jsonl", results]);
    let text = std::fs::read_to_string(results).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// Checks that nothing is asserted but what is hidden, and that every diagnosis came off.
fn nothing_wrong_is_asserted(truth: &str) {
    let Some(python) = python() else { return };
    let records = answers(&python, truth);
    assert_eq!(records.len(), 4);
    for record in &records {
        println!("{record}");
        assert_ne!(record["verdict"], "failed", "{record}");
    }
    let wrong = |r: &Value| {
        let asserted = r["asserted"].as_array().unwrap().iter().filter_map(Value::as_str);
        asserted.filter(|id| r["hidden"] != *id).map(str::to_owned).collect::<BTreeSet<_>>()
    };
    let wrong: Vec<_> = records.iter().map(wrong).collect();
    assert!(wrong.iter().all(BTreeSet::is_empty), "asserted, but not hidden: {wrong:?}");
}

#[test]
fn validate_nothing_wrong_is_asserted_of_a_continuous_time_aircraft() {
    nothing_wrong_is_asserted("continuous");
}

#[test]
fn validate_nothing_wrong_is_asserted_of_official_jsbsim() {
    nothing_wrong_is_asserted("official-adams");
}

#[test]
fn validate_the_continuous_truth_has_the_forces_of_official_jsbsim() {
    let Some(python) = python() else { return };
    run(&python, "check_truth.py", &[]);
}
