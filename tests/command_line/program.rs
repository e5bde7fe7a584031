//! The program as a user runs it: bad input is one line on standard error with a failing status.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Output, Stdio};

use crate::compare_support::{REALISTIC, fly};
use greylag::logs::csv;

fn greylag(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_greylag")).args(arguments).output().unwrap()
}

/// Fails with one line that says all `words`.
fn refuses(arguments: &[&str], words: &[&str]) {
    let output = greylag(arguments);
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(!output.status.success(), "{arguments:?} succeeded");
    for word in words {
        assert!(error.contains(word), "{arguments:?} says {error:?}, not {word:?}");
    }
    // clap adds its usage to what it refuses; everything else is one line
    let lines = error.lines().filter(|line| !line.starts_with("flying")).count();
    assert!(lines == 1 || error.contains("--help"), "{arguments:?} says more than a line: {error}");
}

#[test]
fn evaluate_writes_scores_as_json_and_never_over_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let targets = folder.path().join("targets.csv");
    fs::write(&targets, "group,roll_deg,pitch_deg\neasy,10,5\nhard_corners,-50,26\n").unwrap();
    let json = folder.path().join("scores.json");
    let (targets, out) = (targets.to_str().unwrap(), json.to_str().unwrap());
    let arguments = ["evaluate", "--controller", "pid", "lqi", "--targets", targets, "--json", out];
    let output = greylag(&arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    // both leave a limit in the corner: the last line flies the same with the limiter, and after that the best controller
    let said = String::from_utf8(output.stdout).unwrap();
    let next = said.lines().next_back().unwrap();
    let same = "greylag evaluate --controller pid lqi --targets ";
    assert!(next.starts_with(&format!("next: {same}")), "{said}");
    assert!(next.ends_with(" --envelope kept"), "{said}");
    let whole = said.replace("\n  ", " ");
    for part in ["Flown without the envelope limiter.", "Outside the limits: ", " (limit 2.20)"] {
        assert!(whole.contains(part), "{part}: {said}");
    }
    let limited = greylag(&[&arguments[..6], &["--envelope", "kept"]].concat());
    let kept = String::from_utf8(limited.stdout).unwrap();
    let next = kept.lines().next_back().unwrap();
    assert!(next.starts_with("next: greylag demo --aircraft x8 --controller "), "{kept}");
    assert!(kept.contains("Flown with the envelope limiter."), "{kept}");
    // the model of all is named once
    assert!(said.contains("model of all controllers that need one: prior-severe-learned"));
    let scores: serde_json::Value = serde_json::from_slice(&fs::read(&json).unwrap()).unwrap();
    assert_eq!(scores["schema"], "greylag.evaluation/1");
    let lqi = &scores["controllers"][1];
    assert_eq!(
        (&lqi["controller"], &lqi["model"]),
        (&"lqi".into(), &"prior-severe-learned".into())
    );
    let groups: Vec<_> =
        lqi["groups"].as_array().unwrap().iter().map(|g| g["targets"].clone()).collect();
    assert_eq!(groups, ["easy", "hard_corners", "all"]);
    assert!(lqi["groups"][0]["mean_deg"].as_f64().unwrap() < 0.03);
    assert!(lqi["ms_per_step"]["p999"].as_f64().unwrap() > 0.0);
    refuses(&arguments, &["scores.json", "--force"]);
}

