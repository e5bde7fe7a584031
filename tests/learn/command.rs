//! `greylag learn`: from a prior that cannot fly to a controller that does, in one command.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use greylag::control::policy::Agent;
use greylag::control::{self, ControllerKind, Source, Target};
use greylag::model::GreyBox;
use greylag::sim::{Episode, Simulator};
use greylag_sitl::plant::PlantOptions;

fn greylag(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_greylag")).args(arguments).output().unwrap()
}

fn said(output: &Output) -> String {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    text(&output.stdout) + &text(&output.stderr)
}

/// What is wrong in the severe prior.
const WRONG: &str = "lift_linear.CLde,drag_linear.CD0,drag_linear.CDalpha,side_force_linear.CYbeta,\
    roll_linear.Clbeta,roll_linear.Clp,roll_linear.Clda,yaw_linear.Cnp,yaw_linear.Cnr";

fn severe() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8/prior-severe.toml")
}

/// Settled error in JSBSim, degrees; 180 if the aircraft is lost or there is no such controller.
fn settled_deg(
    kind: ControllerKind,
    model: &GreyBox,
    agent: Option<&Agent>,
    target: [f64; 2],
) -> f64 {
    let Ok(mut controller) = control::build(kind, Source { model, agent, changes: &[] }) else {
        return 180.0;
    };
    let mut simulator = Simulator::new(&PlantOptions::default()).unwrap();
    let [roll, pitch] = target.map(f64::to_radians);
    let (environment, controller) = (&mut simulator, controller.as_mut());
    let target = Target { roll, pitch, airspeed: 16.67 };
    Episode { environment, controller, seed: 1 }.fly(&target, |_, _| ()).unwrap().settled_deg
}

/// The files that fly, with their bytes.
fn files(folder: &Path) -> Vec<Vec<u8>> {
    ["model.toml", "residual.safetensors", "policy/actor.safetensors", "policy/critic1.safetensors"]
        .map(|name| std::fs::read(folder.join("controller").join(name)).unwrap())
        .into()
}

/// Training to flight, in small: the prior loses the aircraft, what is learned from it holds the attitude.
#[test]
fn a_prior_that_cannot_fly_becomes_a_controller_that_does() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("learned");
    let (prior, text) = (severe(), out.to_str().unwrap().to_owned());
    let line = ["learn", "--prior", prior.to_str().unwrap(), "--collect", "--budget", "quick"];
    let line = [&line[..], &["--trainable", WRONG, "--out", &text]].concat();
    let learned = greylag(&line);
    assert!(learned.status.success(), "{}", said(&learned));
    assert!(said(&learned).contains("planned through that model"), "{}", said(&learned));

    let model = GreyBox::load(&out.join("controller/model.toml")).unwrap();
    assert!(model.description.starts_with("Learned from "), "{}", model.description);
    let agent = Agent::load(&out.join("controller/policy"), &model.airframe).unwrap();
    assert_eq!(agent.origin.model_sha256, model.sha256);
    let bare = GreyBox::load(&severe()).unwrap();
    for target in [[25.0, -5.0], [-30.0, 12.0]] {
        // an aircraft that settles more than 10° off counts as lost
        assert!(settled_deg(ControllerKind::Lqi, &bare, None, target) > 10.0);
        let error = settled_deg(ControllerKind::Lqi, &model, None, target);
        println!("LQI on the learned model, {target:?}: {error:.4}°");
        // measured: 0.001°, as on the exact model
        assert!(error < 0.1, "{target:?}: {error}°");
        let error = settled_deg(ControllerKind::Policy, &model, Some(&agent), target);
        println!("policy of some seconds, {target:?}: {error:.2}°"); // 3° measured
        assert!(error < 10.0, "{target:?}: {error}°");
    }

    // what is done is not done again, and a stage that is done anew gives the same bits
    let before = files(&out);
    std::fs::remove_dir_all(out.join("policy")).unwrap();
    let record = out.join("learn.json");
    let mut done: serde_json::Value =
        serde_json::from_slice(&std::fs::read(&record).unwrap()).unwrap();
    done["stages"].as_array_mut().unwrap().pop();
    std::fs::write(&record, done.to_string()).unwrap();
    let again = greylag(&line);
    assert!(again.status.success(), "{}", said(&again));
    assert_eq!(said(&again).matches("done before").count(), 4, "{}", said(&again));
    assert!(files(&out) == before, "the policy differs");

    let other = greylag(&[&line[..], &["--seed", "2"]].concat());
    assert!(!other.status.success() && said(&other).contains("another --out"), "{}", said(&other));

    goes_on_with_recent_flights(folder.path(), &out);
    assert!(files(&out) == before, "the earlier learning was changed");
}

