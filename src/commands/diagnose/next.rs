//! The command to run after a diagnosis.

use std::collections::BTreeMap;
use std::iter::once;
use std::path::{Path, PathBuf};

use super::Arguments;
use crate::commands::files;
use crate::commands::intake::LogArguments;
use crate::logs::quoted;
use crate::model::GreyBox;
use crate::sysid::compare::Answer;
use crate::sysid::diagnose::{Diagnosis, Verdict};
use crate::sysid::per_flight::askew;

/// If no effect is missing, re-estimation of the coefficients (tuning) is recommended from this reduction of the free-run
/// (open-loop simulation) error on, %. The flights are those of the fit; a smaller reduction is often lost on other flights.
const WORTH_TUNING: f64 = 10.0;

/// The command to run next; empty for a `given` model with a learned residual, which `amend` refuses. `words` maps the id of an
/// effect to the path of its effect file. `used` are the logs that were diagnosed. `answer` has the free-run errors as given, tuned, and with the asserted effects.
pub(super) fn next(
    (arguments, used): (&Arguments, &LogArguments),
    given: &GreyBox,
    diagnosis: &Diagnosis,
    words: &BTreeMap<String, String>,
    answer: &Answer,
) -> String {
    if given.residual.is_some() {
        return String::new();
    }
    let model = &arguments.model;
    let out = free(model.parent().unwrap_or(Path::new("")));
    let (model, out, logs) = (quoted(model), quoted(&out), used.words());
    let between = diagnosis.advice.iter().find_map(|a| a.between.as_ref());
    match (diagnosis.verdict, between) {
        (Verdict::Effect, Some(pair)) if in_doubt(diagnosis) => design(&model, pair, words),
        (Verdict::Effect, _) if only_axes(alike(diagnosis)) => turned(&model, &logs, &out),
        (Verdict::Effect, _) => {
            let found = diagnosis.effects.iter().filter(|c| c.asserted).map(|c| c.id.as_str());
            let written = arguments.json.as_deref().filter(|path| !files::is_stdout(Some(*path)));
            let added = added(&found.collect::<Vec<_>>(), words, written);
            format!("greylag amend --model {model}{logs} {added} --out {out}")
        }
        // what a model needs that is worse than straight flight is other coefficients, before any effect
        (Verdict::Adequate | Verdict::Unexplained, _) if answer.behind_baseline() => {
            scratch(&model, &logs, &out)
        }
        (Verdict::Adequate, _) if answer.numbers.change_percent > -WORTH_TUNING => {
            format!("greylag aircraft check --model {model}")
        }
        (Verdict::Adequate, _) => {
            format!("greylag amend --model {model}{logs} --tune-only --out {out}")
        }
        // `propose` needs two flights: it searches a formula on one and tests it on the other
        (Verdict::Unexplained, _) if used.paths.len() < 2 => String::new(),
        (Verdict::Unexplained, _) => format!("greylag propose --model {model}{logs}"),
        // the flights themselves are in doubt, so the logs are inspected first
        (Verdict::Unknown, _) => used.inspected(&arguments.model),
    }
}

/// A folder in `parent` that does not exist: `amended`, or the first of `amended-2`, `amended-3` and so on.
fn free(parent: &Path) -> PathBuf {
    let names = once("amended".to_owned()).chain((2u32..).map(|k| format!("amended-{k}")));
    names.map(|name| parent.join(name)).find(|folder| !folder.exists()).unwrap_or_default()
}

/// The option of `greylag amend` that adds the effects `ids`. With `--accept` the command would diagnose the fitted logs alone
/// and could find nothing. The fit tries several effects of the file `written` of the diagnosis together, so this file is
/// preferred to their names. Effects that come from effect files, in `words`, are always named.
fn added(ids: &[&str], words: &BTreeMap<String, String>, written: Option<&Path>) -> String {
    let from_files = ids.iter().any(|id| words.contains_key(*id));
    match written {
        Some(path) if ids.len() > 1 && !from_files => format!("--diagnosis {}", quoted(path)),
        _ => {
            let named = |id: &&str| words.get(*id).map_or(*id, String::as_str).to_owned();
            format!("--effect {}", ids.iter().map(named).collect::<Vec<_>>().join(" "))
        }
    }
}

