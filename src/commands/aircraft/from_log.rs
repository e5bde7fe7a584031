//! `greylag aircraft from-log`: makes a model of an aircraft from its dimensions and its flight logs.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Result, bail};

use super::check;
use super::new::{self, Common};
use crate::commands::amend::{self, Caller};
use crate::commands::files::{self, Overwrite};
use crate::commands::held_out;
use crate::commands::intake::LogArguments;
use crate::commands::terminal::{NORMAL_95, print_next};
use crate::commands::{Command, command_of, given};
use crate::control::aircraft_check;
use crate::logs::quoted;
use crate::sysid::amend::lifted;

/// Largest ratio of standard deviation to magnitude at which a coefficient counts as determined.
const KNOWN: f64 = 0.3;
/// Largest ratio of standard deviation to the range of the bounds at which an offset about zero, such as Cl0, counts as determined.
const OFFSET: f64 = 0.02;
/// Largest number of findings of the check that are printed.
const SAID: usize = 3;
/// Prefixes of coefficient names, each with a manoeuvre that excites the coefficients with this prefix.
const MANOEUVRES: [(&str, &str); 7] = [
    ("roll_linear", "aileron doublets, then bank to bank reversals"),
    ("pitch_linear", "elevator doublets at three airspeeds"),
    ("lift_linear", "elevator doublets at three airspeeds"),
    ("drag_", "level flight at five airspeeds, then glides at idle"),
    ("propeller", "throttle steps at two airspeeds"),
    ("rudder_linear", "rudder doublets"),
    ("", "steady sideslips, or turns entered with aileron alone"),
];

/// Options of `greylag aircraft from-log`.
#[derive(clap::Args)]
pub struct Arguments {
    /// Folder to make. It receives the fitted aircraft, and its subfolder `prior` the aircraft before the fit.
    folder: PathBuf,
    /// Wing span.
    #[arg(long, value_name = "M")]
    span_m: f64,
    /// Wing area, the reference area of the coefficients.
    #[arg(long, value_name = "M2")]
    area_m2: f64,
    #[command(flatten)]
    common: Common,
    #[command(flatten)]
    logs: LogArguments,
}

/// Estimates a model from the dimensions and fits it to the logs. Writes both models and a page about the fitted aircraft,
/// and recommends further flights.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    let Arguments { folder, span_m, area_m2, common, logs } = arguments;
    if folder.join("model.toml").exists() {
        bail!("{} exists; name another folder", folder.join("model.toml").display());
    }
    let measures = new::measures(common, folder, *span_m, *area_m2)?;
    let prior = folder.join("prior");
    let made = [folder, &prior].map(|path| !path.exists());
    // Ctrl-C while the logs are read leaves the prior, with which the same command begins again
    let left = prior.join("model.toml").exists();
    let prior_file = new::files_again(&prior, &measures.airframe(), &measures.model())?;
    let fitted = folder.join("model.toml");
    let mut line: Vec<OsString> =
        ["amend", "--from-scratch", "--tune-only", "--model"].map(Into::into).into();
    line.push(prior_file.clone().into());
    line.push("--log".into());
    line.extend(logs.paths.iter().map(|log| log.clone().into_os_string()));
    line.extend(logs.reading_words());
    line.extend(["--out".into(), folder.clone().into_os_string()]);
    line.extend(["--report".into(), folder.join("fit.html").into_os_string()]);
    let Command::Amend(amend) = command_of(&line)? else { bail!("greylag amend cannot be run") };
    let status = amend::run_for(&amend, Caller::FromLog).inspect_err(|_| {
        if !left {
            remove(folder, &prior, made);
        }
    })?;
    if !fitted.exists() {
        println!("the model estimated from the dimensions is in {}", prior.display());
        println!("to write the fit all the same: {}", anyway(folder, logs));
        print_next(&format!("greylag compare --model {}{}", quoted(&prior_file), judges(logs)));
        return Ok(status);
    }
    let page = folder.join("aircraft.html");
    let model = given::model(&fitted)?;
    let found = aircraft_check::check(&model)?;
    files::write(&page, &check::page(&fitted, &model)?, Overwrite::New)?;
    println!("wrote {} and {}", page.display(), folder.join("fit.html").display());
    further(folder, logs)?;
    found.findings.iter().take(SAID).for_each(|finding| println!("correct: {finding}"));
    if found.findings.len() > SAID {
        println!("and {} more, in {}", found.findings.len() - SAID, page.display());
    }
    print_next(&next(&fitted, logs, &found.findings));
    Ok(status)
}