/// What happened on the way stands in the terminal within a hundred columns, and in JSON for every flight; the steps of
/// a seed are the same ones.
#[test]
fn evaluate_measures_the_way_to_targets_and_steps() {
    let folder = tempfile::tempdir().unwrap();
    let fly = |name: &str, more: &[&str]| {
        let json = folder.path().join(name);
        let out = json.to_str().unwrap();
        let mut arguments = vec!["evaluate", "--controller", "lqi", "--steps", "3", "--json", out];
        arguments.extend(more);
        let output = greylag(&arguments);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let scores: serde_json::Value = serde_json::from_slice(&fs::read(&json).unwrap()).unwrap();
        (String::from_utf8(output.stdout).unwrap(), scores["controllers"][0].clone())
    };
    let (said, lqi) = fly("some.json", &["--every", "70", "--group", "easy"]);
    assert!(said.lines().all(|line| line.chars().count() <= 100), "{said}");
    for part in [
        "integral of error, ° s",
        "load factor, largest",
        "load factor and α kept, %",
        "steps, n = 3",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
    // the 70th and the 140th target are easy
    let groups: Vec<_> = lqi["groups"].as_array().unwrap().iter().map(|g| &g["count"]).collect();
    assert_eq!(groups, [2, 3]);
    let flights = lqi["flights"].as_array().unwrap();
    assert_eq!(flights.len(), 5);
    let integral = flights[0]["quality"]["error_integral_deg_s"].as_f64().unwrap();
    assert!((1.0..100.0).contains(&integral), "{integral}");
    assert!(flights[0]["from_deg"].is_null() && flights[4]["from_deg"][0].is_number());
    let (_, alone) = fly("steps.json", &["--no-targets"]);
    assert_eq!(alone["flights"][2], flights[4]);
    let (_, drawn) = fly("drawn.json", &["--no-targets", "--draws", "2"]);
    assert_eq!(drawn["all"]["flights"].as_array().unwrap().len(), 6);
    refuses(&["evaluate", "--controller", "lqi", "--no-targets"], &["--steps"]);
    refuses(&["evaluate", "--controller", "lqi", "--every", "900"], &["--every 900", "smaller"]);
}

#[test]
fn evaluate_refuses_what_it_cannot_fly() {
    refuses(&["evaluate", "--controller", "autopilot"], &["autopilot", "lqi"]);
    refuses(
        &["evaluate", "--controller", "lqi", "--model", "none.toml"],
        &["none.toml", "params/x8/prior.toml"],
    );
    refuses(
        &["evaluate", "--controller", "lqi", "--targets", "none.csv"],
        &["none.csv", "greylag targets"],
    );
    refuses(
        &["evaluate", "--controller", "lqi", "--json", "nodir/x.json"],
        &["nodir/x.json", "folder"],
    );
    refuses(&["demo", "--aircraft", "nosuch"], &["nosuch"]);
    refuses(&["demo", "--wind-ned-mps", "nan,0,0"], &["wind"]);
    refuses(
        &["evaluate", "--controller", "pid", "--aircraft-dir", "nowhere", "--aircraft", "glider"],
        &["glider", "nowhere"],
    );
}

#[test]
fn a_start_below_the_airframes_least_airspeed_is_refused() {
    refuses(
        &["evaluate", "--controller", "pid", "--start-airspeed-mps", "5"],
        &["5 m/s", "airspeed_min_mps", "--start-airspeed-mps"],
    );
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().to_str().unwrap();
    refuses(
        &["collect", "--out", out, "--aircraft-dir", "nowhere", "--aircraft", "glider"],
        &["glider", "--start-airspeed-mps"],
    );
}

#[test]
fn a_property_can_be_named_and_a_wrong_key_is_answered_with_those_there_are() {
    let with = |property: &str| {
        let words = ["fcs/no-such-property", "aileron_position"];
        let word = if property.starts_with("wing") { &words[1..] } else { &words[..1] };
        refuses(&["evaluate", "--controller", "pid", "--property", property], word);
    };
    with("aileron_position=fcs/no-such-property");
    with("wing=fcs/no-such-property");
}

#[test]
fn a_cause_is_said_once() {
    let output = greylag(&[
        "evaluate",
        "--controller",
        "pid",
        "--aircraft-dir",
        "nowhere",
        "--aircraft",
        "glider",
    ]);
    let error = String::from_utf8(output.stderr).unwrap();
    // what the system said, without its number
    assert_eq!(error.matches("No such file").count(), 1, "{error}");
}

#[test]
fn targets_outside_their_group_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("targets.csv");
    let path = file.to_str().unwrap();
    for (row, words) in [
        ("easy,80,80", ["row 1", "|roll| < 45"]),
        ("easy,nan,0", ["row 1", "easy"]),
        ("steep,1,1", ["steep", "easy"]),
    ] {
        fs::write(&file, format!("group,roll_deg,pitch_deg\n{row}\n")).unwrap();
        refuses(&["evaluate", "--controller", "pid", "--targets", path], &words);
    }
    fs::write(&file, "group,roll_deg,pitch_deg\neasy, 10, 5\n").unwrap();
    refuses(
        &["evaluate", "--controller", "pid", "--targets", path, "--group", "hard_corners"],
        &["group"],
    );
}