/// The command that designs a manoeuvre to distinguish two effects.
fn design(model: &str, pair: &[String; 2], words: &BTreeMap<String, String>) -> String {
    let [a, b] = pair.each_ref().map(|id| words.get(id).unwrap_or(id));
    format!("greylag design --model {model} --between {a} {b}")
}

/// The command that estimates a misalignment of the sensor axes for each flight. It is recommended if these flights cannot
/// distinguish the misalignment from the asserted effects.
fn turned(model: &str, logs: &str, out: &str) -> String {
    format!("greylag amend --model {model}{logs} --tune-only --axes-askew 3 --out {out}")
}

/// The command that fits all coefficients without the values of the model file. It is recommended if a forecast without
/// aerodynamics is better than the model, and tuning the model within its prior does not change that.
fn scratch(model: &str, logs: &str, out: &str) -> String {
    format!("greylag amend --model {model}{logs} --tune-only --from-scratch --out {out}")
}

/// Whether an asserted effect cannot be distinguished from another explanation with these flights. An effect is asserted if
/// the diagnosis states that the model lacks it.
fn in_doubt(diagnosis: &Diagnosis) -> bool {
    alike(diagnosis).next().is_some()
}

/// Identifiers of the explanations that cannot be distinguished from the asserted effects.
fn alike(diagnosis: &Diagnosis) -> impl Iterator<Item = &String> {
    diagnosis.effects.iter().filter(|c| c.asserted).flat_map(|c| &c.indistinguishable_from)
}

/// Whether `alike` names the misalignment of the sensor axes and nothing else.
fn only_axes<'a>(alike: impl Iterator<Item = &'a String>) -> bool {
    let mut alike = alike.peekable();
    alike.peek().is_some() && alike.all(|id| id == askew::ID)
}

#[cfg(all(test, feature = "demo"))]
mod tests {
    use super::*;
    use crate::commands::{Command, command_of};

    #[test]
    fn the_command_that_comes_next_is_whole() {
        let files = BTreeMap::from([("mine".to_owned(), "effects/mine.toml".to_owned())]);
        let words = |line: &str| -> Vec<std::ffi::OsString> {
            line.split(' ').skip(1).map(std::ffi::OsString::from).collect()
        };
        for (second, named) in [("lift_alpha2", "lift_alpha2"), ("mine", "effects/mine.toml")] {
            let line = design("model.toml", &["lift_stall", second].map(String::from), &files);
            assert!(line.ends_with(&format!(" --between lift_stall {named}")), "{line}");
            assert!(matches!(command_of(&words(&line)), Ok(Command::Design(_))), "{line}");
        }
        for line in [turned, scratch].map(|of| of("model.toml", " --log a.csv", "amended")) {
            assert!(matches!(command_of(&words(&line)), Ok(Command::Amend(_))), "{line}");
        }
        let json = Some(Path::new("found.json"));
        for (found, written, option) in [
            (&["lift_stall"][..], None, "--effect lift_stall"),
            (&["lift_stall"][..], json, "--effect lift_stall"),
            (&["lift_stall", "inertia"][..], None, "--effect lift_stall inertia"),
            (&["lift_stall", "inertia"][..], json, "--diagnosis found.json"),
            (&["lift_stall", "mine"][..], json, "--effect lift_stall effects/mine.toml"),
        ] {
            let added = added(found, &files, written);
            assert_eq!(added, option);
            let line = format!("greylag amend --model m.toml --log a.csv {added} --out amended");
            assert!(matches!(command_of(&words(&line)), Ok(Command::Amend(_))), "{line}");
        }
    }

    #[test]
    fn the_folder_that_is_proposed_is_free() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["amended", "amended-2", "amended-3"] {
            let proposed = free(folder.path());
            assert_eq!(proposed, folder.path().join(name));
            std::fs::create_dir(proposed).unwrap();
        }
    }

    #[test]
    fn axes_are_fitted_if_they_are_all_that_an_effect_cannot_be_told_from() {
        let only = |ids: &[&str]| {
            only_axes(ids.iter().map(|id| (*id).to_owned()).collect::<Vec<_>>().iter())
        };
        assert!(only(&[askew::ID]) && only(&[askew::ID, askew::ID]));
        assert!(!only(&[]) && !only(&[askew::ID, "inertia"]));
    }
}
