//! `greylag workbench` over real HTTP: drop, see, tick, judge, save, and everything that must be refused.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::amend_support::{Manoeuvres, errors, fly, sensors};
use crate::workbench_support::{Bench, MODEL, PATIENCE, word};
use greylag::logs::{Flight, csv};
use serde_json::{Value, json};

/// Three logs of an aircraft whose actuators lag by 50 ms, which the model does not know.
pub fn logs(folder: &Path) -> Vec<PathBuf> {
    let log = |k: u64| {
        let name = if k < 2 { format!("flight-{k}.csv") } else { "test-2.csv".into() };
        let path = folder.join(name);
        csv::save(&flown(k), &path).unwrap();
        path
    };
    (0..3).map(log).collect()
}

fn flown(k: u64) -> Flight {
    let flown = fly("actuator_lag=0.05", 25.0, Manoeuvres::Usual, 20 + k);
    sensors::spoil(&flown, &errors(20 + k), k)
}

/// The model with an effect of a file in it, which is zero and so stays as it is, in `folder`.
fn model_with_a_file(folder: &Path) -> PathBuf {
    let model = fs::read_to_string(MODEL).unwrap();
    let model = model.replace("schema = 1\n", "schema = 1\neffect_files = [\"own.toml\"]\n")
        + "\n[effects.yaw_by_throttle]\nk = { value = 0.0, source = \"a test\" }\n";
    fs::copy("params/effects/yaw_by_throttle.toml", folder.join("own.toml")).unwrap();
    fs::copy("params/x8/airframe.toml", folder.join("airframe.toml")).unwrap();
    fs::write(folder.join("model.toml"), model).unwrap();
    folder.join("model.toml")
}

/// Runs the commands that a page shows in a shell, about a model that is gone, so that each ends as soon as its line
/// is understood: 2 would be a wrong command line.
fn commands_are_understood(state: &Value, model: &Path, shown: &[&str]) {
    let model = model.canonicalize().unwrap().display().to_string();
    for (name, line) in state["commands"].as_object().unwrap() {
        let line = line.as_str().unwrap();
        assert_eq!(!line.is_empty(), shown.contains(&name.as_str()), "{name}: {line}");
        if line.is_empty() {
            continue;
        }
        let expected = if name == "flights" { [0, 3] } else { [1, 1] };
        let line = line.replace(&model, "gone.toml");
        let line = line.replacen("greylag", env!("CARGO_BIN_EXE_greylag"), 1);
        let made = Command::new("sh").args(["-c", &line]).output().unwrap();
        let said = String::from_utf8_lossy(&made.stderr);
        assert!(made.status.code().is_some_and(|c| expected.contains(&c)), "{line}: {said}");
    }
}

/// The error at 5 s.
pub fn at_5_s(scores: &Value) -> f64 {
    let five = scores.as_array().unwrap().iter().find(|s| s["horizon_s"] == 5.0);
    five.unwrap()["rmse_scaled"].as_f64().unwrap()
}