/// The command that writes a fit that is not written otherwise, with its page.
fn anyway(folder: &Path, logs: &LogArguments) -> String {
    format!(
        "greylag amend --from-scratch --tune-only --accept-anyway --model {}{} --out {} --report {}",
        quoted(&folder.join("prior/model.toml")),
        logs.words(),
        quoted(folder),
        quoted(&folder.join("fit.html"))
    )
}

/// The logs that judge a model, as words of a command line: those held out, or the single log.
fn judges(logs: &LogArguments) -> String {
    let (fitted, held) = held_out::divided(&logs.paths, &[]);
    logs.of(if held.is_empty() { fitted } else { held }).words()
}

/// Removes the files that a failed run wrote, so that the user can run the corrected command. `made` states whether the run
/// created `folder` and `prior`. A folder that existed before the run keeps its other files.
fn remove(folder: &Path, prior: &Path, made: [bool; 2]) {
    let _ = match made {
        [true, _] => std::fs::remove_dir_all(folder),
        [false, true] => std::fs::remove_dir_all(prior),
        [false, false] => ["airframe.toml", "model.toml"]
            .iter()
            .try_for_each(|name| std::fs::remove_file(prior.join(name))),
    };
}

/// The next command: the check of the model `fitted` if it has `findings`, otherwise a diagnosis on those of the `logs` that were
/// fitted.
fn next(fitted: &Path, logs: &LogArguments, findings: &[String]) -> String {
    let fitted = quoted(fitted);
    let (fit, _) = held_out::divided(&logs.paths, &[]);
    match findings {
        [] => format!("greylag diagnose --model {fitted}{}", logs.of(fit).words()),
        _ => format!("greylag aircraft check --model {fitted}"),
    }
}

/// Prints manoeuvres for the coefficients that the flights do not determine, and the command that judges the fitted model.
fn further(folder: &Path, logs: &LogArguments) -> Result<()> {
    let text = std::fs::read_to_string(folder.join("amend.json"))?;
    let story: serde_json::Value = serde_json::from_str(&text)?;
    let unknown = unknown(&story);
    let mut said: Vec<(&str, Vec<&str>)> = Vec::new();
    for name in &unknown {
        let of = MANOEUVRES.iter().find(|(effect, _)| name.starts_with(effect));
        let manoeuvre = of.map_or("", |(_, manoeuvre)| manoeuvre);
        let short = name.split_once('.').map_or(name.as_str(), |(_, short)| short);
        match said.iter_mut().find(|(of, _)| *of == manoeuvre) {
            Some((_, names)) => names.push(short),
            None => said.push((manoeuvre, vec![short])),
        }
    }
    match said.is_empty() {
        true => println!("the flights determine every coefficient within {:.0} %", 100.0 * KNOWN),
        false => said.iter().for_each(|(manoeuvre, names)| {
            println!(
                "fly {manoeuvre}: {} not known within {:.0} %",
                names.join(", "),
                100.0 * KNOWN
            );
        }),
    }
    if let Some(command) = lift(folder, &story, logs)? {
        println!("to lift the bounds at which coefficients ended: {command}");
    }
    println!("{}", judged(folder, logs));
    Ok(())
}

/// Sentence on the flight that judges the fitted model.
fn judged(folder: &Path, logs: &LogArguments) -> String {
    let (_, held) = held_out::divided(&logs.paths, &[]);
    let Some(held) = held.first() else {
        return "a flight that the fit has not seen judges the model: `greylag compare` with its log"
            .into();
    };
    format!(
        "{} was held out, so it judges the model: greylag compare --model {} {}{}",
        held.display(),
        quoted(&folder.join("prior/model.toml")),
        quoted(&folder.join("model.toml")),
        judges(logs)
    )
}

