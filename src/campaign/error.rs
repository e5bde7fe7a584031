//! Errors of planning, reading and writing campaigns. A campaign is a planned set of runs of this program, for example one
//! run for each model and seed.

use std::io;
use std::path::{Path, PathBuf};

/// A campaign cannot be planned, read or written.
#[derive(Debug, thiserror::Error)]
pub enum CampaignError {
    /// The operating system cannot read the campaign file.
    #[error("cannot read campaign file {path}: {source}; name a file such as params/campaigns/small.toml", path = path.display())]
    Read {
        /// Path of the file.
        path: PathBuf,
        /// The operating system's error.
        source: io::Error,
    },
    /// The campaign file is invalid.
    #[error("campaign file {path}: {why}", path = path.display())]
    File {
        /// Path of the file.
        path: PathBuf,
        /// The fault and its remedy.
        why: String,
    },
    /// An operation on an input or on a file in the campaign's folder failed.
    #[error("{doing} {path}: {source}", path = path.display())]
    Io {
        /// The operation that failed, as the beginning of the message.
        doing: &'static str,
        /// Path of the file.
        path: PathBuf,
        /// The operating system's error.
        source: io::Error,
    },
    /// A file has the wrong contents.
    #[error("{path} {why}", path = path.display())]
    Content {
        /// Path of the file.
        path: PathBuf,
        /// The fault and its remedy.
        why: String,
    },
}

impl CampaignError {
    /// Returns a function that turns an I/O error of the operation `doing` on `path` into a [`CampaignError::Io`].
    pub(super) fn io(doing: &'static str, path: &Path) -> impl FnOnce(io::Error) -> CampaignError {
        move |source| CampaignError::Io { doing, path: path.into(), source }
    }

    /// The error for a file `path` with wrong contents. `why` completes a sentence that begins with the path.
    pub(super) fn content(path: &Path, why: impl ToString) -> CampaignError {
        CampaignError::Content { path: path.into(), why: why.to_string() }
    }
}
