//! The workbench over real HTTP: effects as text, flights in the simulator, and what must not be lost.

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::amend_support::{Manoeuvres, errors, fly, sensors};
use crate::workbench_support::{Bench, MODEL, word};
use greylag::logs::{Flight, Growing, Sample, csv};
use greylag::manoeuvres::{CRUISE_MPS, Schedule};
use greylag::workbench::Order;
use serde_json::{Value, json};

/// Drag by the square of the angle of attack, as a user writes it.
const OWN: &str = r#"schema = 1
id = "own_drag"
description = "Drag by the square of the angle of attack."
source = "a test"
status = "accepted"

[parameters.k]
value = 0.5
width = 1.0
bounds = [-5.0, 5.0]
unit = "1"
meaning = "drag coefficient per squared angle of attack"

[[channels]]
channel = "drag"
factor = "qbar_S"
shape = "k*alpha^2"
"#;

/// A log of an aircraft with drag by the square of the angle of attack, which the model lacks.
fn log(seed: u64) -> Vec<u8> {
    let flown = fly("drag_alpha2=0.8", 25.0, Manoeuvres::Usual, seed);
    let mut text = Vec::new();
    csv::write(&sensors::spoil(&flown, &errors(seed), seed), &mut text).unwrap();
    text
}

fn revision(bench: &Bench) -> u64 {
    bench.state()["revision"].as_u64().unwrap()
}

#[test]
fn an_effect_is_written_as_text_tried_and_saved_as_the_command_does() {
    let scratch = tempfile::tempdir().unwrap();
    let session = scratch.path().join("session");
    let bench = Bench::open(&session, &["--model", MODEL]);
    for k in 0..2 {
        assert_eq!(bench.drop_file(&format!("flight-{k}.csv"), &log(40 + k)).0, 200);
    }
    let check = |text: &str| {
        bench.ask("POST", "/api/check", json!({ "text": text }).to_string().as_bytes())
    };

    // what is wrong is said with its line, and nothing is kept
    let wrong = OWN.replace("k*alpha^2", "k*allpha^2");
    let (status, said) = check(&wrong);
    assert!(
        status == 200 && word(&said).contains("line 17") && word(&said).contains("allpha"),
        "{said}"
    );
    let (status, said) = bench.act(json!({ "do": "write", "text": wrong }));
    assert!(status == 422 && word(&said).contains("line 17"), "{said}");
    assert_eq!(bench.state()["own"], json!([]));
    // one of the catalogue keeps its name
    let (_, said) = check(&OWN.replace("own_drag", "drag_beta2"));
    assert!(word(&said).contains("catalogue"), "{said}");

    let (_, said) = check(OWN);
    assert_eq!(said["id"], "own_drag");
    let (status, state) = bench.act(json!({ "do": "write", "text": OWN }));
    assert_eq!((status, &state["own"][0]["id"]), (200, &json!("own_drag")), "{state}");
    // a diagnosis tries it from now on, as its command does
    assert!(state["commands"]["diagnose"].as_str().unwrap().contains("effects/own_drag.toml"));

    // tried like any suspect
    assert_eq!(bench.get("/api/curve/own_drag").1, Value::Null);
    assert_eq!(bench.act(json!({ "do": "tick", "effect": "own_drag" })).0, 200);
    let state = bench.until("the fit", |s| s["stack"][0]["status"] == "fitted");
    let error = |scores: &Value| {
        let five = scores.as_array().unwrap().iter().find(|s| s["horizon_s"] == 5.0);
        five.unwrap()["rmse_scaled"].as_f64().unwrap()
    };
    let story = &state["stack"][0]["story"];
    assert!(error(&story["after"]) < 0.8 * error(&story["before"]), "{story}");
    let (status, curve) = bench.get("/api/curve/own_drag");
    assert_eq!(status, 200, "{curve}");
    // drag shows in the force and in the rate of airspeed
    assert!([json!("D"), json!("V\u{307}")].contains(&curve["channel"]), "{curve}");
    assert!(curve["variable"].as_str().unwrap().contains("attack"), "{curve}");
    // drag has one sign on both sides, with an interval
    let sign = if curve["channel"] == json!("D") { 1.0 } else { -1.0 };
    let points = curve["contribution"].as_array().unwrap();
    let right = |p: &Value| sign * p[0].as_f64().unwrap() >= 0.0 && p[1].as_f64() <= p[2].as_f64();
    assert!(points.iter().all(right));
    let (status, said) = bench.act(json!({ "do": "forget", "effect": "own_drag" }));
    assert!(status == 422 && word(&said).contains("take it back"), "{said}");

    // saved: the files of the command, to the bit
    assert_eq!(bench.act(json!({ "do": "save" })).0, 200);
    let line = bench.state()["commands"]["amend"].as_str().unwrap().to_owned();
    let out = scratch.path().join("by-command");
    let said = session.canonicalize().unwrap().join("model").display().to_string();
    let line = line.replace(&format!("--out {said}"), &format!("--out {}", out.display()));
    let words: Vec<&str> = line.split(' ').skip(1).collect();
    let made = Command::new(env!("CARGO_BIN_EXE_greylag")).args(&words).output().unwrap();
    assert!(out.join("model.toml").exists(), "{line}: {}", String::from_utf8_lossy(&made.stderr));
    for file in ["model.toml", "own_drag.toml", "amend.json"] {
        let [by_page, by_command] =
            [session.join("model"), out.clone()].map(|f| fs::read_to_string(f.join(file)).unwrap());
        assert_eq!(by_page, by_command, "{file}");
    }

    // an edit of an accepted effect is fitted anew; kill -9 loses neither
    assert_eq!(bench.act(json!({ "do": "write", "text": OWN.replace("0.5", "0.6") })).0, 200);
    bench.until("the fit of the edit", |s| s["stack"][0]["status"] == "fitted");
    drop(bench);
    let state = Bench::open(&session, &[]).state();
    assert_eq!(state["stack"][0]["status"], "fitted");
    assert!(state["own"][0]["text"].as_str().unwrap().contains("value = 0.6"));
}

