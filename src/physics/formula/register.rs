//! The effects of files: those that the program ships, and those that this process has read.
//!
//! An effect of a file is asked for by its id, as one of the catalogue is, and both live as long as the process: a
//! file that is read again is the same effect, one that was edited in between takes its place for whoever asks
//! next. Models that were loaded before keep what they have.

use std::path::{Path, PathBuf};
use std::sync::{LazyLock, PoisonError, RwLock};

use include_dir::{Dir, include_dir};

use super::file;
use super::written::Written;
use crate::airframe::FileError;

static READ: RwLock<Vec<&'static Written>> = RwLock::new(Vec::new());

static FOLDER: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/../../params/catalogue");

static SHIPPED: LazyLock<Vec<Written>> = LazyLock::new(|| {
    let texts = FOLDER.files().filter_map(|f| f.contents_utf8());
    texts.filter_map(|text| file::parse(text).ok()).collect()
});

/// The effects of the files that belong to the catalogue, in the order of their ids.
pub fn shipped() -> &'static [Written] {
    &SHIPPED
}

/// The effect of that id: of a file that was read, or else of one that belongs to the catalogue.
pub fn find(id: &str) -> Option<&'static Written> {
    let read = READ.read().unwrap_or_else(PoisonError::into_inner);
    let own = read.iter().rev().copied().find(|effect| effect.about.id == id);
    own.or_else(|| shipped().iter().find(|effect| effect.about.id == id))
}

/// Reads the text of an effect file and notes the effect.
///
/// # Errors
/// What is wrong with the text, where, and what to do.
pub fn read(text: &str) -> Result<&'static Written, String> {
    let known = |all: &[&'static Written]| all.iter().copied().find(|e| e.text == text);
    let parsed = match known(&READ.read().unwrap_or_else(PoisonError::into_inner)) {
        Some(effect) => effect,
        None => Box::leak(Box::new(file::parse(text)?)),
    };
    let mut all = READ.write().unwrap_or_else(PoisonError::into_inner);
    // the newest of an id is at the end
    all.retain(|e| e.text != text);
    all.push(parsed);
    Ok(parsed)
}

/// Reads an effect file, or every `.toml` of a folder, in the order of their names.
///
/// # Errors
/// If a file cannot be read or is no effect file.
pub fn load(path: &Path) -> Result<Vec<&'static Written>, FileError> {
    let what = "effect file";
    let unread = |path: &Path, why| FileError::Read {
        what,
        path: path.into(),
        why,
        example: "../effects/yaw_by_throttle.toml",
    };
    let mut files: Vec<PathBuf> = vec![path.into()];
    if path.is_dir() {
        let entries = std::fs::read_dir(path).map_err(|why| unread(path, why))?;
        let all = entries.filter_map(|e| e.ok().map(|e| e.path()));
        files = all.filter(|p| p.extension().is_some_and(|e| e == "toml")).collect();
        files.sort();
    }
    let one = |path: &PathBuf| {
        let text = std::fs::read_to_string(path).map_err(|why| unread(path, why))?;
        read(&text).map_err(|why| FileError::Content { what, path: path.clone(), why })
    };
    files.iter().map(one).collect()
}
