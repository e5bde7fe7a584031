//! Errors of the workbench's requests.

use std::io;
use std::path::PathBuf;

use super::session::Role;
use greylag_logs::LogError;
use greylag_logs::csv::CsvError;
use greylag_logs::mapping::MappingError;
use greylag_physics::airframe::FileError;
use greylag_report::WriteError;
use greylag_sysid::amend::AmendError;
use greylag_sysid::amend::document::DocumentError;
use greylag_sysid::compare::CompareError;
use greylag_sysid::diagnose::DiagnoseError;
use greylag_sysid::flight_path::ReconstructError;
use greylag_sysid::progress::Cancelled;
use greylag_sysid::weak_form::prepared::ClockError;

/// Kind of a failure, which sets the status of the HTTP answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The request does not fit the session, for example a file that is not a log.
    Bad,
    /// The session has moved on since the requester looked.
    Conflict,
    /// The data are locked until the test flights are opened.
    Locked,
    /// The requested object does not exist.
    Missing,
    /// The disk or the program failed.
    Failed,
}

/// Reason why the workbench cannot carry out a request.
#[derive(Debug, thiserror::Error)]
pub enum WorkbenchError {
    /// Someone else changed the session first.
    #[error(
        "the session was changed in another window: it is at revision {now}, this page was at {seen}; the page \
         shows it as it is now, so do it again if you still mean it"
    )]
    Conflict {
        /// Present revision of the session.
        now: u64,
        /// Revision that the requester saw.
        seen: u64,
    },
    /// The model file has changed since it was read.
    #[error(
        "{} changed on disk since it was read, so what is shown is not about it; reload the model", path.display()
    )]
    ModelChanged {
        /// Path of the model file.
        path: PathBuf,
    },
    /// A log has changed since it was read.
    #[error(
        "{} is not the log that the session knows: its content changed; take it out of the session and add it again", path.display()
    )]
    LogChanged {
        /// Path of the log.
        path: PathBuf,
    },
    /// The session has the log already.
    #[error("this log is in the session already, as {0}")]
    Twice(String),
    /// A name that no file may have.
    #[error("{0:?} is no name for a log; give it a name of letters, digits, dots and dashes")]
    Name(String),
    /// No flight of that number.
    #[error(
        "there is no flight number {0} in the session; it may have been taken out in another window"
    )]
    NoFlight(usize),
    /// The test is not open.
    #[error(
        "{0} is a test flight, which stays unseen until the models are judged by it; press Judge, or give it another role"
    )]
    Locked(String),
    /// A role has no flight.
    #[error("no flight that can be used has the role {}; give one that role", .0.word())]
    NoRole(Role),
    /// The session is about another model.
    #[error(
        "the session in {} is about the model {}; leave --model out, or give --dir another folder",
        folder.display(),
        model.display()
    )]
    OtherModel {
        /// Folder of the session.
        folder: PathBuf,
        /// Path of the session's model.
        model: PathBuf,
    },
    /// The amended model would replace the model from which it was made.
    #[error("{} is the model to start from, which stays as it is; move it out of the session's folder", .0.display())]
    OverModel(PathBuf),
    /// No effect joined the model.
    #[error(
        "no effect was accepted by the data, so there is nothing to save: keep a refused one anyway, or take it back"
    )]
    AllRefused,
    /// A written fit is another one.
    #[error("the fit written to {} read back with another {what}; report this", folder.display())]
    Lost {
        /// Folder of the written fit.
        folder: PathBuf,
        /// Part of the fit that differs.
        what: String,
    },
    /// A failure inside the program, such as a panic of a job.
    #[error("a fault of the program, please report it: {0}")]
    Fault(String),
    /// The user cancelled the task.
    #[error("cancelled")]
    Cancelled(#[from] Cancelled),
    /// A new session was given no model.
    #[error(
        "a new session needs a model: name one, as in `greylag workbench --model params/x8/prior.toml`"
    )]
    NoModel,
    /// There is nothing to undo or redo.
    #[error("there is nothing to {0}")]
    Nothing(&'static str),
    /// The session has the effect already.
    #[error("{0} is in the model already")]
    Present(String),
    /// The mapping is the user's own.
    #[error(
        "the logs are read by a mapping of your own; add this line to its [columns] and start again: {0}"
    )]
    MappingGiven(String),
    /// The session's mapping is broken.
    #[error("cannot add to the mapping {}: it is no mapping; mend or remove it", .0.display())]
    NoMapping(PathBuf),
    /// The moment is not flown.
    #[error(
        "no free run can start at {0:.1} s: the aircraft is not in the air there, or the log has a gap"
    )]
    NotFlown(f64),
    /// The fit is not done.
    #[error("the fit of the accepted effects is not done; wait for it, or take the effect back")]
    Unfitted,
    /// A text is not an effect file.
    #[error("{0}")]
    EffectText(String),
    /// The effect is accepted.
    #[error("{0} is accepted; take it back first")]
    Accepted(String),
    /// No manoeuvre of the menu distinguishes the two effects.
    #[error("no manoeuvre of the menu tells {} from {} within ten minutes; take both as one, or give `greylag design` larger --values", .0[0], .0[1])]
    NotApart([String; 2]),
    /// A flight is on.
    #[error("a flight is on; stop it, or wait for its end")]
    Flying,
    /// The order of a flight cannot be carried out.
    #[error("cannot fly: {0}")]
    Order(String),
    /// The program has no simulator.
    #[error("this program was built without the simulator; build it with the feature sitl")]
    NoSimulator,
    /// The recording does not exist.
    #[error("there is no recording in {}: name the folder that `greylag fly` printed, which holds flight.csv", .0.display())]
    NoRecording(PathBuf),
    /// The session is open elsewhere.
    #[error(
        "another workbench has the session in {} open; use its window, or give --dir another folder", .0.display()
    )]
    Open(PathBuf),
    /// The session file is broken.
    #[error("cannot read the session {}: {why}; mend the file, or give --dir another folder", path.display())]
    Session {
        /// Path of the session file.
        path: PathBuf,
        /// Error of the file's content.
        why: String,
    },
    /// A file could not be read or a folder not be made.
    #[error("cannot use {}: {source}; check that it exists and may be read and written", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// A result has no place in JSON.
    #[error("cannot write a result as JSON: {0}")]
    Json(#[from] serde_json::Error),
    /// The log cannot be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// A recording cannot be read.
    #[error(transparent)]
    Recording(#[from] CsvError),
    /// The mapping cannot be read.
    #[error(transparent)]
    Mapping(#[from] MappingError),
    /// The log cannot be used.
    #[error(transparent)]
    Reconstruct(#[from] ReconstructError),
    /// The model cannot be read.
    #[error(transparent)]
    Model(#[from] FileError),
    /// The files of an amended model cannot be made.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// A file was not written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The comparison of the models failed.
    #[error(transparent)]
    Compare(#[from] CompareError),
    /// A flight without a clock.
    #[error(transparent)]
    Clock(#[from] ClockError),
    /// The diagnosis of the model failed.
    #[error(transparent)]
    Diagnose(#[from] DiagnoseError),
    /// The fit of the model failed.
    #[error(transparent)]
    Amend(#[from] AmendError),
    /// No controller for the model.
    #[error(transparent)]
    Control(#[from] greylag_control::SetupError),
    /// The design of a schedule failed.
    #[cfg(feature = "sitl")]
    #[error(transparent)]
    Design(#[from] greylag_sim::design::DesignError),
}

impl WorkbenchError {
    /// Kind of the failure.
    pub fn kind(&self) -> Kind {
        use WorkbenchError as E;
        match self {
            E::Conflict { .. } | E::ModelChanged { .. } | E::LogChanged { .. } => Kind::Conflict,
            E::Locked(_) => Kind::Locked,
            E::NoFlight(_) => Kind::Missing,
            E::Io { .. } | E::Json(_) | E::Write(_) | E::Session { .. } => Kind::Failed,
            E::Lost { .. } | E::Fault(_) | E::Document(_) => Kind::Failed,
            _ => Kind::Bad,
        }
    }
}

/// A failure of the system at `path`.
pub(super) fn io(path: &std::path::Path, source: io::Error) -> WorkbenchError {
    WorkbenchError::Io { path: path.into(), source }
}
