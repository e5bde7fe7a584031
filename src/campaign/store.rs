//! A campaign on disk: each cell has a folder with one result, which is written atomically.
//!
//! A cell is one run of a stage's command at one combination of the levels of the campaign's axes. Its identity is a hash over
//! the program version, the command and the input files.

use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::cell::{Cell, Record};
use super::error::CampaignError;

/// File of a finished cell's result.
const RESULT: &str = "result.json";
/// File with the reason of a permanent failure.
const FAILURE: &str = "failure.json";
/// File with a cell's computing time.
const TIMES: &str = "times.json";
/// File on which the process that runs the cell holds a lock.
const LOCK: &str = "lock";
/// File that marks a started cell.
const BEGUN: &str = "begun";

/// The folder of a campaign.
#[derive(Clone, Debug)]
pub struct Store {
    folder: PathBuf,
}

/// State of a cell.
#[derive(Clone, Debug, PartialEq)]
pub enum Standing {
    /// The cell has a result.
    Done(Box<Record>),
    /// The cell failed permanently: another run would fail as well.
    Failed(Failure),
    /// The cell has started and has no result: it is running or was interrupted.
    Begun,
    /// The cell has no result, but an old result of another command, input or program version exists.
    Stale,
    /// The cell has not started, and no old result exists.
    Missing,
}

/// Reason of a permanent failure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Failure {
    /// Text of the error.
    pub error: String,
    /// Version and build of the program.
    pub program: String,
}

/// Computing time and processor of a cell. They are stored apart from the result, which does not depend on the machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Times {
    /// Id of the cell.
    pub cell: String,
    /// Wall time of the process that finished the cell, s.
    pub seconds: f64,
    /// Processor time of that process over all cores, s.
    pub core_seconds: f64,
    /// Whether an earlier process had started the cell. If so, the times exclude the earlier process.
    pub resumed: bool,
    /// Time at which the cell ended, s since 1970-01-01 UTC.
    pub ended_unix_s: u64,
    /// Model of the processor.
    pub processor: String,
    /// Version and build of the program.
    pub program: String,
}

/// Exclusive lock on a cell: no other process that uses the same campaign folder runs this cell.
#[derive(Debug)]
pub struct Claimed {
    /// Folder of the cell.
    pub folder: PathBuf,
    /// Whether an earlier process had started the cell.
    pub resumed: bool,
    _lock: File,
}

impl Store {
    /// A store in the campaign's folder.
    pub fn new(folder: &Path) -> Store {
        Store { folder: folder.into() }
    }

    /// Path of the campaign's folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Path of a cell's folder.
    pub fn folder_of(&self, cell: &Cell) -> PathBuf {
        self.folder.join(cell.folder())
    }

    /// State of a cell, from the files in the campaign's folder.
    ///
    /// # Errors
    ///
    /// If a result or a failure record exists and cannot be read, or if the result belongs to another cell.
    pub fn standing(&self, cell: &Cell) -> Result<Standing, CampaignError> {
        let folder = self.folder_of(cell);
        if let Some(record) = read::<Record>(&folder.join(RESULT))? {
            let path = folder.join(RESULT);
            return match record.identity == cell.identity && record.schema == Record::SCHEMA {
                true => Ok(Standing::Done(Box::new(record))),
                false => {
                    Err(CampaignError::content(&path, "is of another cell; delete its folder"))
                }
            };
        }
        if let Some(failure) = read(&folder.join(FAILURE))? {
            return Ok(Standing::Failed(failure));
        }
        if folder.join(BEGUN).exists() {
            return Ok(Standing::Begun);
        }
        Ok(if self.has_other(cell) { Standing::Stale } else { Standing::Missing })
    }

