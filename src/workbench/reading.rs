//! Options for reading the session's logs: those of the command line, with the session's own
//! mapping if it names none.

use std::fs;
use std::path::{Path, PathBuf};

use super::bench::Inner;
use super::error::{WorkbenchError, io};
use super::flights::Loaded;
use super::mapping::FILE;
use greylag_logs as logs;
use greylag_logs::csv::Tolerance;
use greylag_logs::mapping::Mapping;
use greylag_logs::sources::Asked;

/// Options of a command line for reading logs.
#[derive(Clone, Debug, Default)]
pub struct Reading {
    /// Path of the mapping file, if one is named.
    pub mapping: Option<PathBuf>,
    /// How many unusable rows a log may have.
    pub tolerance: Tolerance,
    /// Whether logs are used in which wrong units, signs or axes were found.
    pub despite_problems: bool,
    /// Instances to read instead of those that the reader would choose.
    pub sources: Vec<Asked>,
}

/// The mapping that logs are read by.
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
}

impl Inner {
    /// Loads the mapping that was named, or else the session's if it has one.
    pub fn take_mapping(&mut self) -> Result<(), WorkbenchError> {
        let own = Some(self.folder.join(FILE)).filter(|path| path.exists());
        let Some(file) = self.given.mapping.clone().or(own) else { return Ok(()) };
        let text = fs::read_to_string(&file).map_err(|e| io(&file, e))?;
        self.read_by(&file, text)
    }

    /// Reads the logs by the mapping `text`, the present or future content of `file`.
    pub fn read_by(&mut self, file: &Path, text: String) -> Result<(), WorkbenchError> {
        self.options.mapping = Mapping::parse(&text, file)?;
        self.mapping = InUse { file: Some(file.into()), text };
        Ok(())
    }

    /// The settings of the readers of logs.
    pub fn options_of(given: &Reading) -> logs::Options {
        let sources = given.sources.clone();
        logs::Options { tolerance: given.tolerance, sources, ..Default::default() }
    }

    /// Reads all logs again.
    pub fn reread(&mut self) {
        let read = |entry: &super::session::LogEntry| {
            Loaded::read(entry, &self.folder, &self.options, &self.model).map_err(|e| e.to_string())
        };
        self.flights = self.session.logs.iter().map(read).collect();
    }
}
