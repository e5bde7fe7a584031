//! The answer box: the same numbers on screen, page and in JSON, and each of them recomputed from the flights.

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::lagging_support::{LAGGING, MODEL};
use greylag::logs;
use greylag::model::GreyBox;
use greylag::sysid::compare::free_run::{START_EVERY_S, from_moment};
use greylag::sysid::flight_path::{ActuatorClock, Options, reconstruct};
use greylag::sysid::weak_form::prepared::Prepared;
use serde_json::Value;

fn greylag(words: &[&str]) -> String {
    let made = Command::new(env!("CARGO_BIN_EXE_greylag")).args(words).output().unwrap();
    let said = String::from_utf8_lossy(&made.stderr);
    assert!(matches!(made.status.code(), Some(0 | 3)), "{words:?}: {said}");
    String::from_utf8(made.stdout).unwrap()
}

/// The error of free runs `horizon` (s) ahead over a log, added up here: every 3 s a run from the reconstructed state;
/// root mean square over runs of the mean over states of (error / scale)², a diverged run counting as one. With it the
/// root mean square of each state over the runs that did not diverge.
fn recomputed(model: &GreyBox, log: &Path, reference: &GreyBox, horizon: f64) -> (f64, [f64; 8]) {
    let read = logs::load(log, &logs::Options::default()).unwrap();
    let options = Options::of("flight", reference, ActuatorClock::AsRecorded);
    let flight = reconstruct(&read.flight, &options).unwrap();
    let slowest = reference.airframe.envelope.flying_from_mps();
    let prepared = Prepared::new(&flight, slowest).unwrap();
    let scale = model.scale();
    let (mut squares, mut runs, mut of_states, mut whole) = (0.0, 0.0, [0.0; 8], 0.0);
    for segment in &prepared.segments {
        let (mut start, ahead) = (0, (horizon / prepared.dt).round() as usize);
        while start + ahead < segment.len() {
            let end = &segment[start + ahead];
            let path = from_moment(model, &prepared, segment[start].time_s, horizon).unwrap();
            let (last, measured) = (path.time_s.len() - 1, end.state.to_array());
            runs += 1.0;
            if (path.time_s[last] - end.time_s).abs() < 0.5 * prepared.dt {
                let mut own = 0.0;
                for k in 0..8 {
                    let mut off = path.states[k][last] - measured[k];
                    if k == 0 {
                        // roll 179° and −179° are 2° apart
                        off = off.sin().atan2(off.cos());
                    }
                    own += (off / scale[k]).powi(2) / 8.0;
                    of_states[k] += off * off;
                }
                squares += own.min(1.0);
                whole += 1.0;
            } else {
                squares += 1.0;
            }
            start += (START_EVERY_S / prepared.dt).round() as usize;
        }
    }
    ((squares / runs).sqrt(), of_states.map(|s: f64| (s / whole).sqrt()))
}

/// The error 5 s ahead of holding the state, or of flying straight on, added up here as [`recomputed`] does.
fn without_aerodynamics(log: &Path, reference: &GreyBox, straight: &str) -> f64 {
    let read = logs::load(log, &logs::Options::default()).unwrap();
    let options = Options::of("flight", reference, ActuatorClock::AsRecorded);
    let flight = reconstruct(&read.flight, &options).unwrap();
    let slowest = reference.airframe.envelope.flying_from_mps();
    let prepared = Prepared::new(&flight, slowest).unwrap();
    let scale = reference.scale();
    let own = |held: &[f64; 8], measured: &[f64; 8]| -> f64 {
        let of = |k: usize| {
            let mut off = held[k] - measured[k];
            if k == 0 {
                off = off.sin().atan2(off.cos());
            }
            (off / scale[k]).powi(2) / 8.0
        };
        (0..8).map(of).sum()
    };
    let (mut squares, mut runs) = (0.0_f64, 0.0);
    for segment in &prepared.segments {
        let (mut start, ahead) = (0, (5.0 / prepared.dt).round() as usize);
        while start + ahead < segment.len() {
            let mut held = segment[start].state.to_array();
            if straight == "fly straight on" {
                held[3..6].fill(0.0);
            }
            // lost for good once it is off by as much as the scale
            let each =
                (start + 1..=start + ahead).map(|k| own(&held, &segment[k].state.to_array()));
            let each: Vec<f64> = each.collect();
            let lost = each.iter().any(|e| *e > 1.0);
            squares += if lost { 1.0 } else { each[ahead - 1] };
            runs += 1.0;
            start += (START_EVERY_S / prepared.dt).round() as usize;
        }
    }
    (squares / runs).sqrt()
}