/// The command that repeats the fit with the bounds lifted at which coefficients ended; `None` if none should be lifted.
fn lift(folder: &Path, story: &serde_json::Value, logs: &LogArguments) -> Result<Option<String>> {
    let prior = folder.join("prior/model.toml");
    let model = given::model(&prior)?;
    let all = story["parameters"].as_array().into_iter().flatten();
    let ended = all.filter(|p| p["at_bound"].as_bool() == Some(true));
    let range = |p: &serde_json::Value| lifted(&model, p["name"].as_str()?, p["value"].as_f64()?);
    let bounds: Vec<String> = ended.filter_map(range).collect();
    let command = || {
        format!(
            "greylag amend --from-scratch --tune-only --model {}{} --bound {} --out {}",
            quoted(&prior),
            logs.words(),
            bounds.join(" "),
            quoted(&folder.join("lifted"))
        )
    };
    Ok((!bounds.is_empty()).then(command))
}

/// Names of the coefficients that the flights do not determine. JSON holds `null` for a standard deviation that is not
/// finite. Such a coefficient counts as not determined.
fn unknown(story: &serde_json::Value) -> Vec<String> {
    let all = story["parameters"].as_array().into_iter().flatten();
    let unknown = all.filter(|p| match (p["value"].as_f64(), p["sd"].as_f64()) {
        (Some(value), Some(sd)) => sd > KNOWN * value.abs() && !about_zero(p, value, sd),
        _ => true,
    });
    unknown.map(|p| p["name"].as_str().unwrap_or_default().to_owned()).collect()
}

