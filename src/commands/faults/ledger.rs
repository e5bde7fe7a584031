//! The file in which a fault campaign records its flights, one JSON object per line. An interrupted campaign resumes from this
//! file.
//!
//! A fault campaign flies the companion (Greylag's autopilot) in simulation, with random faults. A finding is a violated
//! requirement.

use std::collections::HashMap;
use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use anyhow::{Context, Result, ensure};
use serde::{Deserialize, Serialize};

use crate::sim::faults::{Case, Cause, Fault, Finding, Found, Report, draw};

/// Start of every line.
const START: &str = "{\"controller\":";

/// A flight of the campaign. Its faults are drawn with its seed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// Name of the controller.
    pub controller: String,
    /// Name of the flight controller or simulator to which the companion is connected.
    pub counterpart: String,
    /// Seed of the flight's faults.
    pub seed: u64,
    /// Findings of the flight.
    pub findings: Vec<Note>,
}

/// A finding as it is recorded in the file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Note {
    /// Time of the finding, s.
    pub at_s: f64,
    /// Name of the finding.
    pub finding: String,
    /// Name of the cause to which the finding is attributed; `None` without one.
    pub cause: Option<String>,
}

impl From<&Report> for Entry {
    fn from(report: &Report) -> Self {
        let note = |f: &Found| Note {
            at_s: f.at_s,
            finding: f.finding.name().into(),
            cause: f.cause.map(Cause::name).map(Into::into),
        };
        Entry {
            controller: report.case.controller.name().into(),
            counterpart: report.case.counterpart.name().into(),
            seed: report.case.seed,
            findings: report.findings.iter().map(note).collect(),
        }
    }
}

impl Entry {
    /// The faults of the flight.
    pub fn faults(&self) -> Vec<Fault> {
        draw(self.seed)
    }

    /// The options of `greylag faults` that repeat the flight.
    pub fn options(&self) -> String {
        format!(
            "--controller {} --counterpart {} --first {} --flights 1",
            self.controller, self.counterpart, self.seed
        )
    }

    fn key(&self) -> (String, String, u64) {
        (self.controller.clone(), self.counterpart.clone(), self.seed)
    }
}

impl Note {
    /// Whether the finding is a failure of the companion itself, which is never attributed to a fault.
    pub fn is_own(&self) -> bool {
        Finding::ALL.iter().any(|f| f.name() == self.finding && f.is_own())
    }

    /// Name of the cause, `the companion's own` for a failure of the companion itself, or `unexplained`.
    pub fn standing(&self) -> &str {
        match &self.cause {
            Some(cause) => cause,
            None if self.is_own() => "the companion's own",
            None => "unexplained",
        }
    }

    /// Whether the finding fails the campaign: it has no established cause, or the same flight without faults has it too.
    pub fn is_failure(&self) -> bool {
        self.cause.as_deref().is_none_or(|cause| cause == Cause::Itself.name())
    }
}

/// The flights of earlier runs, and the file to which new flights are appended.
pub struct Ledger {
    known: HashMap<(String, String, u64), Entry>,
    file: Mutex<File>,
}

impl Ledger {
    /// Opens or creates the file. Removes an incomplete last line, which a killed run leaves; [`Ledger::find`] does not know
    /// its flight.
    pub fn open(path: &Path) -> Result<Self> {
        let mut known = HashMap::new();
        let mut whole = 0;
        if path.exists() {
            let file = File::open(path).with_context(|| format!("reading {}", path.display()))?;
            let mut lines = BufReader::new(file);
            let mut line = String::new();
            while lines.read_line(&mut line)? > 0 && line.ends_with('\n') {
                let entry: Entry = serde_json::from_str(&line).with_context(|| {
                    format!(
                        "{} is not a file of `greylag faults --resume`, or one of an earlier version; give another name",
                        path.display()
                    )
                })?;
                whole += line.len() as u64;
                known.insert(entry.key(), entry);
                line.clear();
            }
            // A killed run may have cut off its first line anywhere. A file with other content must not be emptied.
            let cut = line.starts_with(START) || START.starts_with(&line);
            ensure!(
                whole > 0 || cut,
                "{} is not a file of `greylag faults --resume`, or one of an earlier version; give another name",
                path.display()
            );
        }
        let file = OpenOptions::new().create(true).append(true).open(path).with_context(|| {
            format!("opening {}; name a file that can be written", path.display())
        })?;
        if file.metadata()?.len() > whole {
            file.set_len(whole)?;
        }
        Ok(Ledger { known, file: Mutex::new(file) })
    }

    /// Entry of an earlier run with the controller, the counterpart and the seed of `case`; `None` without one.
    pub fn find(&self, case: &Case) -> Option<Entry> {
        let key =
            (case.controller.name().to_owned(), case.counterpart.name().to_owned(), case.seed);
        self.known.get(&key).cloned()
    }

    /// Appends a flight to the file.
    pub fn note(&self, entry: &Entry) -> Result<()> {
        let line = format!("{}\n", serde_json::to_string(entry)?);
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        file.write_all(line.as_bytes()).context("noting a flight; free some space")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_that_was_cut_off_is_dropped_and_the_rest_is_known() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("campaign");
        let entry = Entry {
            controller: "lqi".into(),
            counterpart: "px4".into(),
            seed: 3,
            findings: vec![Note { at_s: 1.5, finding: "attitude".into(), cause: None }],
        };
        Ledger::open(&path).unwrap().note(&entry).unwrap();
        let mut file = OpenOptions::new().append(true).open(&path).unwrap();
        file.write_all(br#"{"controller":"lq"#).unwrap();
        let ledger = Ledger::open(&path).unwrap();
        assert_eq!(ledger.known.values().collect::<Vec<_>>(), [&entry]);
        ledger.note(&Entry { seed: 4, ..entry }).unwrap();
        assert_eq!(Ledger::open(&path).unwrap().known.len(), 2);
    }

    #[test]
    fn another_file_is_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("notes");
        for text in ["something else", "{\"counterpart\":\"px4\",\"seed\":3}", "{}"] {
            std::fs::write(&path, text).unwrap();
            assert!(Ledger::open(&path).is_err());
            assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
        }
        let cut = "{\"controller\":\"lqi\",\"counter";
        for length in [0, 1, 5, START.len(), cut.len()] {
            std::fs::write(&path, &cut[..length]).unwrap();
            assert!(Ledger::open(&path).unwrap().known.is_empty());
        }
    }
}
