//! Effects that a user names by id, by effect file or by a folder of effect files.

use std::path::Path;

use anyhow::{Result, bail};

use crate::commands::files::shipped;
use crate::physics::effects::Kind;
use crate::physics::formula::register;

/// The ids of `effects`, each of which is an id, an effect file or a folder of effect files. The files are read.
///
/// # Errors
/// If a file cannot be read or is no effect file.
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

/// Whether `named` is the name of a file. An id has neither a dot nor a slash.
pub fn is_file(named: &str) -> bool {
    named.contains(['.', '/', '\\'])
}

/// The `ids` whose effects come from effect files.
pub fn own_effects(ids: &[String]) -> Vec<String> {
    let own = |id: &&String| Kind::from_id(id).is_some_and(|kind| kind.written().is_some());
    ids.iter().filter(own).cloned().collect()
}