/// Any JSBSim aircraft with the usual property names flies: here the X8, half a kilogram heavier.
#[test]
fn evaluate_flies_another_aircraft() {
    let folder = tempfile::tempdir().unwrap();
    let x8 = Path::new(env!("CARGO_MANIFEST_DIR")).join("sitl/aircraft/x8");
    let heavy = folder.path().join("heavy");
    fs::create_dir(&heavy).unwrap();
    let mut copied = 0;
    for entry in fs::read_dir(&x8).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        if path.is_dir() {
            let engines = heavy.join(&name);
            fs::create_dir(&engines).unwrap();
            for file in fs::read_dir(&path).unwrap().map(|e| e.unwrap().path()) {
                fs::copy(&file, engines.join(file.file_name().unwrap())).unwrap();
            }
            continue;
        }
        let text = fs::read_to_string(&path).unwrap();
        let heavier = text.replace("7.4163504999", "8.5186617");
        copied += usize::from(heavier != text);
        fs::write(heavy.join(name.replace("x8", "heavy")), heavier).unwrap();
    }
    assert_eq!(copied, 1, "the X8's weight no longer reads 7.4163504999 lb");
    let targets = folder.path().join("targets.csv");
    fs::write(&targets, "group,roll_deg,pitch_deg\neasy,20,5\n").unwrap();
    let (dir, targets) = (folder.path().to_str().unwrap(), targets.to_str().unwrap());
    let output = greylag(&[
        "evaluate",
        "--controller",
        "lqi",
        "--targets",
        targets,
        "--aircraft-dir",
        dir,
        "--aircraft",
        "heavy",
    ]);
    let (out, error) =
        (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{error}");
    assert!(out.contains("lqi") && out.contains("easy"), "{out}");
}

#[test]
fn targets_beyond_the_envelope_are_named_and_left() {
    let folder = tempfile::tempdir().unwrap();
    let targets = folder.path().join("targets.csv");
    let line = [
        "evaluate",
        "--controller",
        "lqi",
        "--model",
        "params/aerosonde/jsbsim.toml",
        "--aircraft",
        "aerosonde",
        "--targets",
        targets.to_str().unwrap(),
    ];
    fs::write(&targets, "group,roll_deg,pitch_deg\neasy,20,5\nhard_corners,55,28\n").unwrap();
    let output = greylag(&line);
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && error.contains("1 of 2 targets lie beyond"), "{error}");
    let output = greylag(&[&line[..], &["--beyond-envelope"]].concat());
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && !error.contains("lie beyond"), "{error}");
    fs::write(&targets, "group,roll_deg,pitch_deg\nhard_corners,55,28\n").unwrap();
    refuses(&line, &["all targets", "--beyond-envelope"]);
}

#[test]
fn the_version_says_what_was_built() {
    let said = String::from_utf8(greylag(&["-V"]).stdout).unwrap();
    assert!(said.starts_with("greylag 0.") && said.contains("features: demo, study"), "{said}");
}

#[test]
fn completions_know_the_commands() {
    for shell in ["bash", "zsh", "fish"] {
        let output = greylag(&["completions", shell]);
        assert!(output.status.success(), "{shell}");
        assert!(String::from_utf8_lossy(&output.stdout).contains("workbench"), "{shell}");
    }
}