/// Whether the flights show that the coefficient `p` is an offset of about zero. No ratio to such a value can be required.
fn about_zero(p: &serde_json::Value, value: f64, sd: f64) -> bool {
    let offset = p["name"].as_str().is_some_and(|name| name.ends_with('0'));
    // the prior of a fit from scratch is as wide as the range of the bounds
    let range = p["prior_sd"].as_f64().unwrap_or_default();
    offset && value.abs() < NORMAL_95 * sd && sd <= OFFSET * range
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        logs: LogArguments,
    }

    #[test]
    fn the_command_that_lifts_bounds_is_whole() {
        let root = tempfile::tempdir().unwrap();
        let folder = root.path().join("own");
        let size = ["--mass-kg", "3.4", "--span-m", "2.1", "--area-m2", "0.75", "--name", "own"];
        let mut line: Vec<OsString> = ["aircraft", "new"].map(Into::into).into();
        line.push(folder.join("prior").into_os_string());
        line.extend(size.map(OsString::from));
        crate::commands::run(command_of(&line).unwrap()).unwrap();
        let logs = Line::parse_from(["greylag", "--log", "a.csv"]).logs;
        let of = |name: &str, value: f64| {
            let story = serde_json::json!({ "parameters": [
                { "name": name, "value": value, "at_bound": true },
                { "name": "drag_linear.CDq", "value": 5.0, "at_bound": false },
            ] });
            lift(&folder, &story, &logs).unwrap()
        };
        assert_eq!(of("side_force_linear.CYbeta", 0.5), None);
        let command = of("drag_linear.CD0", 0.5).unwrap();
        assert!(command.contains(" --bound drag_linear.CD0=0..1 --out "), "{command}");
        let words: Vec<OsString> = command.split(' ').skip(1).map(OsString::from).collect();
        assert!(matches!(command_of(&words), Ok(Command::Amend(_))), "{command}");
    }

    #[test]
    fn the_commands_after_a_fit_that_is_not_written_are_accepted() {
        let logs = Line::parse_from(["greylag", "--log", "a.csv", "b.csv"]).logs;
        let command = anyway(Path::new("own"), &logs);
        let words: Vec<OsString> = command.split(' ').skip(1).map(OsString::from).collect();
        assert!(command.contains("--accept-anyway --model own/prior/model.toml"), "{command}");
        assert!(matches!(command_of(&words), Ok(Command::Amend(_))), "{command}");
        assert_eq!(judges(&logs), " --log b.csv");
        let said = judged(Path::new("own"), &logs);
        let (_, command) = said.split_once(": greylag ").unwrap();
        let words: Vec<OsString> = command.split(' ').map(OsString::from).collect();
        assert!(said.starts_with("b.csv was held out"), "{said}");
        assert!(matches!(command_of(&words), Ok(Command::Compare(_))), "{said}");
        let model = Path::new("own/model.toml");
        let next = |findings: &[String]| next(model, &logs, findings);
        assert_eq!(next(&[]), "greylag diagnose --model own/model.toml --log a.csv");
        assert_eq!(next(&["x".to_owned()]), "greylag aircraft check --model own/model.toml");
        assert_eq!(judges(&Line::parse_from(["greylag", "--log", "a.csv"]).logs), " --log a.csv");
    }

    #[test]
    fn an_offset_about_zero_is_known_by_its_own_scale() {
        let story = |sd: f64| {
            serde_json::json!({ "parameters": [
                { "name": "roll_linear.Cl0", "value": 1e-5, "sd": sd, "prior_sd": 0.1 },
            ] })
        };
        assert!(unknown(&story(1e-4)).is_empty());
        assert_eq!(unknown(&story(1e-2)), ["roll_linear.Cl0"]);
    }

    #[test]
    fn a_coefficient_without_a_standard_deviation_is_not_known() {
        let story = serde_json::json!({ "parameters": [
            { "name": "drag_linear.CD0", "value": 0.02, "sd": 0.001 },
            { "name": "roll_linear.Clp", "value": -0.4, "sd": 0.2 },
            { "name": "yaw_linear.Cnr", "value": -0.1, "sd": null },
        ] });
        assert_eq!(unknown(&story), ["roll_linear.Clp", "yaw_linear.Cnr"]);
    }

    #[test]
    fn a_failed_run_leaves_the_files_that_were_there() {
        let root = tempfile::tempdir().unwrap();
        let folder = root.path().join("own");
        let prior = folder.join("prior");
        std::fs::create_dir_all(&prior).unwrap();
        std::fs::write(prior.join("notes.txt"), "mine").unwrap();
        let words =
            ["aircraft", "from-log", "--mass-kg", "3.4", "--span-m", "2.1", "--area-m2", "0.75"];
        let mut line: Vec<OsString> = words.map(Into::into).into();
        line.extend([folder.into_os_string(), "--log".into(), "no-such-log.csv".into()]);
        let command = command_of(&line).unwrap();
        assert!(crate::commands::run(command).is_err());
        let left = std::fs::read_dir(&prior).unwrap().map(|e| e.unwrap().file_name());
        assert_eq!(left.collect::<Vec<_>>(), ["notes.txt"]);
    }

    #[test]
    fn what_an_interrupted_run_left_is_no_obstacle_and_an_edited_prior_is_one() {
        let root = tempfile::tempdir().unwrap();
        let folder = root.path().join("own");
        let error = |words: &[&str], folder: &Path, rest: &[&str]| {
            let mut line: Vec<OsString> = words.iter().map(OsString::from).collect();
            line.push(folder.into());
            let size = ["--mass-kg", "3.4", "--span-m", "2.1", "--area-m2", "0.75"];
            line.extend(size.iter().chain(rest).map(OsString::from));
            crate::commands::run(command_of(&line).unwrap()).err().map(|e| format!("{e:#}"))
        };
        let prior = folder.join("prior");
        assert_eq!(error(&["aircraft", "new"], &prior, &["--name", "own"]), None);
        let again =
            || error(&["aircraft", "from-log"], &folder, &["--log", "no-such-log.csv"]).unwrap();
        let said = again();
        assert!(said.contains("no-such-log.csv") && !said.contains("exists with"), "{said}");
        let model = prior.join("model.toml");
        let edited = std::fs::read_to_string(&model).unwrap() + "# mine\n";
        std::fs::write(&model, &edited).unwrap();
        assert!(again().contains("exists with other content"), "{}", again());
        assert_eq!(std::fs::read_to_string(&model).unwrap(), edited);
    }
}
