//! Policies on the command line: what cannot be used is said, by name.

#[cfg(feature = "learn")]
use std::path::Path;
use std::process::{Command, Output};

fn greylag(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_greylag")).args(arguments).output().unwrap()
}

/// The run fails and says each of `words`.
fn refused(arguments: &[&str], words: &[&str]) {
    let output = greylag(arguments);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success(), "{arguments:?} succeeded");
    for word in words {
        assert!(said.contains(word), "{arguments:?} said {said:?}, not {word:?}");
    }
}

#[test]
fn a_policy_that_is_not_there_or_is_none_is_named() {
    let evaluate = ["evaluate", "--controller", "policy", "--policy"];
    refused(&[&evaluate[..], &["nowhere"]].concat(), &["cannot read policy nowhere", "actor"]);
    let folder = tempfile::tempdir().unwrap();
    for name in ["actor", "critic1", "critic2"] {
        std::fs::write(folder.path().join(format!("{name}.safetensors")), b"no weights").unwrap();
    }
    let path = folder.path().to_str().unwrap();
    refused(&[&evaluate[..], &[path]].concat(), &["actor.safetensors", "train it again"]);
    refused(&["fly", "--controller", "policy", "--policy", path], &["actor.safetensors"]);
}

#[cfg(feature = "learn")]
#[test]
fn a_training_that_cannot_be_is_refused_before_it_starts() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("policy");
    let train = |environment: &str, rest: &[&str], words: &[&str]| {
        let out = out.to_str().unwrap();
        let start = ["train", "policy", "--env", environment, "--out", out];
        refused(&[&start[..], rest].concat(), words);
    };
    train("model", &[], &["model:DIR", "jsbsim"]);
    train("model:nowhere.toml", &[], &["nowhere.toml"]);
    let model = "model:params/x8/jsbsim.toml";
    train(model, &["--discount", "1"], &["--discount"]);
    train(model, &["--rate=-1"], &["--rate", "not negative"]);
    train(model, &["--actor", "4096"], &["4096"]);
    train("jsbsim", &["--algorithm", "analytic"], &["no slopes"]);
    assert!(!out.join("actor.safetensors").exists());
}

#[cfg(feature = "learn")]
#[test]
fn a_short_training_leaves_a_policy_that_flies_and_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("policy");
    let out = out.to_str().unwrap();
    let train = [
        "train",
        "policy",
        "--env",
        "model:params/x8/jsbsim.toml",
        "--out",
        out,
        "--steps",
        "3000",
        "--warmup",
        "1000",
        "--replay",
        "3000",
        "--actor",
        "8",
        "--critic",
        "8",
        "--batch",
        "16",
        "--evaluate",
        "1000",
        "--checkpoint",
        "1500",
        "--instances",
        "16",
    ];
    let first = greylag(&train);
    assert!(first.status.success(), "{}", String::from_utf8_lossy(&first.stderr));
    let curve = std::fs::read_to_string(Path::new(out).join("curve.csv")).unwrap();
    assert!(curve.lines().count() >= 4, "{curve}");
    let again = greylag(&train);
    let said = String::from_utf8_lossy(&again.stderr).into_owned();
    assert!(again.status.success() && said.contains("going on after 3008 steps"), "{said}");
    let mut other = train.to_vec();
    *other.iter_mut().find(|a| **a == "8").unwrap() = "9";
    refused(&other, &["another training"]);
    let page = Path::new(out).join("policy.html");
    assert!(std::fs::read_to_string(page).unwrap().contains("Settled error, easy targets"));
    let curves = greylag(&["train", "curves", out, out]);
    let said = String::from_utf8_lossy(&curves.stdout).into_owned();
    assert!(curves.status.success() && said.matches("3008").count() >= 2, "{said}");
    refused(&["train", "curves", folder.path().to_str().unwrap()], &["curve.csv", "--out"]);
    let flown =
        greylag(&["evaluate", "--controller", "policy", "--policy", out, "--group", "easy"]);
    assert!(flown.status.success() && String::from_utf8_lossy(&flown.stdout).contains("policy"));
}
