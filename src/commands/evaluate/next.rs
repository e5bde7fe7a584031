//! The command to run after an evaluation.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use greylag_sitl::plant::PlantOptions;

use super::Arguments;
use crate::commands::{controllers, fly};
use crate::control::Needs;
use crate::logs::quoted;
use crate::report::evaluation_best;
use crate::sim::evaluation::Evaluation;

/// Options that the repeated evaluation leaves out, because their files exist by then or because it sets them itself.
const LEFT_OUT: [&str; 3] = ["--json", "--report", "--envelope"];

/// The same evaluation with the envelope limiter if controllers without it left their limits, otherwise a demonstration of the
/// best controller. An evaluation that a campaign runs is not repeated, because the command line is that of the campaign.
pub(super) fn next(
    arguments: &Arguments,
    evaluations: &[Evaluation],
    plant: &PlantOptions,
) -> String {
    let left = evaluations.iter().any(|e| e.flights.iter().any(|f| !f.quality.kept));
    let words: Vec<OsString> = std::env::args_os().skip(1).collect();
    let alone = words.iter().any(|word| word == "evaluate");
    match left && alone && !arguments.limited() {
        true => with_limiter(words),
        false => demo(arguments, evaluations, plant),
    }
}

/// The command line with the arguments `words`, with the envelope limiter. It writes no JSON, and its page beside the first one.
fn with_limiter(words: Vec<OsString>) -> String {
    let mut line = String::from("greylag");
    let mut page = None;
    let mut words = words.into_iter();
    while let Some(word) = words.next() {
        let text = word.to_string_lossy().into_owned();
        let (name, joined) = match text.split_once('=') {
            Some((name, value)) => (name, Some(PathBuf::from(value))),
            None => (text.as_str(), None),
        };
        if LEFT_OUT.contains(&name) {
            let value = joined.or_else(|| words.next().map(PathBuf::from));
            page = if name == "--report" { value } else { page };
        } else if text != "--force" {
            line += &format!(" {}", quoted(Path::new(&word)));
        }
    }
    line += " --envelope kept";
    if let Some(page) = page {
        let stem = page.file_stem().unwrap_or_default().to_string_lossy();
        let beside = page.with_file_name(format!("{stem}-limited.html"));
        line += &format!(" --report {}", quoted(&beside));
    }
    line
}

/// The `greylag demo` command for the best controller. It is empty if several models were given, or several policies and the
/// controller uses one, because the controller's name does not state which of them it used. It is also empty for a user's own
/// aircraft, because the command would have to repeat the options of the aircraft.
fn demo(arguments: &Arguments, evaluations: &[Evaluation], plant: &PlantOptions) -> String {
    let best = evaluation_best(evaluations);
    let kind =
        arguments.controllers.iter().find(|k| best.is_some_and(|e| e.controller == k.name()));
    let (Some(kind), [model], None) = (kind, &arguments.models[..], &plant.aircraft_dir) else {
        return String::new();
    };
    let mut command = format!("greylag demo --aircraft {} --controller {kind}", plant.aircraft);
    if model != Path::new(fly::MODEL) {
        command += &format!(" --model {}", quoted(model));
    }
    match (kind.needs(), &arguments.policies[..]) {
        (Needs::Gains | Needs::Model, _) => (),
        (_, [policy]) if policy == Path::new(controllers::POLICY) => (),
        (_, [policy]) => command += &format!(" --policy {}", quoted(policy)),
        _ => return String::new(),
    }
    if kind.searches() && !arguments.changes.is_empty() {
        command += " --planner";
        arguments.changes.iter().for_each(|change| command += &format!(" {change}"));
    }
    command
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_evaluation_is_repeated_with_the_limiter_and_without_the_files_that_exist() {
        let line = |said: &str| with_limiter(said.split(' ').map(OsString::from).collect());
        assert_eq!(
            line("evaluate --controller pid lqi --json - --report out/a.html --force --every 9"),
            "greylag evaluate --controller pid lqi --every 9 --envelope kept --report out/a-limited.html"
        );
        assert_eq!(
            line("evaluate --controller=lqi --envelope=free --json=b.json"),
            "greylag evaluate --controller=lqi --envelope kept"
        );
    }
}