#[test]
fn drop_see_tick_judge_save_and_go_on_after_a_kill() {
    let scratch = tempfile::tempdir().unwrap();
    let (session, logs) = (scratch.path().join("session"), logs(scratch.path()));
    let model = model_with_a_file(scratch.path());
    let bench = Bench::open(&session, &["--model", model.to_str().unwrap()]);

    // drop: roles as they come, the test unseen
    for log in &logs {
        let name = log.file_name().unwrap().to_str().unwrap();
        let (status, state) = bench.drop_file(name, &fs::read(log).unwrap());
        assert_eq!(status, 200, "{state}");
    }
    let state = bench.state();
    let roles: Vec<_> = (0..3).map(|k| state["flights"][k]["role"].as_str().unwrap()).collect();
    assert_eq!(roles, ["fit", "hold_out", "test"]);
    assert_eq!(state["flights"][2]["locked"], true);
    assert!(state["flights"][2]["strip"].is_null());
    let (status, said) = bench.get("/api/flight/2");
    assert_eq!((status, word(&said).contains("press Judge")), (423, true), "{said}");
    // the same log under another name is no other log
    let (status, said) = bench.drop_file("copy.csv", &fs::read(&logs[0]).unwrap());
    assert_eq!((status, word(&said).contains("flight-0.csv")), (422, true), "{said}");

    // see
    let (status, failing) = bench.get("/api/failing");
    assert_eq!(status, 200, "{failing}");
    assert_eq!(failing["flights"], json!([0, 1]));
    let channels = failing["models"][0]["channels"].as_array().unwrap();
    assert!(channels.len() >= 6 && !channels[0]["bins"].as_array().unwrap().is_empty());
    let (_, flight) = bench.get("/api/flight/0");
    let (windows, lift) = (&flight["window_s"], &flight["channels"]["L"]);
    // measured and one model
    assert_eq!(lift.as_array().unwrap().len(), 2);
    assert_eq!(lift[0].as_array().unwrap().len(), windows.as_array().unwrap().len());
    let run = json!({ "flight": 0, "time_s": 10.0, "seconds": 5.0 }).to_string();
    let (status, run) = bench.ask("POST", "/api/free-run", run.as_bytes());
    assert_eq!(status, 200, "{run}");
    let (times, speed) = (&run["runs"][0]["time_s"], &run["runs"][0]["states"]["V"]);
    assert!((times[0].as_f64().unwrap() - 10.0).abs() < 0.01);
    // 5 s at 100 Hz with both ends
    assert_eq!((times.as_array().unwrap().len(), speed.as_array().unwrap().len()), (501, 501));
    let nowhere = json!({ "flight": 0, "time_s": 9e9, "seconds": 5.0 }).to_string();
    assert_eq!(bench.ask("POST", "/api/free-run", nowhere.as_bytes()).0, 422);

    // tick
    let (status, said) = bench.act(json!({ "do": "tick", "effect": "flubber" }));
    assert_eq!((status, word(&said).contains("effects list")), (422, true), "{said}");
    let (status, said) = bench.act(json!({ "do": "tick", "effect": "actuator_lag" }));
    assert_eq!(status, 200, "{said}");
    let state = bench.until("the fit", |s| s["stack"][0]["status"] == "fitted");
    let step = &state["stack"][0];
    let (before, after) = (at_5_s(&step["story"]["before"]), at_5_s(&step["story"]["after"]));
    // a tenth of the error would be an effect that hardly acts; the lag is most of it
    assert!(after < 0.5 * before, "{before} to {after}");
    assert!(at_5_s(&step["on_fit"]["amended"]) < at_5_s(&step["on_fit"]["given"]));
    let (_, failing) = bench.get("/api/failing");
    assert_eq!(failing["ways"], json!(["given", "tuned", "amended"]));
    assert_eq!(failing["models"][2]["name"], "jsbsim+actuator_lag");
    let (_, flight) = bench.get("/api/flight/0");
    assert_eq!(flight["ways"], failing["ways"]);
    // measured and three models, of which no two predict the same
    let lift = flight["channels"]["L"].as_array().unwrap();
    assert!(lift.len() == 4 && lift[1] != lift[2] && lift[2] != lift[3]);

    commands_are_understood(
        &state,
        &model,
        &["flights", "compare", "diagnose", "propose", "amend", "judge"],
    );

    // judge: counted and written before it is shown
    let (status, state) = bench.act(json!({ "do": "judge" }));
    assert_eq!(status, 200, "{state}");
    let opening = &state["openings"][0];
    assert_eq!(opening["flights"], json!(["test-2.csv"]));
    assert_eq!(opening["effects"], json!(["actuator_lag"]));
    assert!(opening["amended"].as_f64().unwrap() < opening["given"].as_f64().unwrap());
    assert!(fs::read_to_string(session.join("session.toml")).unwrap().contains("[[openings]]"));
    assert_eq!(bench.get("/api/flight/2").0, 200);

    // save: the file of the command, to the bit
    assert_eq!(bench.act(json!({ "do": "save" })).0, 200);
    let line = state["commands"]["amend"].as_str().unwrap();
    let out = scratch.path().join("by-command");
    let said = session.canonicalize().unwrap().join("model").display().to_string();
    let line = line.replace(&format!("--out {said}"), &format!("--out {}", out.display()));
    let words: Vec<&str> = line.split(' ').skip(1).collect();
    let made = Command::new(env!("CARGO_BIN_EXE_greylag")).args(&words).output().unwrap();
    assert!(made.status.success(), "{line}: {}", String::from_utf8_lossy(&made.stderr));
    for file in ["model.toml", "airframe.toml", "yaw_by_throttle.toml", "amend.json"] {
        let [by_page, by_command] =
            [session.join("model"), out.clone()].map(|f| fs::read_to_string(f.join(file)).unwrap());
        assert_eq!(by_page, by_command, "{file}");
    }

    // kill -9, and on
    let revision = bench.state()["revision"].clone();
    drop(bench);
    let bench = Bench::open(&session, &[]);
    let state = bench.state();
    assert_eq!(state["revision"], revision);
    assert_eq!(state["stack"][0]["status"], "fitted");
    assert_eq!(state["openings"].as_array().unwrap().len(), 1);
    // where the tuned model fails is known again, not only where the given one does
    let (_, again) = bench.get("/api/failing");
    assert_eq!(again["models"][1], failing["models"][1]);
    assert_eq!(bench.act(json!({ "do": "undo" })).1["redo"], "actuator_lag");
    let (status, state) = bench.act(json!({ "do": "redo" }));
    assert_eq!((status, &state["stack"][0]["status"]), (200, &json!("fitted")));
}

