//! Mistakes that a user makes: each is answered in three lines at most with what helps, with the right status, and
//! nothing that was there is lost.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use crate::compare_support::{REALISTIC, fly};
use greylag::logs::csv;

/// A command line with `@` for the folder of the files, the status, and what its answer must say.
type Mistake = (&'static str, i32, &'static [&'static str]);

/// Clap's own, status 2: the command line is wrong and nothing is done.
const LINE: [Mistake; 14] = [
    ("compare --modle @/model.toml --log @/good.csv", 2, &["--modle", "--model"]),
    ("diagnos --model @/model.toml --log @/good.csv", 2, &["diagnos", "diagnose"]),
    ("compare --model @/model.toml", 2, &["--log"]),
    ("compare --log @/good.csv", 2, &["--model"]),
    ("compare --model @/model.toml --log @/good.csv --horizon five", 2, &["five", "--horizon"]),
    ("amend --model @/model.toml --log @/good.csv --out @/new", 2, &["--accept", "--tune-only"]),
    ("amend --model @/model.toml --log @/good.csv --tune-only", 2, &["--out"]),
    ("diagnose --model @/model.toml --log @/good.csv --nulls 3", 2, &["3", "--nulls", "20.."]),
    ("diagnose --model @/model.toml --log @/good.csv --nulls -3", 2, &["-3", "--nulls"]),
    ("mystery --seed -1 --out @/new", 2, &["-1", "--seed"]),
    ("aircraft new @/new --mass-kg 2.1 --span-m 1.6", 2, &["--area-m2"]),
    ("aircraft new @/new --mass-kg two --span-m 1.6 --area-m2 0.3", 2, &["two", "--mass-kg"]),
    ("faults --monitor 1 --counterpart px4", 2, &["--monitor", "--counterpart"]),
    ("faults --scenario @/good.csv --counterpart px4", 2, &["--scenario", "--counterpart"]),
];

const FILES: [Mistake; 22] = [
    ("compare --model @/none.toml --log @/good.csv", 1, &["none.toml"]),
    ("compare --model @/model.toml --log @/gone.csv", 1, &["gone.csv", "check the path"]),
    ("compare --model @/model.toml --log @/picture.csv", 1, &["no flight log"]),
    ("compare --model @/model.toml --log @/empty.csv", 1, &["is empty"]),
    ("compare --model @/model.toml --log @/no-airspeed.csv", 1, &["airspeed"]),
    ("compare --model @/model.toml --log @", 1, &["it is a folder"]),
    ("compare --model @/good.csv --log @/model.toml", 1, &["good.csv is a flight log", "swapped"]),
    (
        "compare --model @/model.toml --log @/model.toml",
        1,
        &["model.toml is a .toml file", "swapped"],
    ),
    ("diagnose --model @/good.csv --log @/model.toml", 1, &["is a flight log", "swapped"]),
    (
        "amend --model @/good.csv --log @/model.toml --tune-only --out @/new",
        1,
        &["is a flight log"],
    ),
    ("propose --model @/good.csv --log @/good.csv @/other.csv", 1, &["is a flight log"]),
    ("aircraft check --model @/good.csv", 1, &["is a flight log", ".toml"]),
    ("compare --model @/typo.toml --log @/good.csv", 1, &["typo.toml", "line"]),
    ("compare --model @/alone/model.toml --log @/good.csv", 1, &["airframe.toml"]),
    (
        "compare --model @/model.toml --log @/good.csv --mapping @/none.toml",
        1,
        &["none.toml: No such file or directory; check the path\n"],
    ),
    ("compare --model @/model.toml --log @/good.csv --mapping @/picture.csv", 1, &["picture.csv"]),
    ("logs info @/gone.csv", 1, &["gone.csv", "check the path"]),
    ("logs info @/picture.csv", 1, &["no flight log"]),
    (
        "logs info @/good.csv --write-mapping @/new.toml",
        1,
        &["no factor", "no mapping was written"],
    ),
    ("workbench --dir @/session", 1, &["needs a model", "greylag workbench --model"]),
    ("faults --monitor 1 --controller lqi pid-retuned", 1, &["one controller", "--controller"]),
    (
        "faults --scenario @/good.csv --controller lqi pid-retuned",
        1,
        &["one controller", "--controller"],
    ),
];

const KEPT: [Mistake; 23] = [
    (
        "compare --model @/model.toml --log @/good.csv --json @/there.json",
        1,
        &["there.json", "--force"],
    ),
    (
        "compare --model @/model.toml --log @/good.csv --json @/nowhere/x.json",
        1,
        &["folder that exists"],
    ),
    ("compare --model @/model.toml --log @/good.csv --report @", 1, &["exists"]),
    (
        "amend --model @/model.toml --log @/good.csv --tune-only --out @",
        1,
        &["model.toml", "another folder"],
    ),
    ("compare --model @/model.toml --log @/good.csv @/good.csv", 1, &["same flight", "once"]),
    (
        "amend --model @/model.toml --log @/good.csv @/good.csv --tune-only --out @/new",
        1,
        &["same flight", "once"],
    ),
    (
        "amend --model @/model.toml --log @/good.csv --hold-out @/good.csv --tune-only --out @/new",
        1,
        &["held out", "one place"],
    ),
    ("logs convert @/good.csv @/there.json", 1, &["there.json", "--force"]),
    ("logs convert @/good.csv @/good.csv --force", 1, &["good.csv is an input"]),
    (
        "logs reconstruct @/good.csv @/airframe.toml --model @/model.toml --force",
        1,
        &["airframe.toml is an input"],
    ),
    (
        "diagnose --model @/model.toml --log @/good.csv --json @/model.toml --force",
        1,
        &["model.toml is an input"],
    ),
    (
        "propose --model @/model.toml --log @/good.csv @/other.csv --out @/x.toml --json @/x.toml",
        1,
        &["two outputs"],
    ),
    (
        "amend --model @/model.toml --log @/good.csv --tune-only --out @ --force",
        1,
        &["model.toml is an input", "another folder"],
    ),
    (
        "amend --model @/model.toml --log @/good.csv --tune-only --out @/new --report @/new/model.toml",
        1,
        &["two outputs"],
    ),
    (
        "evaluate --controller lqi --model @/model.toml --report @/model.toml --force",
        1,
        &["model.toml is an input"],
    ),
    (
        "compare --model @/with-effect.toml --log @/good.csv --json @/own.toml --force",
        1,
        &["own.toml is an input"],
    ),
    (
        "diagnose --model @/with-effect.toml --log @/good.csv --report @/effects/other.toml --force",
        1,
        &["other.toml is an input"],
    ),
    (
        "compare --model @/model.toml @/story/model.toml --log @/good.csv --json @/story/amend.json --force",
        1,
        &["amend.json is an input"],
    ),
    (
        "evaluate --controller policy --policy @/policy --json @/policy/actor.safetensors --force",
        1,
        &["actor.safetensors is an input"],
    ),
    (
        "evaluate --controller lqi --aircraft plane --aircraft-dir @ --report @/plane/plane.xml --force",
        1,
        &["plane.xml is an input"],
    ),
    (
        "campaign report @/campaign.toml --report @/campaign.toml --force",
        1,
        &["campaign.toml is an input"],
    ),
    ("aircraft new @ --mass-kg 2.1 --span-m 1.6 --area-m2 0.3", 1, &["exists"]),
    ("mystery --seed 3 --out @", 1, &["exists", "another folder"]),
];

const NUMBERS: [Mistake; 12] = [
    (
        "aircraft new @/new --mass-kg 2100 --span-m 1.6 --area-m2 0.3",
        1,
        &["7000 kg/m²", "did you mean --mass-kg 2.1"],
    ),
    (
        "aircraft new @/new --mass-kg 2.1 --span-m 1.6 --area-m2 30",
        1,
        &["did you mean --area-m2 0.3"],
    ),
    (
        "aircraft new @/new --mass-kg 2.1 --span-m 160 --area-m2 0.3",
        1,
        &["--span-m = 160 is not physical"],
    ),
    (
        "aircraft new @/new --mass-kg 2.1 --span-m 1600 --area-m2 0.3",
        1,
        &["--span-m = 1600 is not physical"],
    ),
    (
        "aircraft new @/new --mass-kg -2 --span-m 1.6 --area-m2 0.3",
        1,
        &["--mass-kg = -2", "above 0"],
    ),
    ("aircraft new @/new --mass-kg 0 --span-m 1.6 --area-m2 0.3", 1, &["--mass-kg = 0", "above 0"]),
    ("aircraft new @/new --mass-kg nan --span-m 1.6 --area-m2 0.3", 1, &["--mass-kg = NaN"]),
    (
        "aircraft new @/new --mass-kg 2.1 --span-m 1.6 --area-m2 0.3 --static-thrust-n 0.5",
        1,
        &["--static-thrust-n 0.5", "1 kg of thrust is 9.81 N"],
    ),
    (
        "aircraft new @/new --mass-kg 2.1 --span-m 1.6 --area-m2 0.3 --pitch-speed-mps 900",
        1,
        &["--pitch-speed-mps 900", "check its unit"],
    ),
    (
        "aircraft new @/new --mass-kg 2.1 --span-m 1.6 --area-m2 0.3 --travel-deg 1000",
        1,
        &["--travel-deg = 1000"],
    ),
    ("compare --model @/model.toml --log @/good.csv --horizon -1", 1, &["-1"]),
    (
        "compare --model @/model.toml --log @/degrees.csv",
        1,
        &["--write-mapping mapping.toml", "--mapping mapping.toml"],
    ),
];

const WORDS: [Mistake; 8] = [
    (
        "amend --model @/model.toml --log @/good.csv --effect flubber --out @/new",
        1,
        &["flubber", "effects list"],
    ),
    ("effects show drag_beta", 1, &["drag_beta2", "effects list"]),
    ("mystery --seed 3 --out @/another --effect flubber", 1, &["flubber", "drag_beta2"]),
    ("mystery --seed 3 --out /proc/x", 1, &["/proc", "--out"]),
    ("mystery --open @", 1, &["greylag mystery"]),
    ("mystery --open @/mystery", 1, &["--give-up", "greylag diagnose --model"]),
    ("replay @/nowhere", 1, &["nowhere"]),
    ("propose --model @/model.toml --log @/good.csv", 1, &["--hold-out"]),
];

/// The files that the mistakes are made with.
fn files(folder: &Path) {
    let at = |name: &str| folder.join(name);
    let flight = fly(3, 15.0, REALISTIC);
    csv::save(&flight, &at("good.csv")).unwrap();
    csv::save(&fly(4, 15.0, REALISTIC), &at("other.csv")).unwrap();
    let mut degrees = flight.clone();
    for s in &mut degrees.samples {
        for angle in s.attitude_rad.iter_mut().chain(&mut s.rates_radps) {
            *angle = angle.to_degrees();
        }
    }
    csv::save(&degrees, &at("degrees.csv")).unwrap();
    let mut milliseconds = flight.clone();
    milliseconds.samples.iter_mut().for_each(|s| s.time_s *= 1e3);
    csv::save(&milliseconds, &at("milliseconds.csv")).unwrap();
    let mut kmh = flight.clone();
    kmh.samples.iter_mut().for_each(|s| s.airspeed_mps *= 3.6);
    csv::save(&kmh, &at("kmh.csv")).unwrap();
    let mut short = flight.clone();
    short.samples.truncate(50);
    csv::save(&short, &at("short.csv")).unwrap();
    let text = fs::read_to_string(at("good.csv")).unwrap();
    fs::write(at("no-header.csv"), text.split_once('\n').unwrap().1).unwrap();
    fs::write(at("semicolons.csv"), text.replace(',', ";")).unwrap();
    fs::write(at("no-airspeed.csv"), text.replacen("airspeed_mps", "speed", 1)).unwrap();
    fs::write(at("picture.csv"), [b"\x89PNG\r\n".as_slice(), &[7; 500]].concat()).unwrap();
    fs::write(at("empty.csv"), "").unwrap();
    fs::write(at("there.json"), "mine").unwrap();
    let model = fs::read_to_string("params/x8/prior.toml").unwrap();
    fs::write(at("typo.toml"), model.replacen("schema = 1", "schema == 1", 1)).unwrap();
    fs::write(at("model.toml"), &model).unwrap();
    fs::copy("params/x8/airframe.toml", at("airframe.toml")).unwrap();
    let effects = "schema = 1\neffect_files = [\"own.toml\", \"effects\"]";
    fs::write(at("with-effect.toml"), model.replacen("schema = 1", effects, 1)).unwrap();
    for name in ["alone", "effects", "story", "policy", "plane"] {
        fs::create_dir(at(name)).unwrap();
    }
    fs::write(at("alone/model.toml"), &model).unwrap();
    fs::write(at("story/model.toml"), &model).unwrap();
    let mine = [
        "own.toml",
        "effects/other.toml",
        "story/amend.json",
        "policy/actor.safetensors",
        "plane/plane.xml",
        "campaign.toml",
    ];
    for name in mine {
        fs::write(at(name), "mine").unwrap();
    }
    fs::create_dir(at("mystery")).unwrap();
    fs::write(at("mystery/answer.sealed"), "7b7d").unwrap();
}

/// Every file below `folder` with its content.
fn content(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut all = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            match path.is_dir() {
                true => folders.push(path),
                false => drop(all.insert(path.display().to_string(), fs::read(&path).unwrap())),
            }
        }
    }
    // a session that was begun is none yet, but it has its lock
    all.retain(|path, _| !path.contains("/session/"));
    all
}

