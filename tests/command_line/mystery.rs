//! `greylag mystery` and `greylag design` as a user runs them, and a designed schedule flown.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use greylag::logs::csv::{self, Tolerance};
use greylag::manoeuvres::Schedule;
use greylag::model::GreyBox;

fn greylag(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_greylag")).args(arguments).output().unwrap()
}

/// What a run that must succeed prints.
fn says(arguments: &[&str]) -> String {
    let output = greylag(arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// What a run that must fail says, once; progress may stand before it.
fn refuses(arguments: &[&str], words: &[&str]) {
    let output = greylag(arguments);
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(!output.status.success(), "{arguments:?} succeeded");
    words.iter().for_each(|w| assert!(error.contains(w), "{error:?} lacks {w:?}"));
    let errors = error.lines().filter(|l| l.starts_with("greylag: ")).count();
    assert!(errors == 1 || error.contains("--help"), "{error}");
}

#[test]
fn a_mystery_is_made_kept_and_opened() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("mystery");
    let dir = out.to_str().unwrap();
    let arguments = ["mystery", "--seed", "4", "--out", dir, "--effect", "pitch_break"];
    says(&arguments);
    let mut names: Vec<_> = fs::read_dir(&out)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    let files = [
        "README.txt",
        "airframe.toml",
        "answer.sealed",
        "model.toml",
        "test-1.csv",
        "test-2.csv",
        "train-1.csv",
        "train-2.csv",
        "train-3.csv",
    ];
    assert_eq!(names, files);
    // nothing but the sealed answer knows, and that is not read by accident
    for name in files.iter().filter(|name| !name.ends_with("csv")) {
        let text = fs::read_to_string(out.join(name)).unwrap();
        assert!(!text.contains("pitch_break"), "{name} tells");
    }
    let log = csv::load(&out.join("train-2.csv"), Tolerance::Strict).unwrap();
    assert_eq!((log.flight.samples.len(), log.dropped), (5000, 0));
    coefficients_are_wrong(&out.join("model.toml"));
    // a slip does not end the game
    refuses(&["mystery", "--open", dir], &["--give-up"]);
    assert!(says(&["mystery", "--open", dir, "--give-up"]).contains("pitch_break = -"));
    refuses(&arguments, &["mystery exists"]);

    // beside a diagnosis, parameters by name
    let said = r#"{"verdict":"effect","effects":[{"id":"cg_shift","asserted":false},{"id":"pitch_break","asserted":true,
        "indistinguishable_from":["cg_shift"],"parameters":[{"name":"Cmalpha3","value":-2.5,"ci95":[-3.0,-2.0]}]}]}"#;
    fs::write(out.join("diagnosis.json"), said).unwrap();
    let told = says(&["mystery", "--open", dir]);
    for words in
        ["verdict effect, asserts pitch_break", "ranked 2 of 2", "from cg_shift", "-2.5000"]
    {
        assert!(told.contains(words), "{told}");
    }
    fs::write(out.join("diagnosis.json"), "{").unwrap();
    refuses(&["mystery", "--open", dir], &["diagnosis.json", "not a diagnosis"]);
    fs::write(out.join("answer.sealed"), "00ff").unwrap();
    refuses(&["mystery", "--open", dir], &["answer.sealed", "holds no answer"]);
}

/// Every coefficient that is not zero is off by up to 30 %, and not all by the same.
fn coefficients_are_wrong(path: &Path) {
    let reference = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8/jsbsim.toml");
    let (wrong, right) = (GreyBox::load(path).unwrap(), GreyBox::load(&reference).unwrap());
    let mut shares = Vec::new();
    for c in right.coefficients().iter().filter(|c| c.value != 0.0) {
        let other = wrong.coefficients().iter().find(|o| o.name == c.name).unwrap();
        shares.push(other.value / c.value - 1.0);
    }
    // twice the 15 % is the most; 30 draws have a standard deviation of 15 ± 4 %, less what is cut off
    let rms = (shares.iter().map(|s| s * s).sum::<f64>() / shares.len() as f64).sqrt();
    assert!(
        shares.iter().all(|s| s.abs() < 0.301) && (0.08..0.2).contains(&rms),
        "{rms}: {shares:?}"
    );
}

