//! Resolves the effects that a user names by id, by effect file or by a folder of effect files.
//!
//! An effect is one term of the forces, moments or control inputs in an aircraft model, such as the stall. An effect file defines
//! an effect by a formula.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Result, bail};

use crate::commands::files::shipped;
use crate::logs::quoted;
use crate::physics::effects::Kind;
use crate::physics::formula::register;

/// The ids of `effects`. Each entry is an id, an effect file or a folder of effect files. The effects of the files are
/// registered, so that the program finds them by id.
///
/// # Errors
/// If a file cannot be read or is no effect file, or a folder contains no effect file.
pub fn named_effects(effects: &[String]) -> Result<Vec<String>> {
    let mut ids: Vec<String> = Vec::new();
    for named in effects {
        let path = shipped(Path::new(named));
        if !is_file(named) && !path.is_dir() {
            ids.push(named.clone());
            continue;
        }
        let read = register::load(&path)?;
        if read.is_empty() {
            bail!("{} holds no effect file; put one with .toml at its end there", path.display());
        }
        ids.extend(read.iter().map(|effect| effect.about.id.to_owned()));
    }
    Ok(ids)
}

/// Maps ids to files: for each effect that `effects` names by file or folder, the path of its file. The path is quoted for a
/// command line.
///
/// # Errors
/// If a file cannot be read or is no effect file.
pub fn file_words(effects: &[String]) -> Result<BTreeMap<String, String>> {
    let mut words = BTreeMap::new();
    for named in effects {
        let path = Path::new(named);
        let files = match shipped(path) {
            folder if folder.is_dir() => folder_files(path, &folder)?,
            _ if is_file(named) => vec![path.to_owned()],
            _ => continue,
        };
        for file in files {
            let read = register::load(&shipped(&file))?;
            words.extend(read.iter().map(|effect| (effect.about.id.to_owned(), quoted(&file))));
        }
    }
    Ok(words)
}

/// Paths of the `.toml` files in `folder`. They begin with `named`, the path of the folder as the user wrote it.
fn folder_files(named: &Path, folder: &Path) -> Result<Vec<PathBuf>> {
    let below = |file: PathBuf| named.join(file.file_name().unwrap_or_default());
    Ok(register::files(folder)?.into_iter().map(below).collect())
}

/// Paths of the effect files that `effects` names, alone or by their folder. A folder that cannot be read is left to
/// [`named_effects`].
pub fn effect_paths(effects: &[String]) -> Vec<PathBuf> {
    let of = |named: &String| match shipped(Path::new(named)) {
        path if is_file(named) || path.is_dir() => register::files(&path).unwrap_or_default(),
        _ => Vec::new(),
    };
    effects.iter().flat_map(of).collect()
}

/// Whether `named` is a path and not an id. Only a path contains a dot or a slash.
pub fn is_file(named: &str) -> bool {
    named.contains(['.', '/', '\\'])
}

/// Those of `ids` whose effects are defined by effect files.
pub fn own_effects(ids: &[String]) -> Vec<String> {
    let own = |id: &&String| Kind::from_id(id).is_some_and(|kind| kind.written().is_some());
    ids.iter().filter(own).cloned().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_effect_of_a_file_is_named_by_its_file() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("my effect.toml");
        std::fs::copy("params/effects/yaw_by_throttle.toml", &file).unwrap();
        for named in [folder.path(), &file] {
            let named = [named.display().to_string(), "drag_beta2".into()];
            let words = file_words(&named).unwrap();
            let expected = BTreeMap::from([("yaw_by_throttle".to_owned(), quoted(&file))]);
            assert_eq!(words, expected, "{named:?}");
        }
    }
}
