//! Content of the session file `session.toml`.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::error::{WorkbenchError, io};
use greylag_report as report;

/// Name of the session file in the session's folder.
pub const FILE: &str = "session.toml";
/// Version of the file's schema.
const SCHEMA: u32 = 1;

/// Role of a flight in the session.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// The model is fitted to the flight.
    Fit,
    /// The flight validates the fit, which does not use it.
    HoldOut,
    /// The flight is locked until the models are scored with it.
    Test,
    /// No computation uses the flight.
    Unused,
}

impl Role {
    /// Name of the role on the page.
    pub fn word(self) -> &'static str {
        match self {
            Role::Fit => "Fit",
            Role::HoldOut => "Hold out",
            Role::Test => "Test",
            Role::Unused => "Unused",
        }
    }
}

/// A log of the session.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LogEntry {
    /// Path of the log; a relative path is relative to the session's folder.
    pub path: PathBuf,
    /// SHA-256 of the log's content.
    pub sha256: String,
    /// Role of the flight.
    pub role: Role,
}

impl LogEntry {
    /// Name of the flight, which is the name of its file.
    pub fn name(&self) -> String {
        self.path.file_name().unwrap_or_default().to_string_lossy().into_owned()
    }
}

/// An accepted effect.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Accepted {
    /// Id of the effect.
    pub id: String,
    /// Whether the effect is kept although it fails a check on the held-out flights or on its coefficients.
    #[serde(default)]
    pub anyway: bool,
}

/// Reason why test flights were opened, which ends their lock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Occasion {
    /// The models were scored with them.
    #[default]
    Judged,
    /// A test flight got another role.
    OtherRole,
}

/// A record of an opening of test flights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Opening {
    /// Time of the opening, s since 1970 (UTC).
    pub unix_s: u64,
    /// Reason for the opening.
    #[serde(default)]
    pub occasion: Occasion,
    /// Ids of the effects in the amended model.
    pub effects: Vec<String>,
    /// Names of the flights.
    pub flights: Vec<String>,
    /// SHA-256 of the logs, by which they are identified.
    #[serde(default)]
    pub sha256: Vec<String>,
    /// Normalised root mean square error of the given model at `horizon_s`; NaN if no run reaches the horizon, or no model was
    /// scored.
    pub given: f64,
    /// The same error of the amended model.
    pub amended: f64,
    /// Horizon of the free runs, s.
    pub horizon_s: f64,
}

/// Outcome of a flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// The flight is in progress.
    Flying,
    /// The flight reached its planned end.
    Flown,
    /// The user stopped it.
    Stopped,
    /// The flight could not start, or ended early.
    Failed,
    /// The workbench ended before the flight did.
    CutOff,
}

/// A flight with the session's model, or a recording of another program.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Flown {
    /// Start of the flight, s since 1970 (UTC).
    pub unix_s: u64,
    /// Folder of the recording; a relative path is relative to the session's folder.
    pub folder: PathBuf,
    /// Name of the model of the flight, or of the model with which a recording was compared.
    pub model: String,
    /// Ids of the effects that were accepted at that time.
    pub effects: Vec<String>,
    /// Name of the schedule; empty for a recording of another program.
    #[serde(default)]
    pub schedule: String,
    /// The command that repeats the flight; empty for a recording of another program.
    #[serde(default)]
    pub command: String,
    /// Outcome of the flight.
    pub outcome: Outcome,
    /// Duration of the recording, s.
    pub seconds: f64,
    /// Warnings of the models' monitors, each with its time and model.
    #[serde(default)]
    pub warnings: Vec<String>,
    /// Last line of output of the flight's program.
    #[serde(default)]
    pub said: String,
}

