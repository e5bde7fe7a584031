//! `greylag collect` and `greylag train dynamics`, as a user types them: explore, learn, look.

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

fn greylag(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_greylag")).args(arguments).output().unwrap()
}

fn said(output: &Output) -> String {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    text(&output.stdout) + &text(&output.stderr)
}

fn param(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8").join(name);
    path.display().to_string()
}

/// What is wrong in the severe prior.
const WRONG: &str = "lift_linear.CLde,drag_linear.CD0,drag_linear.CDalpha,side_force_linear.CYbeta,\
    roll_linear.Clbeta,roll_linear.Clp,roll_linear.Clda,yaw_linear.Cnp,yaw_linear.Cnr";

#[test]
fn exploring_then_learning_leaves_a_model_that_follows_better() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let collect = ["collect", "--out", &at("flights"), "--episodes", "12"];
    let first = greylag(&collect);
    assert!(first.status.success(), "{}", said(&first));
    // what is there is not flown again
    assert!(said(&greylag(&collect)).contains("0 episodes flown, 12 of 12"));
    let prior = param("prior-severe.toml");
    let (flights, out) = (at("flights"), at("learned"));
    let train = |updates: &str| {
        greylag(&[
            "train",
            "dynamics",
            "--prior",
            &prior,
            "--truth",
            &param("prior.toml"),
            "--collect",
            &flights,
            "--integrator",
            "jsbsim",
            "--trainable",
            WRONG,
            "--hidden",
            "16",
            "--steps",
            "8",
            "--batch",
            "32",
            "--updates",
            updates,
            "--out",
            &out,
        ])
    };
    let learned = train("400");
    assert!(learned.status.success(), "{}", said(&learned));
    let json = std::fs::read_to_string(Path::new(&out).join("training.json")).unwrap();
    let result: Value = serde_json::from_str(&json).unwrap();
    // at ten steps: a small network and a few seconds of learning take off more than half
    let rms = |which: &str| result[which][1]["rms"].as_f64().unwrap();
    assert!(rms("learned") < 0.5 * rms("prior"), "{} of {}", rms("learned"), rms("prior"));
    for c in result["coefficients"].as_array().unwrap() {
        let [value, truth] = ["value", "truth"].map(|k| c[k].as_f64().unwrap());
        let moment = ["roll", "yaw"].iter().any(|k| c["name"].as_str().unwrap().starts_with(k));
        // two minutes of noise-free flight; lift and drag have a stall that the prior has not
        assert!(!moment || (value / truth - 1.0).abs() < 0.05, "{c}");
    }
    let page = std::fs::read_to_string(Path::new(&out).join("training.html")).unwrap();
    assert!(page.contains("Error over the horizon") && page.contains("roll_linear.Clda"));
    // the model goes wherever a model goes
    let model = Path::new(&out).join("model.toml").display().to_string();
    let log = Path::new(&flights).join("round-00/episode-003.csv").display().to_string();
    let compared = greylag(&["compare", "--model", &model, "--log", &log]);
    assert!(compared.status.success(), "{}", said(&compared));
    // with other options it is another training, and what is there stays
    let other = train("500");
    assert!(!other.status.success());
    assert!(said(&other).contains("another --out"), "{}", said(&other));
}