#[test]
fn what_must_be_refused_is_refused_in_words() {
    let scratch = tempfile::tempdir().unwrap();
    // a shell would take it for two words
    let (session, place) = (scratch.path().join("my session"), scratch.path());
    let model = place.join("model.toml");
    fs::copy(MODEL, &model).unwrap();
    fs::copy("params/x8/airframe.toml", place.join("airframe.toml")).unwrap();
    let bench = Bench::open(&session, &["--model", model.to_str().unwrap()]);
    let host = format!("Host: {}\r\n", bench.host);
    let token = &bench.token;

    // who may ask
    for headers in [
        host.clone(),
        format!("{host}Authorization: Bearer wrong\r\n"),
        format!("{host}Cookie: greylag-1={token}\r\n"),
    ] {
        let (status, _, body) = bench.raw("GET", "/api/state", &headers, b"");
        assert_eq!(status, 401, "{headers}");
        assert!(String::from_utf8_lossy(&body).contains("token"));
    }
    let right = format!("Authorization: Bearer {token}\r\n");
    let evil = format!("Host: evil.example\r\n{right}");
    assert_eq!(bench.raw("GET", "/api/state", &evil, b"").0, 403);
    let evil = format!("{host}{right}Origin: http://127.0.0.1:1\r\n");
    assert_eq!(bench.raw("POST", "/api/act", &evil, b"{}").0, 403);
    // the token of the address becomes a cookie, and nothing else may be loaded
    let (status, head, _) = bench.raw("GET", &format!("/?token={token}"), &host, b"");
    let head = head.to_lowercase();
    assert!(status == 303 && head.contains("httponly") && head.contains("samesite=strict"));
    assert!(head.contains("default-src 'none'"), "{head}");
    let port = bench.host.rsplit(':').next().unwrap();
    let cookie = format!("{host}Cookie: greylag-{port}={token}\r\n");
    let (status, _, page) = bench.raw("GET", "/", &cookie, b"");
    assert!(status == 200 && String::from_utf8_lossy(&page).contains("Where it fails"));

    // what may be dropped
    let (status, said) = bench.drop_file("picture.csv", b"\x89PNG\r\n\x1a\n0000000000");
    assert_eq!((status, word(&said).contains("picture.csv")), (422, true), "{said}");
    assert!(fs::read_dir(session.join("logs")).unwrap().next().is_none(), "kept what is no log");
    for name in ["..%2Fout.csv", "%2Fetc%2Fpasswd", ".hidden"] {
        assert_eq!(bench.drop_file(name, b"time_s\n").0, 422, "{name}");
    }
    let large = format!("{}Content-Length: 1073741824\r\n", bench.headers());
    let (status, _, body) = {
        // 1 GB announced is refused before it is sent
        let mut stream = TcpStream::connect(&bench.host).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        write!(
            stream,
            "POST /api/logs?name=large.csv&revision=0 HTTP/1.1\r\nConnection: close\r\n{large}\r\n"
        )
        .unwrap();
        let mut answer = String::new();
        let _ = stream.read_to_string(&mut answer);
        (answer.split(' ').nth(1).unwrap().to_owned(), (), answer)
    };
    assert!(status == "413" && body.contains("greylag workbench large.csv"), "{body}");
    for path in ["/api/none", "/assets/none.js", "/api/flight/7"] {
        assert_eq!(bench.get(path).0, 404, "{path}");
    }
    assert!(bench.act(json!({ "do": "dance" })).0 >= 400);
    for (act, why) in [
        (json!({ "do": "diagnose" }), "has the role Fit"),
        (json!({ "do": "judge" }), "has the role Test"),
        (json!({ "do": "undo" }), "nothing"),
        (json!({ "do": "save" }), "accept an effect first"),
    ] {
        let (status, said) = bench.act(act.clone());
        assert_eq!((status, word(&said).contains(why)), (422, true), "{act}: {said}");
    }

    // two browsers: the second one is refused
    let mut flight = flown(0);
    let csv_of = |flight: &Flight, name: &str| {
        csv::save(flight, &place.join(name)).unwrap();
        fs::read(place.join(name)).unwrap()
    };
    let log = csv_of(&flight, "a.csv");
    assert_eq!(bench.drop_file("a.csv", &log).0, 200);
    let seen = bench.state()["revision"].as_u64().unwrap();
    let role = |role: &str| json!({ "do": "role", "flight": 0, "role": role });
    assert_eq!(bench.act_at(seen, role("unused")).0, 200);
    let (status, said) = bench.act_at(seen, role("test"));
    assert_eq!((status, word(&said).contains("another window")), (409, true), "{said}");
    assert_eq!(bench.state()["flights"][0]["role"], "unused");
    assert_eq!(bench.act(role("fit")).0, 200);

    // a wrong sign: the log serves for nothing until its finding's factor is in the session's mapping
    flight.samples.iter_mut().for_each(|s| s.specific_force_mps2[2] *= -1.0);
    let (status, state) = bench.drop_file("turned.csv", &csv_of(&flight, "turned.csv"));
    assert_eq!((status, &state["flights"][1]["role"]), (200, &json!("unused")), "{state}");
    let findings = state["flights"][1]["findings"].as_array().unwrap();
    let cure = findings.iter().map(|f| &f["cure"]).find(|c| c["column"] == "az_mps2").unwrap();
    assert_eq!(cure["scale"], -1.0);
    // a mapping that cannot be is not written
    let wrong = json!({ "do": "map", "flight": 1, "column": "no_column", "scale": 2.0 });
    let (status, said) = bench.act(wrong);
    assert_eq!((status, word(&said).contains("no_column")), (422, true), "{said}");
    assert!(!session.join("mapping.toml").exists());
    let map = json!({ "do": "map", "flight": 1, "column": "az_mps2", "scale": cure["scale"] });
    let (status, state) = bench.act(map);
    assert_eq!((status, &state["flights"][1]["in_doubt"]), (200, &json!(false)), "{state}");
    // as on a command line, a mapping holds for all logs: the other one is wrong now, and serves for nothing
    assert_eq!(state["flights"][0]["in_doubt"], true);
    assert_eq!([&state["flights"][0]["role"], &state["flights"][1]["role"]], ["unused", "fit"]);
    commands_are_understood(&state, &model, &["flights", "compare", "diagnose"]);
    let (_, state) = bench.act(role("fit"));
    let line = state["commands"]["diagnose"].as_str().unwrap();
    assert!(line.contains("--mapping '") && line.contains("--despite-problems"), "{line}");
    commands_are_understood(&state, &model, &["flights", "compare", "diagnose", "propose"]);

    // two programs: the second one is refused
    let second = Command::new(env!("CARGO_BIN_EXE_greylag"))
        .args(["workbench", "--dir", session.to_str().unwrap()])
        .output()
        .unwrap();
    assert!(!second.status.success());
    assert!(String::from_utf8_lossy(&second.stderr).contains("another workbench"));

    // a model edited outside
    let text = fs::read_to_string(&model).unwrap();
    fs::write(&model, text.replace("name = \"jsbsim\"", "name = \"edited\"")).unwrap();
    assert_eq!(bench.state()["model"]["changed_outside"], true);
    let (status, said) = bench.act(json!({ "do": "diagnose" }));
    assert_eq!((status, word(&said).contains("changed on disk")), (409, true), "{said}");
    let (status, state) = bench.act(json!({ "do": "reload_model" }));
    assert_eq!((status, &state["model"]["name"]), (200, &json!("edited")), "{state}");
    // the airframe is a file of the model too, and what logs are read by: a turned log is no flight below its least airspeed
    let airframe = fs::read_to_string(place.join("airframe.toml")).unwrap();
    fs::write(place.join("airframe.toml"), airframe + "\n# looked at again\n").unwrap();
    let state = bench.state();
    assert_eq!(state["model"]["changed_outside"], true);
    let (_, reloaded) = bench.act(json!({ "do": "reload_model" }));
    assert_eq!(reloaded["model"]["changed_outside"], false);
    assert_ne!(reloaded["diagnosis"]["key"], state["diagnosis"]["key"]);

    // a diagnosis is cancelled at once
    assert_eq!(bench.act(json!({ "do": "diagnose" })).0, 200);
    let job = bench.state()["jobs"][0]["id"].clone();
    let begun = Instant::now();
    let (_, state) = bench.act(json!({ "do": "cancel", "job": job }));
    assert_eq!(state["jobs"], json!([]));
    // 100 ms is asked of an idle machine
    assert!(begun.elapsed() < Duration::from_secs(2), "{:?}", begun.elapsed());
}