/// The aircraft changes, its flights show it, and what was learned before is learned on.
fn goes_on_with_recent_flights(folder: &Path, earlier: &Path) {
    let (flights, out) = (folder.join("changed"), folder.join("again"));
    let (flights, out) = (flights.to_str().unwrap(), out.to_str().unwrap());
    let effect = ["mystery", "--seed", "41", "--effect", "aeroelastic_loss", "--out", flights];
    assert!(greylag(&effect).status.success());
    let logs: Vec<String> = (1..4).map(|k| format!("{flights}/train-{k}.csv")).collect();
    let line =
        ["learn", "--continue", earlier.to_str().unwrap(), "--budget", "quick", "--out", out];
    let line: Vec<&str> =
        line.into_iter().chain(["--log"]).chain(logs.iter().map(String::as_str)).collect();
    let learned = greylag(&line);
    assert!(learned.status.success(), "{}", said(&learned));
    for word in ["--recent-share 0.5", "--collect", "--start", "samples of recent flights count"] {
        assert!(said(&learned).contains(word), "no {word} in {}", said(&learned));
    }
    let json = std::fs::read(Path::new(out).join("model/training.json")).unwrap();
    let scores: serde_json::Value = serde_json::from_slice(&json).unwrap();
    // a second ahead, on the ends of the recent flights, which were held out
    let rms = |which: &str| scores[which][2]["rms"].as_f64().unwrap();
    println!("100 steps ahead: {} before, {} after", rms("prior"), rms("learned"));
    assert!(rms("learned") < 0.8 * rms("prior"), "{} of {}", rms("learned"), rms("prior"));
    let model = GreyBox::load(&Path::new(out).join("controller/model.toml")).unwrap();
    let agent = Agent::load(&Path::new(out).join("controller/policy"), &model.airframe).unwrap();
    assert_eq!(agent.origin.model_sha256, model.sha256);
    let again = greylag(&line);
    assert_eq!(said(&again).matches("done before").count(), 2, "{}", said(&again));
    let none = greylag(&[&line[..], &["--recent-share", "0"]].concat());
    assert!(!none.status.success() && said(&none).contains("above 0"), "{}", said(&none));
    let nothing = greylag(
        &[&["learn", "--continue", flights, "--out", out, "--log"], &[logs[0].as_str()][..]]
            .concat(),
    );
    assert!(
        !nothing.status.success() && said(&nothing).contains("greylag learn"),
        "{}",
        said(&nothing)
    );
}

#[test]
fn what_cannot_be_learned_is_said_before_anything_is_flown() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let (prior, out) = (severe(), out.to_str().unwrap().to_owned());
    let refused = |rest: &[&str], word: &str| {
        let line = ["learn", "--prior", prior.to_str().unwrap(), "--out", &out];
        let output = greylag(&[&line[..], rest].concat());
        assert!(!output.status.success() && said(&output).contains(word), "{}", said(&output));
    };
    refused(&[], "--collect");
    refused(&["--collect", "--log", "a.csv"], "cannot be used with");
    refused(&["--log", "a.csv", "--rounds", "2"], "cannot be used with");
    refused(&["--log", "a.csv", "--recent-share", "0.5"], "cannot be used with");
    refused(&["--collect", "--hide", "nothing=1"], "nothing");
    refused(&["--collect", "--trainable", "roll_linear.Clx"], "roll_linear.Clda");
    assert!(!Path::new(&out).exists());
}