#[test]
fn manual_pages_are_there_for_every_command() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("man1");
    let written = greylag(&["man", place.to_str().unwrap()]);
    assert!(written.status.success());
    let page = std::fs::read_to_string(place.join("greylag-aircraft-check.1")).unwrap();
    assert!(page.contains("Model of the aircraft"), "{page}");
    assert!(place.join("greylag.1").exists() && place.join("greylag-workbench.1").exists());
}

/// What a command found, as JSON on standard output with nothing else there.
fn json(arguments: &[&str], schema: &str) -> serde_json::Value {
    let output = greylag(&[arguments, &["--json", "-"]].concat());
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    let value: serde_json::Value = serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|e| panic!("{arguments:?}: {e}; {said}"));
    assert_eq!(value["schema"], schema, "{arguments:?}");
    value
}

#[test]
fn commands_say_what_they_found_as_json() {
    let x8 = ["--model", "params/x8/jsbsim.toml"];
    let check = json(&[&["aircraft", "check"], &x8[..]].concat(), "greylag.aircraft-check/1");
    assert!(check["modes"].as_array().unwrap().len() >= 5 && check["loops"][0]["delay"].is_f64());
    let list = json(&["effects", "list"], "greylag.effects/1");
    assert!(list["effects"].as_array().unwrap().iter().any(|e| e["id"] == "lift_stall"));
    let one = json(&["effects", "show", "propwash"], "greylag.effects/1");
    assert_eq!(one["effects"][0]["parameters"][0]["name"], "k");
    let between = ["design", "--between", "drag_beta2", "drag_alpha2"];
    let prior = ["--model", "params/x8/prior.toml"];
    let design = json(&[&between[..], &prior[..]].concat(), "greylag.design/1");
    assert!(design["chosen"].is_string() && !design["manoeuvres"].as_array().unwrap().is_empty());
    let flown = ["faults", "--flights", "1", "--counterpart", "sitl"];
    let faults = json(&[&flown[..], &x8[..]].concat(), "greylag.faults/1");
    assert_eq!(faults["flights"][0]["counterpart"], "sitl");
}

/// Monte Carlo over the widths of a model: the controller is that of the model, what flies is drawn.
#[test]
fn evaluate_flies_models_drawn_from_widths() {
    let folder = tempfile::tempdir().unwrap();
    let targets = folder.path().join("targets.csv");
    std::fs::write(&targets, "group,roll_deg,pitch_deg\neasy,20,5\nhard_corners,50,-26\n").unwrap();
    let line =
        ["evaluate", "--controller", "lqi", "--model", "params/x8/prior.toml", "--draws", "3"];
    let with = [&line[..], &["--targets", targets.to_str().unwrap()]].concat();
    let found = json(&with, "greylag.robustness/1");
    let [lqi] = &found["controllers"].as_array().unwrap()[..] else { panic!("{found}") };
    let draws = lqi["draws"].as_array().unwrap();
    assert_eq!(draws.len(), 3);
    // an LQI has integrals: it settles whatever the coefficients are, at other moments in each draw
    assert!(draws.iter().all(|d| d[0].as_f64().unwrap() < 0.5 && d[1] == 0), "{found}");
    assert!(draws[0] != draws[1] && draws[1] != draws[2], "{found}");
    assert_eq!(lqi["all"]["groups"][0]["count"], 3);
}

#[test]
fn a_reader_that_leaves_is_no_fault() {
    let json = ["effects", "list", "--json", "-"];
    for arguments in [&["effects", "list"][..], &["completions", "bash"], &json] {
        let mut child = Command::new(env!("CARGO_BIN_EXE_greylag"))
            .args(arguments)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success() && said.is_empty(), "{arguments:?}: {said}");
    }
}

