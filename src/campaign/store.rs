//! What a campaign has on disk: a folder a cell, in it one result, written whole.

use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::cell::{Cell, Record};
use super::error::CampaignError;

/// The line of a cell that is done.
const RESULT: &str = "result.json";
/// Why a cell will never be done.
const FAILURE: &str = "failure.json";
/// What a cell took.
const TIMES: &str = "times.json";
/// Held while a cell runs.
const LOCK: &str = "lock";
/// There since a cell began.
const BEGUN: &str = "begun";

/// The folder of a campaign.
#[derive(Clone, Debug)]
pub struct Store {
    folder: PathBuf,
}

/// How a cell stands.
#[derive(Clone, Debug, PartialEq)]
pub enum Standing {
    /// It has its result.
    Done(Box<Record>),
    /// It failed, and would fail again.
    Failed(Failure),
    /// It began and has no result: it runs, or was stopped.
    Begun,
    /// It has a result of another command or of other inputs, which does not count.
    Stale,
    /// Nothing is there.
    Missing,
}

/// Why a cell will never be done.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Failure {
    /// The error.
    pub error: String,
    /// The program that said so.
    pub program: String,
}

/// What a cell took, and where: kept apart from its result, which is the same everywhere.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Times {
    /// The cell.
    pub cell: String,
    /// Time of the session that ended it, s.
    pub seconds: f64,
    /// Time of all cores together in that session, s.
    pub core_seconds: f64,
    /// Whether an earlier session had begun it: its time is then not the whole.
    pub resumed: bool,
    /// When it ended, seconds since 1970 UTC.
    pub ended_unix_s: u64,
    /// The processor.
    pub processor: String,
    /// The program and its build.
    pub program: String,
}

/// The right to run a cell: no other process of any machine with the same disk has it.
#[derive(Debug)]
pub struct Claimed {
    /// The cell's folder.
    pub folder: PathBuf,
    /// Whether an earlier session had begun it.
    pub resumed: bool,
    _lock: File,
}

impl Store {
    /// The campaign's folder.
    pub fn new(folder: &Path) -> Store {
        Store { folder: folder.into() }
    }

    /// The campaign's folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The folder of a cell.
    pub fn folder_of(&self, cell: &Cell) -> PathBuf {
        self.folder.join(cell.folder())
    }

    /// How a cell stands.
    ///
    /// # Errors
    /// If a result is there and cannot be read.
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

    /// Whether there is a result of the same stage and levels with another identity.
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

    /// The right to run a cell; `None` while another process has it.
    ///
    /// # Errors
    /// If the folder cannot be made or locked.
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

    /// What a cell took, if it is known.
    ///
    /// # Errors
    /// If it is there and cannot be read.
    pub fn times(&self, cell: &Cell) -> Result<Option<Times>, CampaignError> {
        read(&self.folder_of(cell).join(TIMES))
    }
}

impl Claimed {
    /// Writes the result; the cell is done from then on.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn finish(&self, record: &Record, times: &Times) -> Result<(), CampaignError> {
        write(&self.folder.join(TIMES), times)?;
        write(&self.folder.join(RESULT), record)
    }

    /// Notes that the cell will never be done.
    ///
    /// # Errors
    /// If it cannot be written.
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
    let wrong =
        |e| CampaignError::content(path, format!("is not what it should be: {e}; delete it"));
    serde_json::from_str(&text).map(Some).map_err(wrong)
}

/// Writes a document in one line: a reader sees all of it or nothing.
fn write<T: Serialize>(path: &Path, document: &T) -> Result<(), CampaignError> {
    let line = serde_json::to_string(document).map_err(|e| CampaignError::content(path, e))?;
    whole(path, line + "\n")
}

/// Writes a file beside its place and renames it there.
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