/// Every number of the sentences is one of the JSON, to the three figures that are printed, angles in degrees.
fn all_in_json(answer: &Value) {
    let mut known = Vec::new();
    leaves(&answer["numbers"], &mut known);
    let flights = answer["numbers"]["flights"].as_array().unwrap().len();
    known.push(flights as f64);
    for line in ["error", "effect", "left"] {
        let text = answer[line].as_str().unwrap().replace('−', "-");
        let words = text.split(|c: char| !(c.is_ascii_digit() || ".-+".contains(c)));
        for word in words.map(|w| w.trim_end_matches('.')) {
            // 95 is the level of the interval
            let Some(said) = word.parse::<f64>().ok().filter(|x| *x != 95.0) else { continue };
            let near = |x: &f64| {
                // three figures, or a percentage to one
                let least = match x.abs() {
                    size if size > 9.9 => 0.51,
                    size if size > 0.5 => 0.051,
                    _ => 0.0,
                };
                [1.0, 1f64.to_degrees()]
                    .iter()
                    .any(|f| (f * x - said).abs() <= 5.1e-3 * said.abs() + least)
            };
            assert!(known.iter().any(near), "{said} of {text:?} is not in {answer}");
        }
    }
}

fn leaves(value: &Value, out: &mut Vec<f64>) {
    match value {
        Value::Number(n) => out.extend(n.as_f64()),
        Value::Array(all) => all.iter().for_each(|v| leaves(v, out)),
        Value::Object(all) => all.values().for_each(|v| leaves(v, out)),
        _ => {}
    }
}

#[test]
fn every_number_of_the_box_is_recomputed_from_the_flights() {
    let scratch = tempfile::tempdir().unwrap();
    let (logs, out) = (&LAGGING.logs, &LAGGING.out);
    let log = |k: usize| LAGGING.log(k);
    let after = out.join("model.toml");
    assert!(matches!(LAGGING.amended.status.code(), Some(0 | 3)), "{:?}", LAGGING.amended);
    let amended = String::from_utf8_lossy(&LAGGING.amended.stdout);
    let story: Value = serde_json::from_slice(&fs::read(out.join("amend.json")).unwrap()).unwrap();
    assert!(amended.starts_with(story["answer"]["error"].as_str().unwrap()), "{amended}");
    let last: Vec<&str> = amended.trim_end().lines().rev().take(2).collect();
    assert!(last[0].starts_with("next: greylag diagnose --model "), "{last:?}");
    assert!(last[1].starts_with("error at 5 s "), "{last:?}");
    all_in_json(&story["answer"]);
    // a forecast without aerodynamics stands beside the amendment too, and the channels of its effect
    assert!(story["answer"]["numbers"]["baseline"]["error"].as_f64().unwrap() > 0.0);
    assert!(amended.contains(story["answer"]["acts"].as_str().unwrap()), "{amended}");

    // a third flight, which no fit has seen, by the command that sees the two models alone
    let json = scratch.path().join("compared.json");
    let page = scratch.path().join("compared.html");
    let said = greylag(&[
        "compare",
        "--model",
        MODEL,
        after.to_str().unwrap(),
        "--log",
        log(2),
        "--recorded-clock",
        "--json",
        json.to_str().unwrap(),
        "--report",
        page.to_str().unwrap(),
    ]);
    let compared: Value = serde_json::from_slice(&fs::read(&json).unwrap()).unwrap();
    let answer = &compared["answer"];
    let error = answer["error"].as_str().unwrap();
    // the difference comes first, on screen and on the page
    assert!(said.starts_with(error), "{said}");
    let html = fs::read_to_string(&page).unwrap();
    let at = |text: &str| html.find(text).unwrap_or_else(|| panic!("{text} is not on the page"));
    assert!(at(error) < at("<h2>"), "the box stands first");
    assert!(error.starts_with("On 1 flight not fitted the error at 5 s "), "{error}");
    assert!(error.contains("by tuning") && error.contains("with actuator_lag"), "{error}");
    assert!(
        said.lines()
            .all(|l| l.starts_with("next:") || !l.contains('─') || l.chars().count() <= 100)
    );
    all_in_json(answer);
    assert!(said.contains(answer["acts"].as_str().unwrap()), "{said}");
    at(answer["acts"].as_str().unwrap());
    where_the_effect_acts(&compared, &story, log(2));

    let given = GreyBox::load(MODEL.as_ref()).unwrap();
    let fitted = GreyBox::load(&after).unwrap();
    let tuned = tuned(&story);
    let numbers = &answer["numbers"];
    let steps = numbers["steps"].as_array().unwrap();
    assert_eq!(steps.len(), 3);
    let mut before: Option<f64> = None;
    let mut of_states = Vec::new();
    for (step, model) in steps.iter().zip([&given, &tuned, &fitted]) {
        let (error, states) = recomputed(model, &logs[2], &given, 5.0);
        let told = step["error"].as_f64().unwrap();
        // the same runs, added up in another order
        assert!((told / error - 1.0).abs() < 1e-6, "{step}: {error}");
        if let Some(before) = before {
            let change: f64 = 100.0 * (error / before - 1.0);
            assert!(
                (step["change_percent"].as_f64().unwrap() - change).abs() < 1e-3,
                "{step}: {change}"
            );
        }
        before = Some(error);
        of_states.push(states);
    }
    // what the effect changes in use, and what is left, state by state
    let names = greylag::physics::State::NAMES;
    let place =
        |of: &Value| names.iter().position(|n| *n == of["state"].as_str().unwrap()).unwrap();
    let close = |told: &Value, x: f64| {
        assert!((told.as_f64().unwrap() / x - 1.0).abs() < 1e-6, "{told} {x}")
    };
    let used = &numbers["in_use"];
    close(&used["before"], of_states[1][place(used)]);
    close(&used["after"], of_states[2][place(used)]);
    let left = &numbers["left"];
    close(&left["rmse"], of_states[2][place(left)]);
    // the coefficient is the one of the model file
    let effect = &numbers["effects"][0];
    let of_file =
        fitted.coefficients().iter().find(|c| c.name.starts_with("actuator_lag.")).unwrap();
    assert_eq!(effect["value"].as_f64().unwrap(), of_file.value);
    assert_eq!(numbers["fitted_flights"], 0);
    // its interval is the one that the amendment wrote
    let written = story["parameters"].as_array().unwrap().iter();
    let written = written.clone().find(|p| p["name"] == of_file.name.as_str()).unwrap();
    assert_eq!(effect["ci95"], written["ci95"]);
    // the change of all of it
    let all = 100.0 * (before.unwrap() / recomputed(&given, &logs[2], &given, 5.0).0 - 1.0);
    assert!((numbers["change_percent"].as_f64().unwrap() - all).abs() < 1e-3, "{numbers} {all}");

    // one model alone stands beside the best forecast without aerodynamics that has not seen the flight
    let json = scratch.path().join("alone.json");
    let flags = ["--recorded-clock", "--json", json.to_str().unwrap()];
    greylag(&[&["compare", "--model", MODEL, "--log", log(2)][..], &flags].concat());
    let alone: Value = serde_json::from_slice(&fs::read(&json).unwrap()).unwrap();
    all_in_json(&alone["answer"]);
    let baseline = &alone["answer"]["numbers"]["baseline"];
    let (name, told) = (baseline["name"].as_str().unwrap(), baseline["error"].as_f64().unwrap());
    assert!(["hold the state", "fly straight on"].contains(&name), "{baseline}");
    for forecast in ["hold the state", "fly straight on"] {
        let error = without_aerodynamics(&logs[2], &given, forecast);
        assert!(told <= error * (1.0 + 1e-9), "{baseline}: {forecast} {error}");
        assert!(name != forecast || (told / error - 1.0).abs() < 1e-6, "{baseline} {error}");
    }

    // a flight that was fitted is called so
    let said = greylag(&["compare", "--model", MODEL, after.to_str().unwrap(), "--log", log(0)]);
    assert!(said.starts_with("On the flight that it was fitted to, the error"), "{said}");
}

