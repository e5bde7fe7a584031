//! Options for reading the session's logs. They come from the command line. A mapping file assigns the columns of a log to
//! those of this program. If the command line names none, the session's own mapping is used.

use std::fs;
use std::path::{Path, PathBuf};

use super::bench::{Bench, Inner};
use super::error::{WorkbenchError, io};
use super::flights::Loaded;
use super::mapping::FILE;
use super::session::{LogEntry, Role};
use greylag_logs as logs;
use greylag_logs::csv::Tolerance;
use greylag_logs::mapping::Mapping;
use greylag_logs::quoted;
use greylag_logs::sources::Asked;
use greylag_sysid::amend::document::sha256;

/// Command-line options for reading logs.
#[derive(Clone, Debug, Default)]
pub struct Reading {
    /// Path of the mapping file; `None` if none is named.
    pub mapping: Option<PathBuf>,
    /// Tolerance for unusable rows in a log.
    pub tolerance: Tolerance,
    /// Whether logs with wrong units, signs or axes are used nevertheless.
    pub despite_problems: bool,
    /// Message instances to read in place of the reader's choice.
    pub sources: Vec<Asked>,
}

/// The mapping for reading logs.
#[derive(Clone, Debug, Default)]
pub struct InUse {
    /// Path of the mapping file; `None` without a mapping.
    pub file: Option<PathBuf>,
    /// Content of the mapping file.
    pub text: String,
}

impl Reading {
    /// The options with absolute paths, valid in any working directory.
    pub(super) fn absolute(self) -> Result<Reading, WorkbenchError> {
        let whole = |path: PathBuf| fs::canonicalize(&path).map_err(|e| io(&path, e));
        Ok(Reading { mapping: self.mapping.map(whole).transpose()?, ..self })
    }

    /// The requested instances as words of a command line, each with a space before it.
    pub(super) fn source_words(&self) -> String {
        let word = |asked: &Asked| format!(" --source {}", quoted(Path::new(&asked.to_string())));
        self.sources.iter().map(word).collect()
    }
}

impl Bench {
    /// Adds the log at `path`, which the command line names; does nothing if the session already contains it. A log that cannot
    /// be used is added as an unused flight with its error, so that the session can be opened.
    ///
    /// # Errors
    /// If the file cannot be read or the session cannot be written.
    pub(super) fn add_file(&self, path: &Path) -> Result<(), WorkbenchError> {
        use WorkbenchError as E;
        let path = fs::canonicalize(path).map_err(|e| io(path, e))?;
        let bytes = fs::read(&path).map_err(|e| io(&path, e))?;
        match self.add(self.revision(), path.clone(), &bytes, None) {
            Err(E::Twice(_)) => Ok(()),
            Err(why @ (E::Log(_) | E::Reconstruct(_) | E::Clock(_))) => {
                let entry = LogEntry { path, sha256: sha256(&bytes), role: Role::Unused };
                self.change(self.revision(), |inner| {
                    inner.take_unusable(entry, why.to_string());
                    Ok(())
                })
            }
            other => other,
        }
    }
}

impl Inner {
    /// Adds a log that cannot be used, for the reason `why`. If the session has a log of the same path, it is kept; its own error
    /// states that the file has changed.
    fn take_unusable(&mut self, entry: LogEntry, why: String) {
        let there = self.session.logs.iter().any(|l| self.folder.join(&l.path) == entry.path);
        if !there {
            self.session.logs.push(entry);
            self.flights.push(Err(why));
        }
    }

    /// Loads the mapping of the command line or, without one, the session's mapping if it exists.
    pub fn take_mapping(&mut self) -> Result<(), WorkbenchError> {
        let own = Some(self.folder.join(FILE)).filter(|path| path.exists());
        let Some(file) = self.given.mapping.clone().or(own) else { return Ok(()) };
        let text = fs::read_to_string(&file).map_err(|e| io(&file, e))?;
        self.read_by(&file, text)
    }

    /// Uses the mapping `text`, which is or will be the content of `file`, for reading logs.
    pub fn read_by(&mut self, file: &Path, text: String) -> Result<(), WorkbenchError> {
        self.options.mapping = Mapping::parse(&text, file)?;
        self.mapping = InUse { file: Some(file.into()), text };
        Ok(())
    }

    /// The options in the form of the log readers, without a mapping.
    pub fn options_of(given: &Reading) -> logs::Options {
        let sources = given.sources.clone();
        logs::Options { tolerance: given.tolerance, sources, ..Default::default() }
    }

    /// Reads all logs again, and gives all flights the installation that some of them show.
    pub fn reread(&mut self) {
        let read = |entry: &LogEntry| {
            Loaded::read(entry, &self.folder, &self.options, &self.model).map_err(|e| e.to_string())
        };
        self.flights = self.session.logs.iter().map(read).collect();
        self.share_installation();
    }
}
