//! Writes the folder of a trained model. The model is the prior (the physical model) plus the residual, a neural network that
//! learns the rest of the state rates. The files are `model.toml`, the airframe file, the prior's effect files (formulas of
//! forces and moments) and `residual.safetensors`.

use std::path::{Path, PathBuf};

use crate::checkpoint::write_whole;
use crate::dynamics::basis::JXZ;
use greylag_model::residual::{Origin, fingerprint};
use greylag_model::{GreyBox, Integrator};
use greylag_physics::formula::register;

/// A model cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// A file cannot be read or written.
    #[error("cannot {doing} {path}: {why}; check that its folder exists, can be written to and has room", path = path.display())]
    File {
        /// The operation that failed.
        doing: &'static str,
        /// Path of the file.
        path: PathBuf,
        /// The operating system's error.
        why: std::io::Error,
    },
    /// The model file cannot be made from the prior's file, for example because that file has changed since it was read.
    #[error("cannot write a model after {path}: {why}; give the prior's file unchanged", path = path.display())]
    Prior {
        /// Path of the prior's file.
        path: PathBuf,
        /// Description of the fault.
        why: String,
    },
}

/// File name of the model in its folder.
pub const MODEL: &str = "model.toml";
/// File name of the copy of the airframe. The copy makes the folder self-contained.
pub const AIRFRAME: &str = "airframe.toml";
/// File name of the residual network.
pub const RESIDUAL: &str = "residual.safetensors";

/// Texts written into a model file.
#[derive(Clone, Copy, Debug)]
pub struct Text<'a> {
    /// A sentence on the training data, which becomes the model's description.
    pub about: &'a str,
    /// Names of the trained coefficients of the prior, as `effect.coefficient`.
    pub trained: &'a [String],
}

/// Writes `model`, which was trained from the prior in the file `prior`, into `folder`. Existing files are replaced,
/// the model file last.
///
/// # Errors
///
/// If a file cannot be read or written, if the prior's file has changed since it was read, or if `model` has no residual.
pub fn save(
    model: &GreyBox,
    prior: &Path,
    words: Text,
    origin: &Origin,
    folder: &Path,
) -> Result<(), ExportError> {
    let text = std::fs::read_to_string(prior).map_err(fail("read", prior))?;
    let wrong = |why: String| ExportError::Prior { path: prior.into(), why };
    let mut table: toml::Table = toml::from_str(&text).map_err(|e| wrong(e.to_string()))?;
    let airframe = table.get("airframe").and_then(|a| a.as_str()).unwrap_or(AIRFRAME);
    let beside = prior.parent().unwrap_or(Path::new("."));
    let airframe = beside.join(airframe);
    let airframe_text = std::fs::read(&airframe).map_err(fail("read", &airframe))?;
    let own = effect_files(&table, beside)?;
    // the name of a model that is trained again does not get a second suffix
    let base = model.name.strip_suffix("-learned").unwrap_or(&model.name);
    let name: String = format!("{base}-learned").chars().take(64).collect();
    let mut set = |key: &str, value: &str| table.insert(key.into(), value.into());
    set("name", &name);
    set("description", words.about);
    set("airframe", AIRFRAME);
    let scheme = match model.integrator {
        Integrator::Rk4 => "rk4",
        Integrator::Jsbsim => "jsbsim",
    };
    set("integrator", scheme);
    set("residual", RESIDUAL);
    if !own.is_empty() {
        let names = own.iter().map(|(name, _)| toml::Value::from(name.as_str())).collect();
        table.insert("effect_files".into(), toml::Value::Array(names));
    }
    for name in words.trained {
        write_trained(&mut table, model, name, origin)
            .ok_or_else(|| wrong(format!("it has no {name}")))?;
    }
    let text = toml::to_string(&table).map_err(|e| wrong(e.to_string()))?;
    let residual = match &model.residual {
        Some(residual) => residual.to_bytes(origin).map_err(|e| wrong(e.to_string()))?,
        None => return Err(wrong("the model has no residual".into())),
    };
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.join(name);
        write_whole(&path, bytes).map_err(fail("write", &path))
    };
    write(AIRFRAME, &airframe_text)?;
    own.iter().try_for_each(|(name, bytes)| write(name, bytes))?;
    write(RESIDUAL, &residual)?;
    write(MODEL, text.as_bytes())
}

