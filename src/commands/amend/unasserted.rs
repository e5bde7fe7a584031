//! Error message of `greylag amend --accept` if the diagnosis of the fitted flights asserts no effect.

use std::path::{Path, PathBuf};

use super::{Arguments, divided};
use crate::commands::effect_files::file_words;
use crate::logs::quoted;
use crate::sysid::diagnose::{Candidate, Diagnosis};

/// Largest number of logs that the message names.
const NAMED: usize = 4;

/// The message: the flights on which no effect is asserted, the closest effect, and the commands to run next.
pub fn message(arguments: &Arguments, diagnosis: &Diagnosis) -> String {
    let all = arguments.fit_all || arguments.leave_one_out;
    let (fitted, held) = match all {
        true => (arguments.logs.paths.clone(), Vec::new()),
        false => divided(arguments),
    };
    let closest = diagnosis.effects.first().filter(|c| c.evidence > 0.0);
    let near = closest.map_or(String::new(), |c| format!("; the closest is {} ({})", c.id, why(c)));
    let see = format!(
        "greylag diagnose --model {}{} --report diagnosis.html",
        quoted(&arguments.model),
        arguments.logs.of(fitted.clone()).words()
    );
    format!(
        "On {} no effect is asserted{near}.\n  {}\n  To see why: {see}",
        place(&fitted, &held, all),
        adding(arguments, closest.map(|c| c.id.as_str()))
    )
}

/// The command that adds the effect `closest` and those that the user has named. It fits the model's own coefficients if there
/// is no effect.
fn adding(arguments: &Arguments, closest: Option<&str>) -> String {
    let Arguments { model, logs, hold_out, out, effects, fit_all, leave_one_out, .. } = arguments;
    let files = file_words(effects).unwrap_or_default();
    let mut named: Vec<String> = effects.iter().map(|e| quoted(Path::new(e))).collect();
    let new = |id: &&str| !files.contains_key(*id) && effects.iter().all(|e| e != id);
    named.extend(closest.filter(new).map(str::to_owned));
    let held: String = hold_out.iter().map(|log| format!(" {}", quoted(log))).collect();
    let flags = [(*fit_all, " --fit-all"), (*leave_one_out, " --leave-one-out")];
    let flags: String = flags.into_iter().filter(|(on, _)| *on).map(|(_, flag)| flag).collect();
    let line = |what: &str| {
        let held = if held.is_empty() { String::new() } else { format!(" --hold-out{held}") };
        let (model, logs, out) = (quoted(model), logs.words(), quoted(out));
        format!("greylag amend --model {model}{logs}{held}{flags} {what} --out {out}")
    };
    match named.is_empty() {
        true => format!("To fit the model's own coefficients: {}", line("--tune-only")),
        false => {
            let effect = format!("--effect {}", named.join(" "));
            format!(
                "To add it nevertheless (or, with --tune-only in place of {effect}, to fit the model's own coefficients): {}",
                line(&effect)
            )
        }
    }
}

/// The reason why the diagnosis does not assert `c`.
fn why(c: &Candidate) -> String {
    match c.refused.first().filter(|_| c.evidence > c.threshold) {
        Some(reason) => format!("refused: {reason}"),
        None => format!("evidence {:.1}, where chance reaches {:.1}", c.evidence, c.threshold),
    }
}

/// Text on the flights of the fit. `all` states that no flight is held out.
fn place(fitted: &[PathBuf], held: &[PathBuf], all: bool) -> String {
    match held.is_empty() {
        _ if all => listed(fitted),
        true => format!("the first two thirds of {} (the rest is held out)", listed(fitted)),
        false => {
            let verb = if held.len() == 1 { "is" } else { "are" };
            format!("{} alone ({} {verb} held out)", listed(fitted), listed(held))
        }
    }
}

/// The file names of `logs` as a list in a sentence, or their number if they are many.
fn listed(logs: &[PathBuf]) -> String {
    let name = |path: &PathBuf| match path.file_name() {
        Some(name) => name.to_string_lossy().into_owned(),
        None => path.display().to_string(),
    };
    let names: Vec<String> = logs.iter().map(name).collect();
    match names.split_last() {
        _ if names.len() > NAMED => format!("{} logs", names.len()),
        Some((last, first)) if !first.is_empty() => format!("{} and {last}", first.join(", ")),
        _ => names.concat(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::{Command, command_of};

    fn arguments(line: &str) -> Arguments {
        let words: Vec<_> = line.split(' ').map(std::ffi::OsString::from).collect();
        let Ok(Command::Amend(arguments)) = command_of(&words) else { panic!("{line}") };
        arguments
    }

    #[test]
    fn the_flights_of_the_fit_are_named() {
        let of = |names: &[&str]| names.iter().map(PathBuf::from).collect::<Vec<_>>();
        let said = |fitted: &[&str], held: &[&str], all| place(&of(fitted), &of(held), all);
        assert_eq!(
            said(&["a/1.csv", "a/2.csv"], &["a/3.csv"], false),
            "1.csv and 2.csv alone (3.csv is held out)"
        );
        assert_eq!(
            said(&["1.csv"], &[], false),
            "the first two thirds of 1.csv (the rest is held out)"
        );
        assert_eq!(said(&["1", "2", "3"], &[], true), "1, 2 and 3");
        assert_eq!(
            said(&["1", "2", "3", "4", "5"], &["6", "7"], false),
            "5 logs alone (6 and 7 are held out)"
        );
    }

    #[test]
    fn the_command_that_adds_the_closest_effect_is_whole() {
        let line = "amend --model m.toml --log a.csv b.csv --hold-out c.csv --accept --out new";
        let said = adding(&arguments(line), Some("lift_stall"));
        let (_, command) = said.split_once("greylag ").unwrap();
        let again = arguments(command);
        assert_eq!(again.effects, ["lift_stall"]);
        assert_eq!((again.logs.paths.len(), again.hold_out.len(), again.accept), (2, 1, false));
        assert!(said.contains("--tune-only in place of --effect lift_stall"), "{said}");
        let said = adding(&arguments(line), None);
        assert!(arguments(said.split_once("greylag ").unwrap().1).tune_only, "{said}");
    }
}
