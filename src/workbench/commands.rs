//! The command that does the same as a click.

use std::path::Path;

use serde::Serialize;

use super::bench::{Bench, Inner};
use super::session::Role;

/// The commands for the session as it is.
#[derive(Clone, Debug, Serialize)]
pub struct Commands {
    /// What each log holds.
    pub flights: String,
    /// Where the model fails.
    pub compare: String,
    /// What it lacks.
    pub diagnose: String,
    /// The amended model; empty without accepted effects.
    pub amend: String,
    /// Both models on the test flights; empty without any.
    pub judge: String,
}

impl Bench {
    /// The commands for the session as it is.
    pub(super) fn commands(&self, inner: &Inner) -> Commands {
        let model = quoted(&inner.session.model);
        let logs = |roles: &[Role]| -> String {
            let all = inner.session.logs.iter().filter(|l| roles.contains(&l.role));
            all.map(|l| format!(" {}", quoted(&self.folder.join(&l.path)))).collect()
        };
        let words = self.reading_words(inner);
        let (fit, held, test) = (logs(&[Role::Fit]), logs(&[Role::HoldOut]), logs(&[Role::Test]));
        let seen = logs(&[Role::Fit, Role::HoldOut]);
        let out = quoted(&self.folder.join("model"));
        let effects: String = inner.session.effects.iter().map(|e| format!(" {}", e.id)).collect();
        let anyway = match inner.session.effects.iter().any(|e| e.anyway) {
            true => " --accept-anyway",
            false => "",
        };
        let held = if held.is_empty() { held } else { format!(" --hold-out{held}") };
        let amended = match effects.is_empty() {
            true => String::new(),
            false => format!(" {out}/model.toml"),
        };
        let some = |needed: &str, command: String| match needed.is_empty() {
            true => String::new(),
            false => command,
        };
        let all = logs(&[Role::Fit, Role::HoldOut, Role::Test, Role::Unused]);
        Commands {
            flights: some(&all, format!("greylag logs info{all}")),
            compare: some(
                &seen,
                format!("greylag compare --model {model}{amended} --log{seen}{words}"),
            ),
            diagnose: some(&fit, format!("greylag diagnose --model {model} --log{fit}{words}")),
            amend: some(
                &effects,
                format!(
                    "greylag amend --model {model} --log{fit}{held} --effect{effects}{anyway}{words} --out {out}"
                ),
            ),
            judge: some(
                &test,
                format!("greylag compare --model {model}{amended} --log{test}{words}"),
            ),
        }
    }
}

impl Bench {
    /// How the commands must read the logs; those with problems need a word more.
    fn reading_words(&self, inner: &Inner) -> String {
        let used = inner.session.logs.iter().zip(&inner.flights);
        let mut used = used.filter(|(log, _)| log.role != Role::Unused);
        let doubt = used.any(|(_, flight)| flight.as_ref().is_ok_and(|f| f.in_doubt()));
        let despite = " --despite-problems";
        match doubt && !inner.words.contains(despite) {
            true => format!("{}{despite}", inner.words),
            false => inner.words.clone(),
        }
    }
}

/// A path as a shell takes it.
fn quoted(path: &Path) -> String {
    let text = path.display().to_string();
    let plain = |c: char| c.is_alphanumeric() || "/._-+=:@%,".contains(c);
    match text.chars().all(plain) {
        true => text,
        false => format!("'{}'", text.replace('\'', r"'\''")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_with_spaces_or_quotes_stays_one_word() {
        assert_eq!(quoted(Path::new("/a/b-1.csv")), "/a/b-1.csv");
        assert_eq!(quoted(Path::new("/a b/it's")), r"'/a b/it'\''s'");
    }
}
