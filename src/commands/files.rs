//! Checks and writes the output files that a user names on the command line.

use std::ffi::OsString;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use serde::Serialize;

pub use super::shipped::shipped;
use crate::logs::quoted;
use crate::report;

/// Whether an existing file may be replaced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Overwrite {
    /// An existing file is kept, and the command fails. The command has no option `--force`.
    New,
    /// An existing file is kept, and the command fails. The option `--force` was not given.
    Never,
    /// An existing file is replaced (option `--force`).
    Force,
}

impl From<bool> for Overwrite {
    fn from(force: bool) -> Self {
        if force { Overwrite::Force } else { Overwrite::Never }
    }
}

/// Whether a path denotes standard output: `-` or `/dev/stdout`.
pub fn is_stdout(path: Option<&Path>) -> bool {
    path.is_some_and(|path| [Path::new("-"), Path::new("/dev/stdout")].contains(&path))
}

/// The option `--json` of a command.
#[derive(clap::Args, Clone, Debug)]
pub struct JsonArgument {
    /// Write all results as JSON; `-` for standard output, with nothing else on it.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Result of a command, with its schema and the program's version.
#[derive(Serialize)]
struct Document<'a, T> {
    schema: &'static str,
    program: &'static str,
    #[serde(flatten)]
    content: &'a T,
}

impl JsonArgument {
    /// The path that was given.
    pub fn path(&self) -> Option<&PathBuf> {
        self.json.as_ref()
    }

    /// Fails if the JSON file cannot be written, see `writable`.
    pub fn writable(&self, overwrite: Overwrite) -> Result<()> {
        self.json.as_ref().map_or(Ok(()), |path| writable(path, overwrite))
    }

    /// Whether the JSON goes to standard output, which then holds nothing else.
    pub fn takes_stdout(&self) -> bool {
        is_stdout(self.json.as_deref())
    }

    /// Writes `content` with its schema to the file of `--json`. Does nothing without this option.
    pub fn write(
        &self,
        schema: &'static str,
        content: &impl Serialize,
        overwrite: Overwrite,
    ) -> Result<()> {
        let Some(path) = &self.json else { return Ok(()) };
        let program = concat!("greylag ", env!("CARGO_PKG_VERSION"));
        let document = Document { schema, program, content };
        write(path, &(serde_json::to_string_pretty(&document)? + "\n"), overwrite)
    }
}

/// Fails if `path` cannot be written. A command calls this before a long computation, whose result would otherwise be lost.
pub fn writable(path: &Path, overwrite: Overwrite) -> Result<()> {
    if is_stdout(Some(path)) {
        return Ok(());
    }
    let remedy = match overwrite {
        Overwrite::New => Some("name another file"),
        Overwrite::Never => Some("name another file, or give --force to replace it"),
        Overwrite::Force => None,
    };
    // a symbolic link exists even if its target does not
    if let Some(remedy) = remedy.filter(|_| path.symlink_metadata().is_ok()) {
        bail!("{} exists; {remedy}", path.display());
    }
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if path.is_dir() || !folder.is_dir() {
        bail!("cannot write {}: name a file in a folder that exists", path.display());
    }
    Ok(())
}

/// Writes `content` to a temporary file that then becomes `path`, so that no incomplete file remains. The paths `-` and
/// `/dev/stdout` are standard output. Other devices and named pipes are opened and receive the content.
pub fn write(path: &Path, content: &str, overwrite: Overwrite) -> Result<()> {
    writable(path, overwrite)?;
    if is_stdout(Some(path)) {
        return match std::io::stdout().write_all(content.as_bytes()) {
            // the reader has closed the pipe, as in `greylag … | head`; other files may follow
            Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
            written => written.context("cannot write to standard output"),
        };
    }
    match overwrite {
        Overwrite::New | Overwrite::Never => report::write_new(path, content)?,
        Overwrite::Force => report::write_over(path, content)?,
    }
    Ok(())
}

/// The command line of this run, for reports.
pub fn command_line() -> String {
    line_of(std::env::args_os().skip(1))
}

/// The command line with these arguments, quoted for a shell. Bytes that are not valid Unicode are replaced.
fn line_of(arguments: impl Iterator<Item = OsString>) -> String {
    arguments.fold("greylag".into(), |line, word| line + " " + &quoted(Path::new(&word)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn force_is_named_where_there_is_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("there.json");
        std::fs::write(&path, "mine").unwrap();
        let said = |overwrite| writable(&path, overwrite).unwrap_err().to_string();
        assert!(said(Overwrite::New).contains("name another file"));
        assert!(!said(Overwrite::New).contains("--force"));
        assert!(said(false.into()).contains("--force"));
        writable(&path, Overwrite::Force).unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn a_command_line_is_written_whatever_its_words_are() {
        use std::os::unix::ffi::OsStringExt;
        let words = [b"compare".to_vec(), b"my flight.csv".to_vec(), b"fl\xfcg.csv".to_vec()];
        let line = line_of(words.into_iter().map(OsString::from_vec));
        assert_eq!(line, "greylag compare 'my flight.csv' 'fl\u{fffd}g.csv'");
    }
}