#[test]
fn a_flight_is_watched_stopped_recorded_and_taken_as_a_log() {
    let scratch = tempfile::tempdir().unwrap();
    let session = scratch.path().join("session");
    let bench = Bench::open(&session, &["--model", MODEL]);
    let order = |hide: &str| json!({ "do": "fly", "schedule": "attitudes", "controller": "lqi", "aircraft": "x8", "hide": hide, "seed": 1 });
    for (wrong, why) in [
        (order("drag_beta2"), "ID=AMPLITUDE"),
        (json!({ "do": "watch", "folder": scratch.path() }), "no recording"),
        (json!({ "do": "stop_flight" }), "nothing to stop"),
    ] {
        let (status, said) = bench.act(wrong);
        assert!(status == 422 && word(&said).contains(why), "{said}");
    }
    let (status, state) = bench.act(order("drag_beta2=1.0"));
    assert_eq!((status, &state["fly"]["on"]), (200, &json!(true)), "{state}");
    let command = state["flown"][0]["command"].as_str().unwrap();
    assert!(
        command.starts_with("greylag demo --model") && command.contains("--hide=drag_beta2=1.0")
    );
    let (status, said) = bench.act(order(""));
    assert!(status == 422 && word(&said).contains("a flight is on"), "{said}");
    // five seconds of it, while it flies
    let live = bench.until_of("/api/flying", "points", |f| {
        f["live"]["time_s"].as_array().is_some_and(|t| t.len() >= 50)
    });
    let of =
        |place: &Value, k: usize| place[k].as_array().unwrap().last().unwrap().as_f64().unwrap();
    let model = &live["live"]["models"][0];
    let lift = of(&live["live"]["measured"], 2);
    // level flight: −9.8 m/s² along z, give or take what a turn asks for
    assert!((-25.0..-3.0).contains(&lift), "{lift}");
    assert!(of(&model["band"], 2) > 0.0 && (of(&model["predicted"], 2) - lift).abs() < 10.0);
    assert_eq!(bench.act(json!({ "do": "stop_flight" })).0, 200);
    let state = bench.until("the end", |s| s["flown"][0]["outcome"] != "flying");
    assert_eq!(state["flown"][0]["outcome"], "stopped", "{state}");
    assert!(state["flown"][0]["seconds"].as_f64().unwrap() >= 4.0);
    let (status, state) = bench.act(json!({ "do": "take_flight", "flown": 0 }));
    assert_eq!((status, &state["flights"][0]["name"]), (200, &json!("flown-1.csv")), "{state}");
    assert_eq!(state["flights"][0]["role"], "unused");

    // the recording of any program is watched in the same way
    let folder = session.join("flights/1");
    assert_eq!(bench.act(json!({ "do": "watch", "folder": folder })).0, 200);
    bench.until_of("/api/flying", "points", |f| {
        f["live"]["time_s"].as_array().is_some_and(|t| t.len() >= 50)
    });
    assert_eq!(bench.act(json!({ "do": "stop_flight" })).0, 200);
    bench.until("the end", |s| s["flown"][1]["outcome"] == "stopped");

    // kill -9 in flight: the recording is kept, and the program that flew ends by itself
    assert_eq!(bench.act(order("")).0, 200);
    bench.until_of("/api/flying", "points", |f| {
        f["live"]["time_s"].as_array().is_some_and(|t| t.len() >= 10)
    });
    drop(bench);
    let bench = Bench::open(&session, &[]);
    assert_eq!(bench.state()["flown"][2]["outcome"], "cut_off");
    assert!(session.join("flights/2/flight.csv").exists());
}