/// A session, in the form of its file `session.toml`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Session {
    /// Version of the file's schema: 1.
    pub schema: u32,
    /// Revision, which every change increments by one.
    pub revision: u64,
    /// Path of the given model.
    pub model: PathBuf,
    /// SHA-256 of the model's files, including airframe, residual and effect files.
    pub model_sha256: String,
    /// Logs of the session with their roles.
    #[serde(default)]
    pub logs: Vec<LogEntry>,
    /// The accepted effects, in order.
    #[serde(default)]
    pub effects: Vec<Accepted>,
    /// Removed effects, in order of removal. A redo accepts the last of them again.
    #[serde(default)]
    pub undone: Vec<Accepted>,
    /// Openings of the test flights, in order.
    #[serde(default)]
    pub openings: Vec<Opening>,
    /// SHA-256 of the test flights that were removed before they were opened. Such a log is a test flight again when it is added
    /// again, under any name.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub removed_tests: Vec<String>,
    /// Ids of effects that the user has written as text; their files are in the folder `effects`.
    #[serde(default)]
    pub own: Vec<String>,
    /// Flights of the session, in time order.
    #[serde(default)]
    pub flown: Vec<Flown>,
}

impl Session {
    /// A new session with the model file `model`.
    pub fn new(model: PathBuf, model_sha256: String) -> Session {
        Session {
            schema: SCHEMA,
            revision: 0,
            model,
            model_sha256,
            logs: Vec::new(),
            effects: Vec::new(),
            undone: Vec::new(),
            openings: Vec::new(),
            removed_tests: Vec::new(),
            own: Vec::new(),
            flown: Vec::new(),
        }
    }

    /// The session in `folder`; `None` if there is no session yet.
    ///
    /// # Errors
    /// If the file cannot be read or is not a session.
    pub fn read(folder: &Path) -> Result<Option<Session>, WorkbenchError> {
        let path = folder.join(FILE);
        let text = match fs::read_to_string(&path) {
            Ok(text) => text,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(e) => return Err(io(&path, e)),
        };
        let broken = |why: String| WorkbenchError::Session { path: path.clone(), why };
        let session: Session = toml::from_str(&text).map_err(|e| broken(e.to_string()))?;
        match session.schema {
            SCHEMA => Ok(Some(session)),
            other => Err(broken(format!("its schema is {other}, this program reads {SCHEMA}"))),
        }
    }

    /// Writes the session to `folder` atomically.
    ///
    /// # Errors
    /// If the session cannot be represented in TOML, or the file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), WorkbenchError> {
        let path = folder.join(FILE);
        let text = toml::to_string(self)
            .map_err(|e| WorkbenchError::Session { path: path.clone(), why: e.to_string() })?;
        Ok(report::write_over(&path, &text)?)
    }

    /// Indices of the logs with a role, in order.
    pub fn with(&self, role: Role) -> impl Iterator<Item = usize> {
        self.logs.iter().enumerate().filter(move |(_, log)| log.role == role).map(|(k, _)| k)
    }

    /// The default role of a new log. A log whose name begins with `test` is a test flight. As in `greylag amend`, the first
    /// other log is a fit flight, and the last one added is held out.
    pub fn usual_role(&self, name: &str) -> Role {
        let has = |role| self.with(role).next().is_some();
        match name.to_lowercase().starts_with("test") {
            true => Role::Test,
            false if has(Role::Fit) && (!has(Role::HoldOut) || self.held_out_last().is_some()) => {
                Role::HoldOut
            }
            false => Role::Fit,
        }
    }

    /// Prepares for a new log with the role `next`. If this is a hold-out log, the log of `held_out_last` gets the
    /// role Fit.
    pub fn make_room(&mut self, next: Role) {
        if let (Role::HoldOut, Some(place)) = (next, self.held_out_last()) {
            self.logs[place].role = Role::Fit;
        }
    }

    /// Index of the log that is held out only because it was added last. The next hold-out log replaces it. It is the
    /// only hold-out flight and the last of the fit and hold-out flights, and no effect is accepted. Otherwise
    /// `None`.
    pub fn held_out_last(&self) -> Option<usize> {
        let seen = |log: &LogEntry| matches!(log.role, Role::Fit | Role::HoldOut);
        let last = self.logs.iter().rposition(seen)?;
        let only = self.with(Role::HoldOut).count() == 1;
        (only && self.effects.is_empty() && self.logs[last].role == Role::HoldOut).then_some(last)
    }
}

