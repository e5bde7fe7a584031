//! Registry of the effects that are defined by effect files (TOML): effects of shipped files, and effects of files that this
//! process has read. An effect is one physical contribution to the forces and moments of a model.
//!
//! These effects are found by their ids, like the effects that are compiled into the program. An effect that was read is kept
//! until the process ends. If its file is read again unchanged, the same effect is returned. If the file was edited in between,
//! [`find`] returns the new effect from then on, and models that were loaded before keep the earlier effect.

use std::io;
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

/// Effects of the shipped files, in the order of their ids.
pub fn shipped() -> &'static [Written] {
    &SHIPPED
}

/// The most recently read effect with this id. If none was read, the shipped one. `None` if there is no such effect.
pub fn find(id: &str) -> Option<&'static Written> {
    let read = READ.read().unwrap_or_else(PoisonError::into_inner);
    let own = read.iter().rev().copied().find(|effect| effect.about.id == id);
    own.or_else(|| shipped().iter().find(|effect| effect.about.id == id))
}

/// Parses the text of an effect file and registers the effect.
///
/// # Errors
/// If the text is not a valid effect file. The error describes the fault with its position, and the remedy.
pub fn read(text: &str) -> Result<&'static Written, String> {
    let known = |all: &[&'static Written]| all.iter().copied().find(|e| e.text == text);
    let parsed = match known(&READ.read().unwrap_or_else(PoisonError::into_inner)) {
        Some(effect) => effect,
        None => Box::leak(Box::new(file::parse(text)?)),
    };
    let mut all = READ.write().unwrap_or_else(PoisonError::into_inner);
    // the newest effect with an id is at the end
    all.retain(|e| e.text != text);
    all.push(parsed);
    Ok(parsed)
}

/// Reads an effect file, or every `.toml` file of a folder in the order of the names.
///
/// # Errors
/// If a file cannot be read or is not an effect file.
pub fn load(path: &Path) -> Result<Vec<&'static Written>, FileError> {
    let what = "effect file";
    let unread = |path: &Path, why| FileError::Read {
        what,
        path: path.into(),
        why,
        example: "../effects/yaw_by_throttle.toml",
    };
    let files = files(path).map_err(|why| unread(path, why))?;
    let one = |path: &PathBuf| {
        let text = crate::text_file::read(path).map_err(|why| unread(path, why))?;
        read(&text).map_err(|why| FileError::Content { what, path: path.clone(), why })
    };
    files.iter().map(one).collect()
}

/// The effect files at `path`: the file itself, or every `.toml` file of a folder in the order of the names.
///
/// # Errors
/// If the folder cannot be read.
pub fn files(path: &Path) -> io::Result<Vec<PathBuf>> {
    if !path.is_dir() {
        return Ok(vec![path.into()]);
    }
    let entries = std::fs::read_dir(path)?;
    let mut files = entries.map(|e| Ok(e?.path())).collect::<io::Result<Vec<PathBuf>>>()?;
    files.retain(|p| p.extension().is_some_and(|e| e == "toml"));
    files.sort();
    Ok(files)
}