#[test]
fn two_logs_of_one_name_that_come_at_once_do_not_mix() {
    let scratch = tempfile::tempdir().unwrap();
    let session = scratch.path().join("session");
    let bench = Bench::open(&session, &["--model", MODEL]);
    let logs = [log(50), log(51)];
    let seen = revision(&bench);
    let path = format!("/api/logs?name=flight.csv&revision={seen}");
    let statuses = std::thread::scope(|scope| {
        let (bench, path) = (&bench, &path);
        let sent = logs.each_ref().map(|log| scope.spawn(move || bench.ask("POST", path, log).0));
        sent.map(|thread| thread.join().unwrap())
    });
    // both were of one revision, so one of them comes too late
    let mut sorted = statuses;
    sorted.sort();
    assert_eq!(sorted, [200, 409]);
    let kept = statuses.iter().position(|s| *s == 200).unwrap();
    assert_eq!(fs::read(session.join("logs/flight.csv")).unwrap(), logs[kept]);
    let (status, state) = bench.drop_file("flight.csv", &logs[1 - kept]);
    assert_eq!((status, state["flights"].as_array().unwrap().len()), (200, 2), "{state}");
    drop(bench);
    let state = Bench::open(&session, &[]).state();
    assert!((0..2).all(|k| state["flights"][k]["error"].is_null()), "{state}");
}

#[test]
fn a_diagnosis_comes_back_with_the_roles_that_it_is_about() {
    let scratch = tempfile::tempdir().unwrap();
    let session = scratch.path().join("session");
    let bench = Bench::open(&session, &["--model", MODEL]);
    assert_eq!(bench.drop_file("flight.csv", &log(60)).0, 200);
    let role = |role: &str| bench.act(json!({ "do": "role", "flight": 0, "role": role })).1;
    let key = bench.state()["diagnosis"]["key"].as_str().unwrap().to_owned();
    assert_eq!(role("unused")["diagnosis"]["there"], false);
    // as a diagnosis leaves it
    let stored = json!({ "effects": [], "tried": [] });
    fs::write(session.join(format!("{key}.json")), stored.to_string()).unwrap();
    assert_eq!(role("hold_out")["diagnosis"]["there"], false);
    let state = role("fit");
    assert_eq!(
        (&state["diagnosis"]["there"], &state["diagnosis"]["behind"]),
        (&json!(true), &json!(false))
    );
    assert_eq!(bench.get("/api/diagnosis").1, stored);
    // an effect that is written now was not tried
    let state = bench.act(json!({ "do": "write", "text": OWN })).1;
    assert_eq!(
        (&state["diagnosis"]["there"], &state["diagnosis"]["behind"]),
        (&json!(true), &json!(true))
    );
}

