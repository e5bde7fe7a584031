//! `greylag compare` as a user runs it: sentences first, JSON, and bad logs named.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use crate::compare_support::{REALISTIC, fly};
use greylag::logs::csv;

fn greylag(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_greylag")).arg("compare").args(arguments).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// A log of `seconds` in `folder`.
fn log(folder: &Path, name: &str, seed: u64, seconds: f64) -> String {
    let path = folder.join(name);
    csv::save(&fly(seed, seconds, REALISTIC), &path).unwrap();
    path.to_str().unwrap().into()
}

#[test]
fn two_models_on_two_logs() {
    let folder = tempfile::tempdir().unwrap();
    let (a, b) = (log(folder.path(), "a.csv", 1, 40.0), log(folder.path(), "b.csv", 2, 40.0));
    let json = folder.path().join("found.json");
    let out = json.to_str().unwrap();
    let arguments = [
        "--model",
        "params/x8/prior-as-printed.toml",
        "--model",
        "params/x8/jsbsim.toml",
        "--log",
        &a,
        "--log",
        &b,
        "--horizon",
        "1,3",
        "--json",
        out,
    ];
    let output = greylag(&arguments);
    let said = text(&output.stdout);
    assert!(output.status.success(), "{said}{}", text(&output.stderr));
    println!("{said}");
    // the difference comes first, then where each model fails
    assert!(said.starts_with("On 2 flights the error at 3 s falls from "), "{said}");
    let of_first = said.lines().skip_while(|l| *l != "A  prior-as-printed");
    let first: Vec<&str> = of_first.take_while(|l| !l.is_empty()).collect();
    assert!(first.iter().any(|s| s.contains("throttle") && s.contains("airspeed")), "{said}");
    assert!(first.iter().any(|s| s.contains("aileron")), "{said}");
    assert!(said.trim_end().lines().last().unwrap().starts_with("next: greylag "), "{said}");
    let wide = said.lines().filter(|l| l.contains('─') && l.chars().count() > 100);
    assert_eq!(wide.count(), 0, "{said}");
    assert!(text(&output.stderr).contains("log 2 of 2"));
    let found: serde_json::Value = serde_json::from_slice(&fs::read(&json).unwrap()).unwrap();
    assert_eq!(found["schema"], "greylag.comparison/1");
    assert_eq!(found["free_run"][1]["horizon_s"], 3.0);
    assert_eq!(found["models"].as_array().unwrap().len(), 2);
    assert_eq!(found["flights"][1]["name"], "b.csv");
    // a program that reads it gets the JSON and nothing else; the model may stand in the environment
    let piped = Command::new(env!("CARGO_BIN_EXE_greylag"))
        .args(["compare", "--log", &a, "--horizon", "1", "--json", "-"])
        .env("GREYLAG_MODEL", "params/x8/jsbsim.toml")
        .output()
        .unwrap();
    let found: serde_json::Value = serde_json::from_slice(&piped.stdout).unwrap();
    assert_eq!(found["models"][0]["name"], "jsbsim");
    // nothing is written over without being told to
    let again = greylag(&arguments);
    assert!(!again.status.success() && text(&again.stderr).contains("--force"));
    assert!(greylag(&[&arguments[..], &["--force"]].concat()).status.success());
}

#[test]
fn a_bad_log_is_named_and_the_rest_is_compared() {
    let folder = tempfile::tempdir().unwrap();
    let good = log(folder.path(), "good.csv", 3, 15.0);
    let bad = folder.path().join("bad.csv");
    fs::write(&bad, "time_s,roll_rad\n0,0\n").unwrap();
    let bad = bad.to_str().unwrap();
    let model = ["--model", "params/x8/prior.toml"];
    let output = greylag(&[&model[..], &["--log", bad, &good]].concat());
    assert_eq!(output.status.code(), Some(3), "{}", text(&output.stderr));
    assert!(text(&output.stdout).contains("left out") && text(&output.stdout).contains("bad.csv"));
    // the first missing columns and how many there are, and where to see and to mend them, once
    let said = text(&output.stderr);
    for words in ["`pitch_rad`", "it also lacks `", " more. --mapping FILE", "greylag logs info "] {
        assert_eq!(said.matches(words).count(), 1, "{words}: {said}");
    }
    let output = greylag(&[&model[..], &["--log", bad]].concat());
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("no log can be compared"));
}