/// Another aircraft by its reference model: what the model of the folder lacks, and at which airspeeds is flown.
#[test]
fn a_mystery_of_another_aircraft_is_flown_at_its_airspeeds_with_its_rudder() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("mystery");
    let reference = "params/aerosonde/jsbsim.toml";
    let dir = out.to_str().unwrap();
    let own =
        ["mystery", "--seed", "4", "--out", dir, "--effect", "rudder_linear", "--model", reference];
    refuses(&own, &["model of Aerosonde", "--aircraft"]);
    says(&[&own[..], &["--aircraft", "aerosonde"]].concat());
    let model = GreyBox::load(&out.join("model.toml")).unwrap();
    assert!(!model.has_rudder() && model.airframe.actuators.rudder.is_some());
    let log = csv::load(&out.join("train-2.csv"), Tolerance::Strict).unwrap().flight;
    let mean = |of: fn(&greylag::logs::Sample) -> f64| {
        log.samples.iter().map(of).sum::<f64>() / log.samples.len() as f64
    };
    // the X8 flies these flights about 20 m/s, the Aerosonde cruises at 25
    assert!((20.0..32.0).contains(&mean(|s| s.airspeed_mps)), "{}", mean(|s| s.airspeed_mps));
    assert!(mean(|s| s.rudder_cmd * s.rudder_cmd).sqrt() > 0.05);
    assert!(says(&["mystery", "--open", dir, "--give-up"]).contains("rudder_linear"));
}

#[test]
fn what_cannot_be_hidden_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("mystery");
    let dir = out.to_str().unwrap();
    refuses(
        &["mystery", "--seed", "1", "--out", dir, "--effect", "flutter"],
        &["flutter", "dead_zone"],
    );
    let heavy =
        ["mystery", "--seed", "1", "--out", dir, "--effect", "mass_error", "--amplitude", "50"];
    refuses(&heavy, &["mass_error", "50"]);
    refuses(&["mystery", "--seed", "1"], &["--out"]);
    refuses(&["mystery", "--seed", "1", "--out", "nodir/x/y"], &["nodir/x/y", "exists"]);
    refuses(&["mystery", "--open", "nodir"], &["nodir", "greylag mystery"]);
    assert!(
        fs::read_dir(folder.path()).unwrap().next().is_none(),
        "a refused mystery left something"
    );
}

#[test]
fn a_design_names_its_manoeuvre_and_writes_it() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("next.toml");
    let out = file.to_str().unwrap();
    let model = "params/x8/jsbsim.toml";
    let between = ["design", "--model", model, "--between", "propwash", "aeroelastic_loss"];
    let told = says(&[&between[..], &["--out", out]].concat());
    // fast-multisine keeps speed and throttle where they are: it cannot tell the two apart, and both
    // are told by what changes throttle or speed
    let place = |name: &str| told.lines().position(|l| l.contains(name)).unwrap();
    for better in ["throttle-with-surfaces", "level-acceleration", "roll-at-two-alphas"] {
        assert!(place(better) < place("fast-multisine"), "{told}");
    }
    let schedule = Schedule::load(&file).unwrap();
    assert!(told.contains(&format!("{}: ", schedule.name)), "{told}");
    refuses(&[&between[..], &["--out", out]].concat(), &["next.toml", "--force"]);
    refuses(&["design", "--model", model, "--between", "propwash", "propwash"], &["itself"]);
    refuses(
        &["design", "--model", model, "--between", "propwash", "flutter"],
        &["flutter", "list"],
    );
    let small = "propwash=0.0000001";
    let hopeless = [&between[..], &["--values", small]].concat();
    refuses(&hopeless, &["no built-in manoeuvre", "--values"]);
    refuses(&["demo", "--schedule", "none.toml"], &["none.toml"]);
}
