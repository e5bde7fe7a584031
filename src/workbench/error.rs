//! Errors of the workbench, which amends models in a browser. Its state, with model and logs, is called the session.

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

/// Kind of an error, which determines the HTTP status.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The request is invalid for this session, for example because a file is not a log.
    Bad,
    /// The session or a file has changed since the page read it.
    Conflict,
    /// The request needs data of a test flight that the user has not opened yet.
    Locked,
    /// The requested object does not exist.
    Missing,
    /// The file system or the program failed.
    Failed,
}

/// Reason why the workbench cannot carry out a request.
#[derive(Debug, thiserror::Error)]
pub enum WorkbenchError {
    /// Another request has changed the session since the page read it.
    #[error(
        "the session was changed in another window: it is at revision {now}, this page was at {seen}; the page \
         shows it as it is now, so do it again if you still mean it"
    )]
    Conflict {
        /// Present revision of the session.
        now: u64,
        /// Revision on which the request is based.
        seen: u64,
    },
    /// The model file has changed since the session read it.
    #[error(
        "{} changed on disk since it was read, so what is shown is not about it; reload the model", path.display()
    )]
    ModelChanged {
        /// Path of the model file.
        path: PathBuf,
    },
    /// A log has changed since the session read it.
    #[error(
        "{} has changed since it was added to the session; take it out of the session and add it again", path.display()
    )]
    LogChanged {
        /// Path of the log.
        path: PathBuf,
    },
    /// The session already contains the log, under this name.
    #[error("this log is in the session already, as {0}")]
    Twice(String),
    /// The name is not allowed for a file.
    #[error("{0:?} is no name for a log; give it a name of letters, digits, dots and dashes")]
    Name(String),
    /// The session has no flight with this index.
    #[error(
        "there is no flight number {0} in the session; it may have been taken out in another window"
    )]
    NoFlight(usize),
    /// The flight is a test flight that the user has not opened yet. Its name is given.
    #[error(
        "{0} is a test flight, which stays unseen until the models are judged by it; press Judge, or give it another role"
    )]
    Locked(String),
    /// No usable flight has this role (fit, hold out, test).
    #[error("no flight that can be used has the role {}; give one that role", .0.word())]
    NoRole(Role),
    /// The session belongs to another model.
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
    /// The amended model would overwrite the model from which it was made.
    #[error("{} is the model to start from, which stays as it is; move it out of the session's folder", .0.display())]
    OverModel(PathBuf),
    /// The fit added none of the accepted effects to the model.
    #[error(
        "no effect was accepted by the data, so there is nothing to save: keep a refused one anyway, or take it back"
    )]
    AllRefused,
    /// A fit that was written to files differs from the computed one when it is read back.
    #[error("the fit written to {} read back with another {what}; report this", folder.display())]
    Lost {
        /// Folder of the written fit.
        folder: PathBuf,
        /// Part of the fit that differs.
        what: String,
    },
    /// An internal error of the program, such as a panic during a computation.
    #[error("a fault of the program, please report it: {0}")]
    Fault(String),
    /// The user cancelled the task.
    #[error("cancelled")]
    Cancelled(#[from] Cancelled),
    /// A new session has no model.
    #[error(
        "a new session needs a model: name one, as in `greylag workbench --model params/x8/prior.toml`"
    )]
    NoModel,
    /// There is nothing to undo or redo.
    #[error("there is nothing to {0}")]
    Nothing(&'static str),
    /// The model has a learned residual (a neural network), whose file an amended model would lack.
    #[error(
        "model {0} has a learned residual, with which no effect can be accepted: open a session with its prior, then \
         learn the residual again"
    )]
    Residual(String),
    /// The model or the session already contains the effect.
    #[error("{0} is in the model already")]
    Present(String),
    /// The logs are read with a mapping file of the user, which the workbench does not change.
    #[error(
        "the logs are read by a mapping of your own; add to its [columns] and start again: {0}"
    )]
    MappingGiven(String),
    /// No factor in a mapping corrects this column.
    #[error(
        "{0} does not come from a single field of this log, so that no factor in a mapping corrects it: state what the outputs drive in the airframe file, or name another field in a mapping"
    )]
    Computed(String),
    /// The mapping file of the session, which assigns log fields to columns, is invalid.
    #[error("cannot add to the mapping {}: it is not a mapping; correct or remove it", .0.display())]
    NoMapping(PathBuf),
    /// At this time (s), the flight has no data from which a free run (open-loop simulation) can start.
    #[error(
        "no free run can start at {0:.1} s: the aircraft is not in the air there, or the log has a gap"
    )]
    NotFlown(f64),
    /// The accepted effects have not been fitted yet.
    #[error("the fit of the accepted effects is not done; wait for it, or take the effect back")]
    Unfitted,
    /// A text is not a valid effect file.
    #[error("{0}")]
    EffectText(String),
    /// The effect is accepted and therefore cannot be removed.
    #[error("{0} is accepted; take it back first")]
    Accepted(String),
    /// No built-in manoeuvre can show which of the two effects the model lacks.
    #[error("no built-in manoeuvre distinguishes {} from {} within 600 s of flight; \
             treat both as indistinguishable, or give `greylag design` larger effects with --values", .0[0], .0[1])]
    NotApart([String; 2]),
    /// A simulated flight is in progress.
    #[error("a flight is on; stop it, or wait for its end")]
    Flying,
    /// The requested simulated flight is not possible, for this reason.
    #[error("cannot fly: {0}")]
    Order(String),
    /// The program was built without the simulator.
    #[error("this program was built without the simulator; build it with the feature sitl")]
    NoSimulator,
    /// The recording does not exist.
    #[error("there is no recording in {}: name the folder that `greylag fly` printed, which holds flight.csv", .0.display())]
    NoRecording(PathBuf),
    /// Another workbench has the session open.
    #[error(
        "another workbench has the session in {} open; use its window, or give --dir another folder", .0.display()
    )]
    Open(PathBuf),
    /// The session file is invalid.
    #[error("cannot read the session {}: {why}; correct the file, or give --dir another folder", path.display())]
    Session {
        /// Path of the session file.
        path: PathBuf,
        /// Error of the file's content.
        why: String,
    },
    /// A file could not be read, or a folder could not be created.
    #[error("cannot use {}: {source}; check that it exists and may be read and written", path.display())]
    Io {
        /// Path of the file or folder.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// A result cannot be represented in JSON.
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
    /// The flight path cannot be reconstructed from the log.
    #[error(transparent)]
    Reconstruct(#[from] ReconstructError),
    /// The model cannot be read.
    #[error(transparent)]
    Model(#[from] FileError),
    /// The files of the amended model cannot be made.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// A file could not be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The comparison of the models failed.
    #[error(transparent)]
    Compare(#[from] CompareError),
    /// The sampling interval of a flight cannot be used.
    #[error(transparent)]
    Clock(#[from] ClockError),
    /// The diagnosis of the model failed.
    #[error(transparent)]
    Diagnose(#[from] DiagnoseError),
    /// The fit of the model failed.
    #[error(transparent)]
    Amend(#[from] AmendError),
    /// A controller cannot be designed for the model.
    #[error(transparent)]
    Control(#[from] greylag_control::SetupError),
    /// The design of a schedule failed.
    #[cfg(feature = "sitl")]
    #[error(transparent)]
    Design(#[from] greylag_sim::design::DesignError),
}

impl WorkbenchError {
    /// The kind of this error.
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

/// The error that the operating system has reported for `path`.
pub(super) fn io(path: &std::path::Path, source: io::Error) -> WorkbenchError {
    WorkbenchError::Io { path: path.into(), source }
}