fn run(line: &str, folder: &Path) -> Output {
    let words = line.split(' ').map(|word| word.replace('@', &folder.display().to_string()));
    Command::new(env!("CARGO_BIN_EXE_greylag"))
        .args(words)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .env_remove("GREYLAG_MODEL")
        .output()
        .unwrap()
}

/// What of standard error is the answer: progress and clap's usage are not.
fn answer(output: &Output) -> String {
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    let other = ["log ", "Usage:", "For more information", "  -", "      "];
    let is_answer = |l: &&str| ["greylag:", "error:"].iter().any(|o| l.starts_with(o));
    let before = text.lines().position(|l| is_answer(&l)).unwrap_or(0);
    let said = text.lines().skip(before);
    let said = said.filter(|l| !l.trim().is_empty() && !other.iter().any(|o| l.starts_with(o)));
    said.collect::<Vec<_>>().join("\n")
}

fn check(mistakes: &[Mistake]) {
    let scratch = tempfile::Builder::new().prefix("mistakes").tempdir().unwrap();
    let folder = scratch.path();
    files(folder);
    let before = content(folder);
    let mut wrong = Vec::new();
    for (line, status, words) in mistakes {
        let output = run(line, folder);
        let said = answer(&output);
        let whole = String::from_utf8_lossy(&output.stderr).into_owned();
        let lacks: Vec<_> = words.iter().filter(|w| !whole.contains(**w)).collect();
        if output.status.code() != Some(*status) || !lacks.is_empty() {
            wrong.push(format!(
                "{line}: status {:?}, lacks {lacks:?} in: {said}",
                output.status.code()
            ));
        }
        if said.lines().count() > 3 || said.lines().any(|l| l.chars().count() > 700) {
            wrong.push(format!("{line}: more than three lines: {said}"));
        }
        // a cause is said once, and no name of a temporary file is shown
        let temporary = [".greylag-", ".mystery", ".tmp", "os error"];
        if said.matches("No such file").count() > 1 || temporary.iter().any(|t| said.contains(t)) {
            wrong.push(format!("{line}: says it twice, or what nobody knows: {said}"));
        }
        if content(folder) != before {
            wrong.push(format!("{line}: files were changed"));
        }
        if fs::remove_dir(folder.join("new")).is_ok() {
            wrong.push(format!("{line}: an empty folder stays behind"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Mistakes with logs and places that a first look at the list of a first hour does not have.
const MORE: [Mistake; 23] = [
    (
        "logs info @/good.csv @/milliseconds.csv --write-mapping @/new.toml",
        1,
        &["different corrections of time_s", "good.csv none", "logs convert"],
    ),
    ("report @/nowhere", 1, &["there is no folder", "nowhere"]),
    (
        "workbench --model @/model.toml --dir @/session @/gone.csv",
        1,
        &["gone.csv: No such file or directory; check the path\n"],
    ),
    ("diagnose --model @/model.toml --log @/gone.csv", 1, &["gone.csv", "check the path"]),
    ("diagnose --model @/model.toml --log @/short.csv", 1, &["no flight in this log"]),
    ("diagnose --model @/model.toml --log @/good.csv --without flubber", 1, &["flubber"]),
    (
        "amend --model @/model.toml --log @/good.csv --accept --out @/new",
        1,
        &["no effect is asserted", "two thirds of good.csv", "diagnose --model", "--tune-only"],
    ),
    (
        "amend --model @/model.toml --log @/good.csv --diagnosis @/there.json --out @/new",
        1,
        &["there.json", "greylag diagnose --json"],
    ),
    (
        "amend --model @/model.toml --log @/good.csv --effect drag_beta2 --bound CDbeta2=1 --out @/new",
        2,
        &["--bound"],
    ),
    (
        "aircraft from-log @/new --mass-kg 2.1 --span-m 1.6 --area-m2 0.3 --log @/gone.csv",
        1,
        &["gone.csv", "check the path"],
    ),
    (
        "aircraft from-log @/new --mass-kg 2100 --span-m 1.6 --area-m2 0.3 --log @/good.csv",
        1,
        &["did you mean --mass-kg 2.1"],
    ),
    (
        "aircraft from-log @ --mass-kg 2.1 --span-m 1.6 --area-m2 0.3 --log @/good.csv",
        1,
        &["exists", "another folder"],
    ),
    ("aircraft check --model @/none.toml", 1, &["none.toml"]),
    ("aircraft new @/new --mass-kg 2.1 --span-m 1.6 --area-m2 0.3 --tail canard", 2, &["canard"]),
    ("compare --model @/model.toml --log @/milliseconds.csv", 1, &["time_s", "--write-mapping"]),
    ("compare --model @/model.toml --log @/kmh.csv", 1, &["airspeed", "mapping"]),
    ("compare --model @/model.toml --log @/no-header.csv", 1, &["time_s"]),
    ("compare --model @/model.toml --log @/good.csv --source airspeed", 2, &["--source"]),
    ("workbench --model @/model.toml --port 99999 --dir @/session", 2, &["99999", "--port"]),
    ("evaluate --controller flubber", 2, &["flubber", "lqi"]),
    ("evaluate --controller lqi --targets @/none.csv", 1, &["none.csv"]),
    ("demo --model @/none.toml --out @/new", 1, &["none.toml"]),
    ("fly --vehicle nonsense", 2, &["nonsense", "udpin:"]),
];

#[test]
fn there_are_forty_mistakes_and_more() {
    let all = LINE.len() + FILES.len() + KEPT.len() + NUMBERS.len() + WORDS.len() + MORE.len();
    // forty were met in a first hour, and as many again; each is run by one of the tests below
    assert!(all >= 80, "{all}");
}

#[test]
fn a_wrong_command_line_is_answered() {
    check(&LINE);
}

#[test]
fn wrong_files_are_answered() {
    check(&FILES);
}

#[test]
fn what_is_there_is_kept() {
    check(&KEPT);
}

#[test]
fn wrong_numbers_are_answered() {
    check(&NUMBERS);
}

#[test]
fn wrong_words_are_answered() {
    check(&WORDS);
}

#[test]
fn more_mistakes_are_answered() {
    check(&MORE);
}

#[test]
fn a_log_that_was_mistyped_does_not_spoil_the_folder() {
    let scratch = tempfile::Builder::new().prefix("mistakes").tempdir().unwrap();
    let folder = scratch.path();
    files(folder);
    let line = "aircraft from-log @/own --mass-kg 3.364 --span-m 2.1 --area-m2 0.75 --tail flying-wing --log @/";
    assert!(!run(&format!("{line}god.csv"), folder).status.success());
    // Ctrl-C while the logs are read leaves the prior; the same command goes on from it
    let measures = "--mass-kg 3.364 --span-m 2.1 --area-m2 0.75 --tail flying-wing";
    run(&format!("aircraft new @/own/prior --name own {measures}"), folder);
    assert!(folder.join("own/prior/model.toml").exists());
    let again = run(&format!("{line}good.csv"), folder);
    assert!(folder.join("own/model.toml").exists(), "{}", answer(&again));
}

#[test]
fn one_of_several_logs_is_put_right_alone() {
    let scratch = tempfile::Builder::new().prefix("mistakes").tempdir().unwrap();
    let folder = scratch.path();
    files(folder);
    let compared = run("compare --model @/model.toml --log @/good.csv @/degrees.csv", folder);
    let said = answer(&compared);
    assert_eq!(compared.status.code(), Some(3), "{said}");
    for words in [
        "degrees.csv --write-mapping degrees.toml",
        "degrees.csv degrees-corrected.csv --mapping degrees.toml",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
    for line in [
        "logs info @/degrees.csv --write-mapping @/degrees.toml",
        "logs convert @/degrees.csv @/degrees-corrected.csv --mapping @/degrees.toml",
        "logs info @/good.csv @/degrees-corrected.csv",
    ] {
        let done = run(line, folder);
        assert!(done.status.success(), "{line}: {}", answer(&done));
    }
}

#[test]
fn the_mapping_that_is_offered_cures_a_log_in_degrees() {
    let scratch = tempfile::Builder::new().prefix("mistakes").tempdir().unwrap();
    let folder = scratch.path();
    files(folder);
    let wrote = run("logs info @/degrees.csv --write-mapping @/mapping.toml", folder);
    assert!(wrote.status.success(), "{}", answer(&wrote));
    let said = String::from_utf8_lossy(&wrote.stdout).into_owned();
    assert!(
        said.trim_end().ends_with(&format!("--mapping {}/mapping.toml", folder.display())),
        "{said}"
    );
    // with it the log is read as the one in radians
    let json = |line: &str| -> serde_json::Value {
        serde_json::from_slice(&run(line, folder).stdout).unwrap()
    };
    let [right, cured] = [
        json("compare --model @/model.toml --log @/good.csv --json -"),
        json("compare --model @/model.toml --log @/degrees.csv --mapping @/mapping.toml --json -"),
    ]
    .map(|c| c["answer"]["numbers"]["steps"][0]["error"].as_f64().unwrap());
    // angles that went to degrees and back differ by rounding only
    assert!((cured / right - 1.0).abs() < 1e-3, "{cured} {right}");
}
