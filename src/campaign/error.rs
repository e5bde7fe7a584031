//! What can be wrong with a campaign.

use std::io;
use std::path::{Path, PathBuf};

/// Why a campaign cannot be planned, read or written.
#[derive(Debug, thiserror::Error)]
pub enum CampaignError {
    /// The campaign file cannot be read.
    #[error("cannot read campaign file {path}: {source}; name a file such as params/campaigns/small.toml", path = path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The campaign file says something that cannot be done.
    #[error("campaign file {path}: {why}", path = path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong, and what to do.
        why: String,
    },
    /// A file of the campaign's folder or an input cannot be used.
    #[error("{doing} {path}: {source}", path = path.display())]
    Io {
        /// What was being done.
        doing: &'static str,
        /// To which file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// A file does not hold what its name says.
    #[error("{path} {why}", path = path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong, and what to do.
        why: String,
    },
}

impl CampaignError {
    /// An error of the system while `doing` something to `path`.
    pub(super) fn io(doing: &'static str, path: &Path) -> impl FnOnce(io::Error) -> CampaignError {
        move |source| CampaignError::Io { doing, path: path.into(), source }
    }

    /// A file that does not hold what it should.
    pub(super) fn content(path: &Path, why: impl ToString) -> CampaignError {
        CampaignError::Content { path: path.into(), why: why.to_string() }
    }
}