    /// Whether the stage and levels of `cell` have a result with another identity.
    fn has_other(&self, cell: &Cell) -> bool {
        let (stem, own) = (cell.stem() + "-", cell.folder());
        let Ok(entries) = std::fs::read_dir(&self.folder) else { return false };
        entries.flatten().any(|entry| {
            let name = entry.file_name().to_string_lossy().into_owned();
            let hash = name.strip_prefix(&stem).unwrap_or_default();
            let hexadecimal = hash.len() == 12 && hash.chars().all(|c| c.is_ascii_hexdigit());
            hexadecimal && name != own && entry.path().join(RESULT).exists()
        })
    }

    /// Locks a cell, marks it as started and removes an earlier failure record. Returns `None` if another process holds the
    /// lock.
    ///
    /// # Errors
    ///
    /// If the folder or one of its files cannot be created, locked or removed.
    pub fn claim(&self, cell: &Cell) -> Result<Option<Claimed>, CampaignError> {
        let folder = self.folder_of(cell);
        std::fs::create_dir_all(&folder).map_err(CampaignError::io("cannot make", &folder))?;
        let path = folder.join(LOCK);
        let lock = File::create(&path).map_err(CampaignError::io("cannot write", &path))?;
        match lock.try_lock() {
            Ok(()) => (),
            Err(TryLockError::WouldBlock) => return Ok(None),
            Err(TryLockError::Error(e)) => return Err(CampaignError::io("cannot lock", &path)(e)),
        }
        let begun = folder.join(BEGUN);
        let resumed = begun.exists();
        File::create(&begun).map_err(CampaignError::io("cannot write", &begun))?;
        remove(&folder.join(FAILURE))?;
        Ok(Some(Claimed { folder, resumed, _lock: lock }))
    }

    /// Computing time of a cell; `None` if it is not recorded.
    ///
    /// # Errors
    ///
    /// If the file exists and cannot be read.
    pub fn times(&self, cell: &Cell) -> Result<Option<Times>, CampaignError> {
        read(&self.folder_of(cell).join(TIMES))
    }
}

impl Claimed {
    /// Writes the computing time and the result. The result marks the cell as finished.
    ///
    /// # Errors
    ///
    /// If one of the two files cannot be written.
    pub fn finish(&self, record: &Record, times: &Times) -> Result<(), CampaignError> {
        write(&self.folder.join(TIMES), times)?;
        write(&self.folder.join(RESULT), record)
    }

    /// Records a permanent failure of the cell.
    ///
    /// # Errors
    ///
    /// If the file cannot be written.
    pub fn fail(&self, failure: &Failure) -> Result<(), CampaignError> {
        write(&self.folder.join(FAILURE), failure)
    }
}

fn read<T: serde::de::DeserializeOwned>(path: &Path) -> Result<Option<T>, CampaignError> {
    let text = match std::fs::read_to_string(path) {
        Ok(text) => text,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(e) => return Err(CampaignError::io("cannot read", path)(e)),
    };
    let wrong = |e| CampaignError::content(path, format!("has invalid contents: {e}; delete it"));
    serde_json::from_str(&text).map(Some).map_err(wrong)
}

/// Writes `document` atomically as one line of JSON.
fn write<T: Serialize>(path: &Path, document: &T) -> Result<(), CampaignError> {
    let line = serde_json::to_string(document).map_err(|e| CampaignError::content(path, e))?;
    whole(path, line + "\n")
}

/// Writes `text` to a temporary file in the folder of `path`, then renames that file to `path`.
pub(super) fn whole(path: &Path, text: String) -> Result<(), CampaignError> {
    let part = path.with_extension(format!("part-{}", std::process::id()));
    let cannot = || CampaignError::io("cannot write", path);
    let put = |mut file: File| {
        std::io::Write::write_all(&mut file, text.as_bytes())?;
        file.sync_all()
    };
    File::create(&part).and_then(put).map_err(cannot())?;
    std::fs::rename(&part, path).map_err(cannot())
}

fn remove(path: &Path) -> Result<(), CampaignError> {
    match std::fs::remove_file(path) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
            Err(CampaignError::io("cannot remove", path)(e))
        }
        _ => Ok(()),
    }
}
