//! A shipped aircraft as a user flies and studies it: the program's commands, one after the other.
#![allow(dead_code)] // each test file uses its part

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use greylag::logs::csv::{self, Tolerance};
use greylag::model::jsbsim::Exported;
use serde_json::Value;

/// An aircraft of the simulator with a model that flies as it does.
#[derive(Clone, Copy)]
pub struct Aircraft {
    /// Its name in the simulator.
    pub name: &'static str,
    /// The folder of its files below `params/`.
    pub folder: &'static str,
    /// An airspeed at which it flies, m/s.
    pub airspeed_mps: f64,
}

/// The simulator's files of the aircraft `name` are what `aircraft export jsbsim` makes of its models.
pub fn shipped_as_exported(exported: &Exported, name: &str) {
    assert_eq!(exported.left_out, Vec::<String>::new());
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("sitl/aircraft").join(name);
    for (path, text) in &exported.files {
        let shipped = folder.join(path);
        if std::env::var_os("GREYLAG_WRITE_DOCS").is_some() {
            fs::create_dir_all(shipped.parent().unwrap()).unwrap();
            fs::write(&shipped, text).unwrap();
        }
        let shipped = fs::read_to_string(shipped).unwrap();
        assert!(shipped == *text, "{path}: write it anew with GREYLAG_WRITE_DOCS=1");
    }
}

/// The program with `arguments` and those that name the aircraft and its model.
fn run(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_greylag")).args(arguments).output().unwrap()
}

/// What a run that must succeed prints; 3 is done with a doubt about a log.
fn says(arguments: &[&str]) -> String {
    let output = run(arguments);
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(matches!(output.status.code(), Some(0 | 3)), "{arguments:?}: {error}");
    String::from_utf8(output.stdout).unwrap()
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

impl Aircraft {
    /// A file of its folder.
    pub fn file(&self, name: &str) -> String {
        format!("params/{}/{name}", self.folder)
    }

    /// `greylag demo`, 8 s towards one attitude (degrees) by the LQI: the recorded attitude is the commanded one at the end.
    pub fn is_flown_by_demo(&self, [roll_deg, pitch_deg]: [f64; 2]) {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
        let airspeed = self.airspeed_mps;
        let schedule = format!(
            "schema = 1\nname = \"turn\"\ndescription = \"One attitude.\"\n[[step]]\nduration_s = 8.0\nroll_deg = {roll_deg:?}\n\
             pitch_deg = {pitch_deg:?}\nairspeed_mps = {airspeed:?}\n"
        );
        fs::write(at("turn.toml"), schedule).unwrap();
        let (turn, out, model) = (at("turn.toml"), at("flight"), self.file("jsbsim.toml"));
        let flown = ["demo", "--controller", "lqi", "--schedule", &turn, "--out", &out];
        says(&[&flown[..], &["--aircraft", self.name, "--model", &model]].concat());
        let log = csv::load(&folder.path().join("flight/flight.csv"), Tolerance::Strict).unwrap();
        let rows = &log.flight.samples;
        let near = |k: usize| {
            let [roll, pitch, _] = rows[k].attitude_rad.map(f64::to_degrees);
            (roll - roll_deg).abs().max((pitch - pitch_deg).abs()) < 0.5
        };
        let longest = (0..rows.len()).fold((0, 0), |(longest, now): (usize, usize), k| {
            let now = if near(k) { now + 1 } else { 0 };
            (longest.max(now), now)
        });
        assert!(longest.0 > 200, "{}: within 0.5 deg for {} steps", self.name, longest.0);
    }

    /// `greylag evaluate`: the largest settled error (degrees) of the LQI of `model` on the rows GROUP,ROLL,PITCH.
    pub fn settled_error_deg(&self, model: &str, rows: &str) -> f64 {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
        let (targets, out, model) = (at("targets.csv"), at("scores.json"), self.file(model));
        fs::write(&targets, format!("group,roll_deg,pitch_deg\n{rows}")).unwrap();
        let flown = ["evaluate", "--controller", "lqi", "--targets", &targets, "--json", &out];
        says(&[&flown[..], &["--aircraft", self.name, "--model", &model]].concat());
        let scores = json(Path::new(&out));
        let all = scores["controllers"][0]["groups"].as_array().unwrap().last().unwrap().clone();
        assert_eq!(all["divergence_rate"], 0.0, "{all}");
        all["max_deg"].as_f64().unwrap()
    }

    /// The study: `effect` is hidden, the diagnosis asserts it and nothing else, and it is added to the model. On flights that
    /// nothing was fitted to, the error of free runs of 5 s falls below a fifth.
    pub fn effect_is_found_and_added(&self, effect: &str, seed: &str) {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("m");
        let at = |name: &str| out.join(name).to_str().unwrap().to_owned();
        let reference = self.file("jsbsim.toml");
        let hidden = ["mystery", "--seed", seed, "--effect", effect, "--model", &reference];
        says(&[&hidden[..], &["--aircraft", self.name, "--out", out.to_str().unwrap()]].concat());
        let (model, found) = (at("model.toml"), at("diagnosis.json"));
        let train = ["train-1.csv", "train-2.csv", "train-3.csv"].map(at);
        let train = train.each_ref().map(String::as_str);
        says(&[&["diagnose", "--model", &model, "--json", &found, "--log"], &train[..]].concat());
        let said = json(Path::new(&found));
        let effects = said["effects"].as_array().unwrap();
        let asserted: Vec<&Value> =
            effects.iter().filter(|e| e["asserted"] == true).map(|e| &e["id"]).collect();
        assert_eq!(asserted, [effect], "{}: {}", self.name, said["sentences"]);
        let (amended, compared) = (at("amended"), at("compared.json"));
        let adding =
            ["amend", "--model", &model, "--diagnosis", &found, "--out", &amended, "--log"];
        says(&[&adding[..], &train[..]].concat());
        let (better, unseen) = (at("amended/model.toml"), ["test-1.csv", "test-2.csv"].map(at));
        let comparing = ["compare", "--model", &model, &better, "--json", &compared, "--log"];
        says(&[&comparing[..], &unseen.each_ref().map(String::as_str)[..]].concat());
        let [given, amended] = unseen_errors(&json(Path::new(&compared)));
        println!("{} {effect}: {given} to {amended} of x_c on flights not fitted", self.name);
        assert!(amended < 0.2 * given, "{given} to {amended}");
    }
}

/// The error of free runs of 5 s of the two models of a comparison, in parts of x_c.
fn unseen_errors(compared: &Value) -> [f64; 2] {
    [0, 1].map(|k| {
        let runs = compared["models"][k]["free_run"].as_array().unwrap();
        let of_5s = runs.iter().find(|run| run["horizon_s"] == 5.0).unwrap();
        of_5s["rmse_scaled"].as_f64().unwrap()
    })
}