#[test]
fn two_logs_of_one_name_are_two_flights() {
    let scratch = tempfile::tempdir().unwrap();
    let place = scratch.path();
    let log = |k: u64| {
        let folder = place.join(k.to_string());
        fs::create_dir(&folder).unwrap();
        csv::save(&flown(k), &folder.join("flight.csv")).unwrap();
        folder.join("flight.csv").display().to_string()
    };
    let logs = [log(0), log(1)];
    let session = place.join("session");
    let bench = Bench::open(&session, &["--model", MODEL, &logs[0], &logs[1]]);
    let state = bench.state();
    let names = [&state["flights"][0]["name"], &state["flights"][1]["name"]];
    assert!(names[0] != names[1], "{names:?}");
    assert_eq!(bench.get("/api/failing").1["flights"], json!([0, 1]));
    let lift = |k: usize| bench.get(&format!("/api/flight/{k}")).1["channels"]["L"][0].clone();
    assert_ne!(lift(0), lift(1));

    // a test flight is opened by itself, not by its name
    let role = |k: usize, role: &str| bench.act(json!({ "do": "role", "flight": k, "role": role }));
    role(0, "test");
    let (status, state) = bench.act(json!({ "do": "judge" }));
    assert_eq!((status, &state["openings"][0]["occasion"]), (200, &json!("judged")), "{state}");
    let locked = |state: &Value| [0, 1].map(|k| state["flights"][k]["locked"] == true);
    assert_eq!(locked(&role(1, "test").1), [false, true]);
    // another role shows it, which is recorded as a look
    let (_, state) = role(1, "fit");
    assert_eq!(state["openings"][1]["occasion"], "other_role", "{state}");
    assert_eq!(state["openings"][1]["flights"], json!(["flight.csv"]));
    assert_eq!(locked(&role(1, "test").1), [false, false]);

    // two flights to fit to and none held out: nothing to judge effects by, but enough for a diagnosis
    role(0, "fit");
    let (_, before) = role(1, "unused");
    let (_, state) = role(1, "fit");
    assert_ne!(before["diagnosis"]["key"], state["diagnosis"]["key"]);
    let (status, said) = bench.act(json!({ "do": "tick", "effect": "actuator_lag" }));
    assert_eq!((status, word(&said).contains("role Hold out")), (422, true), "{said}");
    let (status, state) = bench.act(json!({ "do": "diagnose" }));
    assert_eq!((status, &state["jobs"][0]["work"]), (200, &json!("diagnosis")), "{state}");
    let job = state["jobs"][0]["id"].clone();
    assert_eq!(bench.act(json!({ "do": "cancel", "job": job })).0, 200);
    let key = bench.state()["diagnosis"]["key"].clone();
    drop(bench);
    // what was worked out of logs that were read in another way is not taken up
    let bench = Bench::open(&session, &["--lenient"]);
    let state = bench.state();
    assert_ne!(state["diagnosis"]["key"], key);
    assert!(state["commands"]["diagnose"].as_str().unwrap().contains(" --lenient"), "{state}");
    drop(bench);

    // a model in the environment is for new sessions; one on the command line must be the session's
    let program = || {
        let mut command = Command::new(env!("CARGO_BIN_EXE_greylag"));
        command.args(["workbench", "--dir", session.to_str().unwrap()]);
        command.current_dir(env!("CARGO_MANIFEST_DIR"));
        command
    };
    let other = program().args(["--model", "params/x8/prior.toml"]).output().unwrap();
    let said = String::from_utf8_lossy(&other.stderr).into_owned();
    assert!(!other.status.success() && said.contains("leave --model out"), "{said}");
    let mut child = program()
        .env("GREYLAG_MODEL", "params/x8/prior.toml")
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
    let _ = child.kill();
    let _ = child.wait();
    assert!(line.contains("http://127.0.0.1"), "{line}");
}

#[test]
fn a_test_flight_that_is_removed_unopened_and_added_again_is_locked() {
    let scratch = tempfile::tempdir().unwrap();
    let (session, log) = (scratch.path().join("session"), scratch.path().join("log.csv"));
    csv::save(&flown(0), &log).unwrap();
    let log = fs::read(&log).unwrap();
    let bench = Bench::open(&session, &["--model", MODEL]);
    assert_eq!(bench.drop_file("test-1.csv", &log).0, 200);
    assert_eq!(bench.act(json!({ "do": "remove", "flight": 0 })).0, 200);
    drop(bench);
    // without its record the first log would be a fit flight
    let bench = Bench::open(&session, &[]);
    assert_eq!(bench.drop_file("flight.csv", &log).0, 200);
    let state = bench.state();
    let flight = &state["flights"][0];
    assert_eq!((&flight["role"], &flight["locked"]), (&json!("test"), &json!(true)), "{state}");
    let (_, state) = bench.act(json!({ "do": "role", "flight": 0, "role": "fit" }));
    assert_eq!(state["openings"][0]["occasion"], "other_role", "{state}");
}