/// Lock on a session's folder: no other workbench can open the folder while this value exists.
pub struct Claim {
    /// Closing the file releases the lock.
    _lock: File,
}

impl Claim {
    /// Locks `folder`, and creates it if it does not exist.
    ///
    /// # Errors
    /// `WorkbenchError::Open` if another workbench has locked the folder, and `WorkbenchError::Io` if it cannot be created.
    pub fn of(folder: &Path) -> Result<Claim, WorkbenchError> {
        fs::create_dir_all(folder.join("logs")).map_err(|e| io(folder, e))?;
        let path = folder.join(".lock");
        let file = File::create(&path).map_err(|e| io(&path, e))?;
        match file.try_lock() {
            Ok(()) => Ok(Claim { _lock: file }),
            Err(fs::TryLockError::WouldBlock) => Err(WorkbenchError::Open(folder.into())),
            Err(fs::TryLockError::Error(e)) => Err(io(&path, e)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn log(name: &str, role: Role) -> LogEntry {
        LogEntry { path: name.into(), sha256: "0".into(), role }
    }

    #[test]
    fn what_is_written_comes_back() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(Session::read(folder.path()).unwrap(), None);
        let mut session = Session::new("m.toml".into(), "abc".into());
        session.revision = 7;
        session.logs = vec![log("logs/a.csv", Role::Fit), log("/b.ulg", Role::Test)];
        session.effects = vec![Accepted { id: "drag_beta2".into(), anyway: true }];
        session.openings.push(Opening {
            unix_s: 1,
            occasion: Occasion::Judged,
            effects: vec!["drag_beta2".into()],
            flights: vec!["b.ulg".into()],
            sha256: vec!["0".into()],
            given: 0.1,
            amended: 0.01,
            horizon_s: 5.0,
        });
        session.removed_tests.push("1".into());
        session.own.push("mine".into());
        session.flown.push(Flown {
            unix_s: 2,
            folder: "flights/1".into(),
            model: "m".into(),
            effects: vec!["drag_beta2".into()],
            schedule: "attitudes".into(),
            command: "greylag demo".into(),
            outcome: Outcome::Stopped,
            seconds: 3.5,
            warnings: vec!["lift".into()],
            said: "tracked".into(),
        });
        session.write(folder.path()).unwrap();
        assert_eq!(Session::read(folder.path()).unwrap(), Some(session));
    }

    #[test]
    fn a_file_that_is_no_session_is_reported_and_kept() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join(FILE), "schema = 1\nrevison = 3\n").unwrap();
        let error = Session::read(folder.path()).unwrap_err().to_string();
        assert!(error.contains(FILE) && error.contains("--dir"), "{error}");
        fs::write(
            folder.path().join(FILE),
            "schema = 9\nrevision = 3\nmodel = 'm'\nmodel_sha256 = ''\n",
        )
        .unwrap();
        assert!(Session::read(folder.path()).unwrap_err().to_string().contains("schema is 9"));
    }

    #[test]
    fn roles_as_logs_come() {
        let mut session = Session::new("m.toml".into(), String::new());
        for (name, expected) in [
            ("train-1.csv", Role::Fit),
            ("train-2.csv", Role::HoldOut),
            ("train-3.csv", Role::HoldOut),
            ("test-1.csv", Role::Test),
        ] {
            let role = session.usual_role(name);
            assert_eq!(role, expected, "{name}");
            session.make_room(role);
            session.logs.push(log(name, role));
        }
    }

    #[test]
    fn a_folder_is_claimed_once() {
        let folder = tempfile::tempdir().unwrap();
        let claim = Claim::of(folder.path()).unwrap();
        assert!(matches!(Claim::of(folder.path()), Err(WorkbenchError::Open(_))));
        drop(claim);
        assert!(Claim::of(folder.path()).is_ok());
    }
}