/// Makes the error of a file that cannot be read or written. `doing` is the operation.
fn fail(doing: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> ExportError + use<> {
    let path = path.to_owned();
    move |why| ExportError::File { doing, path, why }
}

/// Name and content of each effect file (a file that defines one effect by a formula) that the model file `table` names. Paths
/// are relative to the folder `beside`. A path to a folder stands for its `.toml` files, as when the model is read. Files whose
/// name is already taken are renamed.
fn effect_files(table: &toml::Table, beside: &Path) -> Result<Vec<(String, Vec<u8>)>, ExportError> {
    let mut own: Vec<(String, Vec<u8>)> = Vec::new();
    for effect in table.get("effect_files").and_then(|e| e.as_array()).into_iter().flatten() {
        let path = beside.join(effect.as_str().unwrap_or_default());
        for path in register::files(&path).map_err(fail("read", &path))? {
            let bytes = std::fs::read(&path).map_err(fail("read", &path))?;
            let plain = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let (mut name, mut number) = (plain.clone(), 1);
            while [MODEL, AIRFRAME].contains(&name.as_str()) || own.iter().any(|o| o.0 == name) {
                number += 1;
                name = format!("{number}-{plain}");
            }
            own.push((name, bytes));
        }
    }
    Ok(own)
}

/// Writes the value of the coefficient `name` of `model` into the model file's `table`. If the table has no entry for it, because
/// its value stood in an effect file, an entry is created. `None` if the table lacks the effect.
fn write_trained(
    table: &mut toml::Table,
    model: &GreyBox,
    name: &str,
    origin: &Origin,
) -> Option<()> {
    let value = model.coefficients().iter().find(|c| c.name == name).map(|c| c.value);
    let path: Vec<&str> = match name {
        JXZ => name.split('.').collect(),
        _ => ["effects"].into_iter().chain(name.split('.')).collect(),
    };
    let value = value.unwrap_or(model.bare_body().jxz);
    let (last, parents) = path.split_last()?;
    let parent = parents.iter().try_fold(table, |t, key| t.get_mut(*key)?.as_table_mut())?;
    let new = || toml::Value::Table(toml::Table::new());
    let entry = parent.entry(*last).or_insert_with(new).as_table_mut()?;
    let before = entry.get("value").map_or("the effect's file".into(), ToString::to_string);
    entry.insert("value".into(), value.into());
    let source = format!(
        "learned from flights (data {}), from {before}",
        &origin.data[..12.min(origin.data.len())]
    );
    entry.insert("source".into(), source.into());
    Some(())
}

/// Provenance for the residual's file. `data` is the SHA-256 of the training data in hexadecimal, `seed` the training's seed.
pub fn origin(model: &GreyBox, data: &str, seed: u64) -> Origin {
    Origin {
        schema: Origin::SCHEMA.into(),
        airframe: fingerprint(&model.airframe),
        data: data.into(),
        seed,
        program: concat!("greylag ", env!("CARGO_PKG_VERSION")).into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn effect_files_of_folders_are_all_copied_under_names_of_their_own() {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in [("a.toml", "1"), ("b.toml", "2"), ("notes.txt", "3")] {
            std::fs::create_dir_all(folder.path().join("effects")).unwrap();
            std::fs::write(folder.path().join("effects").join(name), text).unwrap();
        }
        std::fs::write(folder.path().join("a.toml"), "4").unwrap();
        let read = |text: &str| -> toml::Table { toml::from_str(text).unwrap() };
        let table = read("effect_files = [\"effects\", \"a.toml\"]");
        let own = effect_files(&table, folder.path()).unwrap();
        let own: Vec<_> = own.iter().map(|(name, text)| (name.as_str(), &text[..])).collect();
        assert_eq!(own, [("a.toml", &b"1"[..]), ("b.toml", &b"2"[..]), ("2-a.toml", &b"4"[..])]);
        let table = read("effect_files = [\"none.toml\"]");
        assert!(matches!(effect_files(&table, folder.path()), Err(ExportError::File { .. })));
    }

    #[test]
    fn a_trained_coefficient_whose_value_is_in_an_effect_file_gets_an_entry() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/x8/prior.toml");
        let mut model = GreyBox::load(&path).unwrap();
        model.join("p_factor", &[0.4]).unwrap();
        let origin = origin(&model, "0123456789abcdef", 1);
        let mut table: toml::Table = toml::from_str("[effects.p_factor]\n").unwrap();
        write_trained(&mut table, &model, "p_factor.k", &origin).unwrap();
        let written = &table["effects"]["p_factor"]["k"];
        assert_eq!(written["value"].as_float(), Some(0.4));
        assert!(written["source"].as_str().unwrap().ends_with("from the effect's file"));
        assert!(write_trained(&mut table, &model, "lift_linear.CL0", &origin).is_none());
    }
}
