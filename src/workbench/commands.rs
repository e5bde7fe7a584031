//! The `greylag` commands that do the same as the functions of the workbench page. A session of the workbench has a model and
//! flights. Fit flights are used to fit the model, hold-out flights to validate the fit, and test flights for a final comparison.

use serde::Serialize;

use super::act::SAVED;
use super::bench::{Bench, Inner};
use super::session::Role;
use greylag_logs::csv::Tolerance;
use greylag_logs::quoted;
use greylag_sysid::amend::document::MODEL;
use greylag_sysid::flight_path::ActuatorClock;

/// The commands for the present session. A command is empty if the session lacks what it needs.
#[derive(Clone, Debug, Serialize)]
pub struct Commands {
    /// Command that summarises the logs; empty without logs.
    pub flights: String,
    /// Command that compares the model, and the amended model if there are accepted effects, with the fit and hold-out flights;
    /// empty without such flights.
    pub compare: String,
    /// Command that finds effects that the model lacks; empty without fit flights.
    pub diagnose: String,
    /// Command that searches for a formula for the residual; empty without separate flights for the search and its test.
    pub propose: String,
    /// Command that adds the accepted effects to the model; empty without accepted effects.
    pub amend: String,
    /// Command that compares the same models with the test flights; empty without test flights.
    pub judge: String,
}

impl Bench {
    /// The commands for the present session.
    pub(super) fn commands(&self, inner: &Inner) -> Commands {
        let model = quoted(&inner.session.model);
        let logs = |roles: &[Role]| -> String {
            inner.usable(roles).iter().map(|k| format!(" {}", quoted(&inner.file(*k)))).collect()
        };
        let (fit, held, test) = (logs(&[Role::Fit]), logs(&[Role::HoldOut]), logs(&[Role::Test]));
        let seen = logs(&[Role::Fit, Role::HoldOut]);
        let all: String =
            (0..inner.session.logs.len()).map(|k| format!(" {}", quoted(&inner.file(k)))).collect();
        let folder = self.folder.join(SAVED);
        let word = |id: &str| format!(" {}", quoted(&inner.effect_word(id)));
        let effects: String = inner.session.effects.iter().map(|e| word(&e.id)).collect();
        let own: String = inner.session.own.iter().map(|id| word(id)).collect();
        let own = if own.is_empty() { own } else { format!(" --effect{own}") };
        let anyway = match inner.session.effects.iter().any(|e| e.anyway) {
            true => " --accept-anyway",
            false => "",
        };
        let held = if held.is_empty() { held } else { format!(" --hold-out{held}") };
        let amended = match effects.is_empty() {
            true => String::new(),
            false => format!(" {}", quoted(&folder.join(MODEL))),
        };
        let some = |needed: &str, command: String| match needed.is_empty() {
            true => String::new(),
            false => command,
        };
        let clock = match inner.clock() {
            ActuatorClock::AsRecorded => " --recorded-clock",
            ActuatorClock::Estimated => "",
        };
        let compare = |logs: &str, roles: &[Role]| {
            let words = inner.reading_words(roles);
            format!("greylag compare --model {model}{amended} --log{logs}{clock}{words}")
        };
        let out = quoted(&folder);
        let to_fit = inner.reading_words(&[Role::Fit]);
        let both = inner.reading_words(&[Role::Fit, Role::HoldOut]);
        Commands {
            flights: some(&all, format!("greylag logs info{all}{}", inner.mapping_words())),
            compare: some(&seen, compare(&seen, &[Role::Fit, Role::HoldOut])),
            diagnose: some(
                &fit,
                format!("greylag diagnose --model {model} --log{fit}{own}{to_fit}"),
            ),
            propose: inner.propose_command(&own),
            amend: some(
                &effects,
                format!(
                    "greylag amend --model {model} --log{fit}{held} --effect{effects}{anyway}{both} --out {out}"
                ),
            ),
            judge: some(&test, compare(&test, &[Role::Test])),
        }
    }
}

impl Inner {
    /// The command that searches for a formula. `own` is the option that names the effects that the user has written in this
    /// session. Empty if there are too few flights for the search and a test of the formula.
    fn propose_command(&self, own: &str) -> String {
        let Ok(places) = self.searched_places() else { return String::new() };
        let named = |places: Vec<usize>| -> String {
            places.iter().map(|k| format!(" {}", quoted(&self.file(*k)))).collect()
        };
        let [search, test] = places.map(named);
        let model = quoted(&self.session.model);
        let both = self.reading_words(&[Role::Fit, Role::HoldOut]);
        format!("greylag propose --model {model} --log{search} --hold-out{test}{own}{both}")
    }

    /// Options with which a command reads the session's logs as the session does.
    fn mapping_words(&self) -> String {
        let mapping = self.mapping.file.iter().map(|file| format!(" --mapping {}", quoted(file)));
        let lenient = (self.given.tolerance == Tolerance::Lenient).then(|| " --lenient".to_owned());
        mapping.chain(lenient).chain([self.given.source_words()]).collect()
    }

    /// Options with which a command reads the logs with these `roles` as the session does. `--despite-problems` is among them if
    /// a log has problems.
    fn reading_words(&self, roles: &[Role]) -> String {
        let doubtful = |k: &usize| self.flights[*k].as_ref().is_ok_and(|f| f.in_doubt());
        let despite = self.given.despite_problems || self.usable(roles).iter().any(doubtful);
        self.mapping_words() + if despite { " --despite-problems" } else { "" }
    }
}