#[test]
fn a_schedule_tells_two_effects_apart_as_the_command_does() {
    let scratch = tempfile::tempdir().unwrap();
    let session = scratch.path().join("session");
    let bench = Bench::open(&session, &["--model", MODEL]);
    let between = ["actuator_lag", "time_delay"];
    assert_eq!(bench.act(json!({ "do": "design", "between": between })).0, 200);
    let state = bench.until("the schedule", |s| s["designed"][0]["name"].is_string());
    let designed = &state["designed"][0];
    assert_eq!(designed["between"], json!(between));
    let file = Path::new(designed["file"].as_str().unwrap()).to_owned();
    let by_page = fs::read_to_string(&file).unwrap();
    assert!(
        state["fly"]["schedules"].as_array().unwrap().iter().any(|s| s["id"] == designed["name"])
    );
    // the command that is shown writes the same file
    let out = scratch.path().join("by-command.toml");
    let line = designed["command"].as_str().unwrap();
    let line = line.replace(&file.display().to_string(), &out.display().to_string());
    let words: Vec<&str> = line.split(' ').skip(1).collect();
    let made = Command::new(env!("CARGO_BIN_EXE_greylag")).args(&words).output().unwrap();
    assert!(made.status.success(), "{line}: {}", String::from_utf8_lossy(&made.stderr));
    assert_eq!(fs::read_to_string(&out).unwrap(), by_page);
    // two that cannot be told apart say so
    let (status, said) =
        bench.act(json!({ "do": "design", "between": ["actuator_lag", "actuator_lag"] }));
    assert_eq!(status, 200, "{said}");
    let state = bench.until("the failure", |s| s["schedule"]["error"].is_string());
    assert!(state["schedule"]["error"].as_str().unwrap().contains("name two effects"));
}

#[test]
fn rows_of_a_growing_log_come_whole_and_once_wherever_it_is_cut() {
    let sample = |k: u32| Sample { time_s: f64::from(k), airspeed_mps: 20.0, ..Default::default() };
    let flight = Flight { samples: (0..20).map(sample).collect(), ..Default::default() };
    let mut text = Vec::new();
    csv::write(&flight, &mut text).unwrap();
    for size in [1, 7, 100, text.len()] {
        let mut growing = Growing::default();
        let parts = text.chunks(size).map(|part| growing.take(part, Path::new("a.csv")).unwrap());
        let times: Vec<f64> = parts.flatten().map(|s| s.time_s).collect();
        assert_eq!(times, (0..20).map(f64::from).collect::<Vec<_>>(), "in parts of {size}");
    }
}

#[test]
fn an_order_is_words_that_a_command_line_takes_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let order = |schedule: &str, controller: &str, aircraft: &str, hide: &str| Order {
        schedule: schedule.into(),
        controller: controller.into(),
        aircraft: aircraft.into(),
        hide: hide.into(),
        turbulence: Some(3),
        seed: 1,
    };
    let words_at = |order: &Order, cruise_mps: f64| {
        order.words(folder.path(), Path::new("model.toml"), cruise_mps, Path::new("out"))
    };
    let words = |order: &Order| words_at(order, CRUISE_MPS);
    let said = words(&order("attitudes", "lqi", "x8", "drag_beta2=1 actuator_lag=0.05")).unwrap();
    let said = said.join(" ");
    assert!(said.ends_with("--hide=drag_beta2=1 --hide=actuator_lag=0.05 --turbulence-severity 3 --seed 1 --out out"), "{said}");
    assert!(!said.contains("--schedule"), "{said}");
    // a manoeuvre of the menu becomes a file
    let said = words(&order("elevator-3211", "lqi", "x8", "")).unwrap();
    let at = said.iter().position(|w| w == "--schedule").unwrap();
    let airspeed = || Schedule::load(Path::new(&said[at + 1])).unwrap().steps()[0].target.airspeed;
    // for the cruise airspeed of the aircraft
    let usual = airspeed();
    words_at(&order("elevator-3211", "lqi", "x8", ""), 2.0 * CRUISE_MPS).unwrap();
    assert!((airspeed() / usual - 2.0).abs() < 1e-6, "{usual}, then {}", airspeed());
    for wrong in [
        order("attitudes", "lqi", "x8", "--out=/etc/x"),
        order("attitudes", "lqi", "x8", "nothing"),
        order("../model", "lqi", "x8", ""),
        order("none", "lqi", "x8", ""),
        order("attitudes", "--help", "x8", ""),
        order("attitudes", "lqi", "/etc", ""),
    ] {
        assert!(words(&wrong).is_err(), "{wrong:?}");
    }
}