/// The reader of both outputs leaves at once, as in `greylag … 2>&1 | head`.
#[test]
fn files_are_written_though_the_reader_leaves() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    csv::save(&fly(1, 25.0, REALISTIC), Path::new(&at("a.csv"))).unwrap();
    for command in ["compare", "diagnose", "amend"] {
        let [json, page, out] = ["json", "html", "out"].map(|end| at(&format!("{command}.{end}")));
        let (result, more) = match command {
            "amend" => {
                let line = ["--tune-only", "--fit-all", "--accept-anyway", "--out", &out];
                (format!("{out}/model.toml"), line.to_vec())
            }
            _ => (json.clone(), vec!["--json", &json[..]]),
        };
        let mut child = Command::new(env!("CARGO_BIN_EXE_greylag"))
            .args([command, "--model", "params/x8/prior.toml", "--log", &at("a.csv")])
            .args(more)
            .args(["--report", &page])
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        drop((child.stdout.take(), child.stderr.take()));
        let status = child.wait().unwrap();
        assert!(matches!(status.code(), Some(0 | 3)), "{command}: {status}");
        for path in [&result, &page] {
            assert!(fs::metadata(path).is_ok_and(|file| file.len() > 0), "{command}: no {path}");
        }
    }
}

/// `/dev/full` refuses what is written to it, as a full disk does.
#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_behind_standard_output_is_said_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    csv::save(&fly(1, 15.0, REALISTIC), &path).unwrap();
    let log = path.to_str().unwrap();
    for arguments in [
        &["effects", "list"][..],
        &["effects", "show", "drag_beta2"],
        &["completions", "bash"],
        &["aircraft", "check", "--model", "params/x8/jsbsim.toml"],
        &["logs", "info", log],
        &["logs", "info", log, "--json"],
        &["effects", "list", "--json", "-"],
    ] {
        let full = fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let output = Command::new(env!("CARGO_BIN_EXE_greylag"))
            .args(arguments)
            .stdout(full)
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {said}");
        let cause =
            "greylag: cannot write to standard output: No space left on device; make room there";
        assert!(said.starts_with(cause) && said.lines().count() == 1, "{arguments:?}: {said}");
    }
}

#[test]
#[cfg(unix)]
fn a_symbolic_link_as_an_output_stays_one() {
    let folder = tempfile::tempdir().unwrap();
    let [target, link] = ["found.json", "link.json"].map(|name| folder.path().join(name));
    fs::write(&target, "of an earlier run").unwrap();
    std::os::unix::fs::symlink("found.json", &link).unwrap();
    let line = ["effects", "show", "drag_beta2", "--force", "--json", link.to_str().unwrap()];
    assert!(greylag(&line).status.success());
    assert!(link.is_symlink() && fs::read_to_string(&target).unwrap().contains("drag_beta2"));
}

/// Each of the long tasks has its own error around the cancellation, and each must be recognised.
#[test]
#[cfg(unix)]
fn ctrl_c_ends_long_tasks_with_status_130_and_nothing_written() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    // long enough that no task ends before the signal comes, on a busy machine too
    csv::save(&fly(1, 90.0, REALISTIC), Path::new(&at("a.csv"))).unwrap();
    fs::create_dir(at("out")).unwrap();
    let (json, out) = (at("out/found.json"), at("out"));
    for task in [
        vec!["compare", "--json", &json],
        vec!["diagnose", "--json", &json],
        vec!["amend", "--tune-only", "--out", &out],
    ] {
        let mut child = Command::new(env!("CARGO_BIN_EXE_greylag"))
            .args(&task)
            .args(["--model", "params/x8/prior.toml", "--log", &at("a.csv")])
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
        // the first line is of the log, which is read before anything can be cancelled
        let stage = lines.find(|line| !line.starts_with("reading and reconstructing")).unwrap();
        let kill = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
        assert!(kill.success(), "{task:?} had ended after {stage:?}");
        let said: Vec<String> = lines.collect();
        assert_eq!(child.wait().unwrap().code(), Some(130), "{task:?}: {said:?}");
        assert!(said.last().is_some_and(|l| l.contains("stopped by Ctrl-C")), "{said:?}");
        assert_eq!(fs::read_dir(&out).unwrap().count(), 0, "{task:?}");
    }
}