/// A log as people have it: real PX4, 23 samples a second, no vanes, an aircraft described by its geometry.
#[test]
fn a_real_log_of_few_samples_a_second_is_learned_from() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let geometry = ["--mass-kg", "9.5", "--span-m", "4", "--area-m2", "1.499"];
    let motor = ["--static-thrust-n", "35", "--pitch-speed-mps", "20"];
    let new = ["aircraft", "new", &at("dawn"), "--name", "Dawn One"];
    let made = greylag(&[&new[..], &geometry, &motor].concat());
    assert!(made.status.success(), "{}", said(&made));
    let (prior, out) = (at("dawn/model.toml"), at("learned"));
    let log = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/dawn_one/fit.csv");
    let log = log.display().to_string();
    let train = ["train", "dynamics", "--prior", &prior, "--log", &log, "--trainable", "all"];
    let small = ["--hidden", "8", "--batch", "16", "--updates", "40", "--out", &out];
    let learned = greylag(&[&train[..], &small].concat());
    assert!(learned.status.success(), "{}", said(&learned));
    let words = said(&learned);
    assert!(words.contains("23 samples a second") && words.contains("n 200"), "{words}");
    let json = std::fs::read_to_string(Path::new(&out).join("training.json")).unwrap();
    assert!(json.contains("last fifth of each flight"), "{json}");
    // a flight that does not show the damping in roll leaves it an aircraft's, or the model could not be read again
    let model = Path::new(&out).join("model.toml").display().to_string();
    greylag::model::GreyBox::load(Path::new(&model)).unwrap();
}

#[test]
fn what_is_missing_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out").display().to_string();
    let prior = param("prior.toml");
    let nothing = greylag(&["train", "dynamics", "--prior", &prior, "--out", &out]);
    assert!(said(&nothing).contains("give --log or --collect"), "{}", said(&nothing));
    let empty = folder.path().display().to_string();
    let none =
        greylag(&["train", "dynamics", "--prior", &prior, "--collect", &empty, "--out", &out]);
    assert!(said(&none).contains("has no episode"), "{}", said(&none));
    let unplanned = greylag(&["collect", "--out", &out, "--round", "1"]);
    assert!(said(&unplanned).contains("--model"), "{}", said(&unplanned));
}

#[test]
fn the_files_of_the_prior_are_no_outputs() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let (model, own) = (at("model.toml"), folder.path().display().to_string());
    let text = std::fs::read_to_string(param("prior.toml")).unwrap();
    std::fs::write(&model, &text).unwrap();
    std::fs::copy(param("airframe.toml"), at("airframe.toml")).unwrap();
    for line in [
        &["dynamics", "--prior", &model, "--collect", &own, "--out", &own][..],
        &["residual", "--model", &model, "--log", &at("a.csv"), "--out", &own, "--force"],
    ] {
        let refused = greylag(&[&["train"][..], line].concat());
        assert_eq!(refused.status.code(), Some(1), "{line:?}: {}", said(&refused));
        assert!(said(&refused).contains("model.toml is an input"), "{}", said(&refused));
    }
    assert_eq!(std::fs::read_to_string(&model).unwrap(), text);
}

#[test]
fn a_linear_residual_is_written_where_it_helps() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let made = greylag(&["mystery", "--seed", "31", "--out", &at("m")]);
    assert!(made.status.success(), "{}", said(&made));
    let [model, one, two, test] =
        ["model.toml", "train-1.csv", "train-2.csv", "test-1.csv"].map(|f| at(&format!("m/{f}")));
    let train = |model: &str, out: &str| {
        let logs = ["--log", &one, &two, "--hold-out", &test];
        let words = ["train", "residual", "--model", model, "--out", out];
        greylag(&[&words[..], &logs].concat())
    };
    let done = train(&model, &at("r"));
    assert!(done.status.success(), "{}", said(&done));
    let corrected = at("r/model.toml");
    let compared =
        greylag(&["compare", "--model", &model, &corrected, "--log", &test, "--json", "-"]);
    let result: Value = serde_json::from_slice(&compared.stdout).unwrap();
    let error = |k: usize| result["models"][k]["free_run"][1]["rmse_scaled"].as_f64().unwrap();
    assert!(error(1) < 0.99 * error(0), "{} to {}", error(0), error(1));
    // neither a second residual nor a file is replaced
    let again = train(&corrected, &at("s"));
    assert!(said(&again).contains("has a learned residual already"), "{}", said(&again));
    let there = train(&model, &at("r"));
    assert!(!there.status.success() && said(&there).contains("--force"), "{}", said(&there));
}