/// The model as given with the coefficients that the amendment `story` tuned without its effects.
fn tuned(story: &Value) -> GreyBox {
    let mut tuned = GreyBox::load(MODEL.as_ref()).unwrap();
    for p in story["tuned"].as_array().unwrap() {
        assert!(tuned.set_coefficient(p["name"].as_str().unwrap(), p["value"].as_f64().unwrap()));
    }
    tuned
}

/// Every channel of the answer has the shares that the whole comparison states: those of the two models in its document
/// `compared`, that of the tuned model from a comparison of its own. The second channel falls by at least 0.3 of the first.
fn where_the_effect_acts(compared: &Value, story: &Value, log: &str) {
    let numbers = &compared["answer"]["numbers"];
    let acts = numbers["acts"].as_array().unwrap();
    assert!((1..=2).contains(&acts.len()) && numbers["method"] == "output_error", "{numbers}");
    let read = logs::load(log.as_ref(), &logs::Options::default()).unwrap();
    let tuned = tuned(story);
    let options = Options::of("flight", &tuned, ActuatorClock::AsRecorded);
    let flight = reconstruct(&read.flight, &options).unwrap();
    let quiet = greylag::sysid::progress::ignore_progress;
    let options = greylag::sysid::compare::Options::default();
    let own = greylag::sysid::compare::compare(&[tuned], &[flight], &options, &quiet).unwrap();
    let own = serde_json::to_value(&own.models[0].channels).unwrap();
    let share = |channels: &Value, act: &Value| {
        let all = channels.as_array().unwrap().iter();
        let found = all.clone().find(|c| c["channel"] == act["channel"]).unwrap();
        found["unexplained_fraction"].as_f64().unwrap()
    };
    let mut falls = Vec::new();
    for act in acts {
        let models = &compared["models"];
        for (key, channels) in
            [("given", &models[0]["channels"]), ("tuned", &own), ("after", &models[1]["channels"])]
        {
            let (stated, computed) = (act[key].as_f64().unwrap(), share(channels, act));
            assert!((stated - computed).abs() <= 1e-6 * computed.abs(), "{key} {act}: {computed}");
        }
        falls.push(act["tuned"].as_f64().unwrap() - act["after"].as_f64().unwrap());
    }
    assert!(falls[0] > 0.0 && falls.iter().all(|fall| *fall >= 0.3 * falls[0]), "{falls:?}");
}

