//! Detects a log that is given as a model, and a model that is given as a log.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use anyhow::{Result, bail};

use super::files::shipped;
use crate::logs::Format;
use crate::model::GreyBox;
use crate::physics::formula::register;

/// Number of bytes that are read from the start of a file to identify its format.
const HEAD: u64 = 4096;

/// Loads the model at `path`, which may be a path below the shipped `params/`.
///
/// # Errors
/// If the file cannot be read, or is a flight log.
pub fn model(path: &Path) -> Result<GreyBox> {
    let found = shipped(path);
    if is_log(&found) {
        bail!(
            "{} is a flight log, where a model is wanted; models are .toml files: are --model and --log swapped?",
            path.display()
        );
    }
    Ok(GreyBox::load(&found)?)
}

/// All files that are read with the model at `path`: the model file, and the airframe, the learned residual and the effect files
/// that it names. A folder of effect files stands for its files.
pub fn files(path: &Path) -> Vec<PathBuf> {
    let path = shipped(path);
    // a log given as a model can be large
    let text = if is_log(&path) { None } else { std::fs::read_to_string(&path).ok() };
    let table: toml::Table = text.and_then(|text| toml::from_str(&text).ok()).unwrap_or_default();
    let folder = path.parent().unwrap_or(Path::new(""));
    let named = ["airframe", "residual"].into_iter().filter_map(|key| table.get(key)?.as_str());
    let effects = table.get("effect_files").and_then(|value| value.as_array());
    let effects = effects.into_iter().flatten().filter_map(|value| value.as_str());
    let effects = effects.flat_map(|name| register::files(&folder.join(name)).unwrap_or_default());
    let named: Vec<PathBuf> = named.map(|name| folder.join(name)).chain(effects).collect();
    [vec![path], named].concat()
}

/// Refuses a `.toml` file that is given in place of a log.
///
/// # Errors
/// If `path` is a `.toml` file.
pub fn log(path: &Path) -> Result<()> {
    let named = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"));
    if named && path.is_file() {
        bail!(
            "{} is a .toml file, where a flight log is wanted (CSV, .ulg, .bin, .tlog, .mcap): are --model and --log swapped?",
            path.display()
        );
    }
    Ok(())
}

/// Whether the content of a file is that of a log, and its name does not end in `.toml`.
fn is_log(path: &Path) -> bool {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) {
        return false;
    }
    let mut head = Vec::new();
    let read = File::open(path).and_then(|file| file.take(HEAD).read_to_end(&mut head));
    // a text that starts like a comment or like JSON is no log, although its commas make it look like CSV
    let other = matches!(head.first(), Some(b'#' | b'{' | b'['));
    read.is_ok() && !other && Format::of(&head).is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_files_of_a_model_are_all_that_it_names() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir(at("effects")).unwrap();
        for name in ["effects/b.toml", "effects/a.toml", "effects/notes.txt"] {
            std::fs::write(at(name), "").unwrap();
        }
        let text = r#"
airframe = "airframe.toml"
residual = "residual.safetensors"
effect_files = ["own.toml", "effects"]
"#;
        std::fs::write(at("model.toml"), text).unwrap();
        let named = ["airframe.toml", "residual.safetensors", "own.toml"];
        let expected = [&["model.toml"][..], &named, &["effects/a.toml", "effects/b.toml"]];
        assert_eq!(
            files(&at("model.toml")),
            expected.concat().into_iter().map(at).collect::<Vec<_>>()
        );
        assert_eq!(files(&at("none.toml")), [at("none.toml")]);
    }
}