#[test]
fn a_figure_that_cannot_be_is_said_first_and_is_in_the_status() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("pitot.csv");
    let mut flight = fly(3, 40.0, REALISTIC);
    // no unit has this factor, so that the log itself is not refused
    flight.samples.iter_mut().for_each(|s| s.airspeed_mps *= 0.65);
    csv::save(&flight, &path).unwrap();
    let pitot = path.to_str().unwrap();
    let of = |log: &str| greylag(&["--model", "params/x8/jsbsim.toml", "--log", log]);
    let output = of(pitot);
    let said = text(&output.stdout);
    assert_eq!(output.status.code(), Some(3), "{said}{}", text(&output.stderr));
    assert!(said.starts_with("pitot.csv: airspeed_scale is found at 0.6"), "{said}");
    assert!(said.contains("nothing is said about forces and moments"), "{said}");
    assert!(!said.contains("rolling moment"), "{said}");
    assert!(said.contains("next: greylag logs info "), "{said}");
    let sound = of(&log(folder.path(), "sound.csv", 3, 40.0));
    assert_eq!(sound.status.code(), Some(0), "{}", text(&sound.stdout));
}

#[test]
fn what_is_missing_is_asked_for() {
    let none = greylag(&["--model", "params/x8/prior.toml"]);
    assert!(!none.status.success() && text(&none.stderr).contains("--log"));
    let none = greylag(&["--log", "flight.csv"]);
    assert!(!none.status.success() && text(&none.stderr).contains("--model"));
    let gone = greylag(&["--model", "params/x8/prior.toml", "--log", "gone.csv"]);
    assert!(!gone.status.success() && text(&gone.stderr).contains("gone.csv"));
    let parked = tempfile::tempdir().unwrap();
    let mut flight = fly(5, 10.0, REALISTIC);
    flight.samples.iter_mut().for_each(|s| s.airspeed_mps *= 0.02);
    let path = parked.path().join("parked.csv");
    csv::save(&flight, &path).unwrap();
    let output = greylag(&["--model", "params/x8/prior.toml", "--log", path.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("no flight"), "{}", text(&output.stderr));
}

/// Without `--force` a file of an earlier run is in the way; with it too, no input is replaced and no output lost.
#[test]
fn no_output_replaces_an_input_or_another_output() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (a, model) = (log(folder.path(), "a.csv", 1, 15.0), at("model.toml"));
    fs::copy("params/x8/prior.toml", &model).unwrap();
    fs::copy("params/x8/airframe.toml", at("airframe.toml")).unwrap();
    let before = [&a, &model, &at("airframe.toml")].map(|path| fs::read(path).unwrap());
    let (both, page) = (at("both"), at("page.html"));
    for (more, said) in [
        (["--report", &a, "--json", &page], "is an input"),
        (["--report", &page, "--json", &model], "is an input"),
        (["--report", &at("./a.csv"), "--json", &page], "is an input"),
        (["--report", &page, "--predictions", &at("airframe.toml")], "is an input"),
        (["--report", &both, "--json", &both], "two outputs"),
    ] {
        let output = greylag(&[&["--model", &model, "--log", &a, "--force"][..], &more].concat());
        let error = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{more:?}: {error}");
        // nothing was computed before
        assert!(error.lines().count() == 1 && error.contains(said), "{more:?}: {error}");
    }
    let after = [&a, &model, &at("airframe.toml")].map(|path| fs::read(path).unwrap());
    assert!(before == after && fs::read_dir(folder.path()).unwrap().count() == 3);
}

#[test]
fn the_next_command_names_the_logs_that_were_compared() {
    let folder = tempfile::tempdir().unwrap();
    let good = log(folder.path(), "good.csv", 3, 15.0);
    let bad = folder.path().join("bad.csv");
    fs::write(&bad, "time_s,roll_rad\n0,0\n").unwrap();
    let line = ["--model", "params/x8/prior.toml", "--log", &good, bad.to_str().unwrap()];
    let said = text(&greylag(&line).stdout);
    let next = said.lines().next_back().unwrap();
    assert!(next.starts_with("next: ") && next.contains(&good), "{said}");
    assert!(!next.contains("bad.csv"), "{said}");
}

#[test]
fn quiet_leaves_results_alone() {
    let folder = tempfile::tempdir().unwrap();
    let a = log(folder.path(), "a.csv", 1, 25.0);
    let output = greylag(&["--quiet", "--model", "params/x8/prior.toml", "--log", &a]);
    assert!(output.status.success() && !output.stdout.is_empty());
    assert_eq!(text(&output.stderr), "");
}

#[test]
fn a_reconstruction_says_what_was_found_in_its_log() {
    let folder = tempfile::tempdir().unwrap();
    let [path, out] = ["a.csv", "path.csv"].map(|name| folder.path().join(name));
    let mut flight = fly(3, 25.0, REALISTIC);
    flight.samples[100].time_s = flight.samples[99].time_s;
    csv::save(&flight, &path).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_greylag"))
        .args(["logs", "reconstruct"])
        .args([path, out])
        .output()
        .unwrap();
    let said = text(&output.stderr);
    assert!(output.status.success() && said.contains("1 rows dropped"), "{said}");
}
