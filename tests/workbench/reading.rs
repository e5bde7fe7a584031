//! The model and the options for reading logs on the command line of `greylag workbench`.

use crate::amend_support::{Manoeuvres, errors, fly, sensors};
use crate::workbench_support::{Bench, MODEL, word};
use greylag::logs::csv;
use serde_json::json;

#[test]
fn a_learned_model_accepts_no_effect() {
    let folder = tempfile::tempdir().unwrap();
    let bench = Bench::open(folder.path(), &["--model", "params/x8/learned/model.toml"]);
    let (status, said) = bench.act(json!({ "do": "tick", "effect": "drag_beta2" }));
    assert_eq!((status, word(&said).contains("residual")), (422, true), "{said}");
}

#[test]
fn a_session_reads_its_logs_as_the_command_line_says() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("turned.csv");
    let flown = fly("actuator_lag=0.05", 25.0, Manoeuvres::Usual, 20);
    let mut flight = sensors::spoil(&flown, &errors(20), 0);
    // a wrong sign makes the log doubtful
    flight.samples.iter_mut().for_each(|s| s.specific_force_mps2[2] *= -1.0);
    csv::save(&flight, &log).unwrap();
    let new = ["--model", MODEL, log.to_str().unwrap()];
    let state = Bench::open(&folder.path().join("doubtful"), &new).state();
    assert_eq!(state["flights"][0]["role"], "unused");
    let session = folder.path().join("session");
    let wanted = ["--despite-problems", "--source", "airspeed=1"];
    let state = Bench::open(&session, &[&wanted[..], &new].concat()).state();
    assert_eq!(state["flights"][0]["role"], "fit");
    let line = state["commands"]["diagnose"].as_str().unwrap();
    assert!(line.contains("--source airspeed=1") && line.contains("--despite-problems"), "{line}");
    // results of another instance are not those of the logs as they are read now
    let again = Bench::open(&session, &["--despite-problems"]).state();
    assert_ne!(again["diagnosis"]["key"], state["diagnosis"]["key"]);
}

#[test]
fn a_log_of_the_command_line_that_cannot_be_used_is_shown_with_its_error() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("photo.csv");
    std::fs::write(&log, b"\x89PNG\r\n\x1a\n0000").unwrap();
    let session = folder.path().join("session");
    // at the first start, and at the next one with the same command
    for _ in 0..2 {
        let state = Bench::open(&session, &["--model", MODEL, log.to_str().unwrap()]).state();
        let flights = state["flights"].as_array().unwrap();
        assert_eq!((flights.len(), &flights[0]["role"]), (1, &json!("unused")), "{state}");
        let error = flights[0]["error"].as_str().unwrap_or_default();
        assert!(error.contains("photo.csv") && error.contains("no flight log"), "{state}");
    }
}

#[test]
fn forces_and_moments_are_withheld_beside_a_figure_that_cannot_be() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("pitot.csv");
    let flown = fly("", 40.0, Manoeuvres::Usual, 20);
    let mut flight = sensors::spoil(&flown, &errors(20), 0);
    // no unit has this factor
    flight.samples.iter_mut().for_each(|s| s.airspeed_mps *= 0.65);
    csv::save(&flight, &log).unwrap();
    let line = ["--despite-problems", "--model", MODEL, log.to_str().unwrap()];
    let bench = Bench::open(&folder.path().join("session"), &line);
    let (status, failing) = bench.get("/api/failing");
    assert_eq!(status, 200, "{}", word(&failing));
    let said = &failing["doubtful"];
    let first = said[0].as_str().unwrap_or_default();
    assert!(first.starts_with("pitot.csv: airspeed_scale is found at 0.6"), "{said}");
    assert!(said[1].as_str().is_some_and(|s| s.contains("nothing is said about forces")), "{said}");
}