#[test]
fn a_diagnosis_begins_with_its_answer_and_ends_with_the_next_command() {
    let scratch = tempfile::tempdir().unwrap();
    let logs = &LAGGING.logs;
    let json = scratch.path().join("diagnosis.json");
    let page = scratch.path().join("diagnosis.html");
    let log = |k: usize| LAGGING.log(k);
    let said = greylag(&[
        "diagnose",
        "--model",
        MODEL,
        "--log",
        log(0),
        log(1),
        "--json",
        json.to_str().unwrap(),
        "--report",
        page.to_str().unwrap(),
        "--nulls",
        "20",
    ]);
    let told: Value = serde_json::from_slice(&fs::read(&json).unwrap()).unwrap();
    let answer = &told["answer"];
    assert!(said.starts_with(answer["error"].as_str().unwrap()), "{said}");
    assert!(
        answer["error"]
            .as_str()
            .unwrap()
            .starts_with("On the 2 flights that it was fitted to, the error at 5 s")
    );
    all_in_json(answer);
    let first = answer["numbers"]["steps"][0]["error"].as_f64().unwrap();
    // the actuators come late: an asserted lag explains it, else it is corrected, as `compare` does
    let asserted = told["effects"].as_array().unwrap().iter().filter(|e| e["asserted"] == true);
    let clock = ActuatorClock::beside(asserted.map(|e| e["id"].as_str().unwrap()));
    let notes = told["notes"].as_array().unwrap().iter().map(|note| note.as_str().unwrap());
    let said_of_clock: Vec<&str> =
        notes.filter(|note| note.starts_with("The errors of free runs")).collect();
    let as_recorded = clock == ActuatorClock::AsRecorded;
    if as_recorded {
        let given = GreyBox::load(MODEL.as_ref()).unwrap();
        let each = logs[..2].iter().map(|log| recomputed(&given, log, &given, 5.0).0);
        // flights of one length weigh alike
        let error = (each.map(|e| e * e).sum::<f64>() / 2.0).sqrt();
        assert!((first / error - 1.0).abs() < 1e-6, "{first} {error}");
        assert!(said_of_clock[0].contains("--recorded-clock"), "{said_of_clock:?}");
    }
    let compared = scratch.path().join("compared.json");
    let mut line = vec!["compare", "--model", MODEL, "--log", log(0), log(1), "--json"];
    line.push(compared.to_str().unwrap());
    line.extend(as_recorded.then_some("--recorded-clock"));
    greylag(&line);
    let compared: Value = serde_json::from_slice(&fs::read(&compared).unwrap()).unwrap();
    let of_compare = compared["answer"]["numbers"]["steps"][0]["error"].as_f64().unwrap();
    assert!((first / of_compare - 1.0).abs() < 1e-9, "{first} {of_compare}");
    // the channels of the asserted effects have the shares of the diagnosis
    for act in answer["numbers"]["acts"].as_array().into_iter().flatten() {
        let mut channels = told["channels"].as_array().unwrap().iter();
        let channel = channels.find(|c| c["channel"] == act["channel"]).unwrap();
        assert_eq!(act["tuned"], channel["tuned_unexplained_fraction"]);
        assert_eq!(act["after"], channel["unexplained_fraction"]);
        assert!(said.contains(answer["acts"].as_str().unwrap()), "{said}");
    }
    // the better of the held state and straight flight stands beside it
    let baseline = &answer["numbers"]["baseline"];
    assert!(["hold the state", "fly straight on"].contains(&baseline["name"].as_str().unwrap()));
    assert!(baseline["error"].as_f64().unwrap() > first, "{baseline} {first}");
    let last = said.trim_end().lines().last().unwrap();
    assert!(last.starts_with("next: greylag "), "{last}");
    let html = fs::read_to_string(&page).unwrap();
    // the map shows the tuned model, and the one as given at a switch
    let [tuned, given] =
        ["data-option=\"tuned\"", "data-option=\"as given\""].map(|o| html.find(o));
    assert!(tuned.unwrap() < given.unwrap());
}
