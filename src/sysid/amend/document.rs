//! Files of an amendment: the new text of the model file, and the result as JSON.
//!
//! An amendment refits a model to logs and adds effects (physical contributions to forces and moments) that it lacked.

use std::path::{Path, PathBuf};

use serde::Serialize;
use sha2::{Digest, Sha256};

use super::{Amended, Amendment, Convention};
use greylag_model::GreyBox;
use greylag_model::edit::{Edit, EditError, Number};
use greylag_physics::catalogue;
use greylag_physics::formula::Written;

/// Number of hexadecimal digits of a log's SHA-256 in the `source` entry of a fitted coefficient.
const PREFIX: usize = 12;
/// Longest name of a model, bytes.
const NAME: usize = 64;

/// A log with its hash.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Hashed {
    /// Path of the log.
    pub path: String,
    /// SHA-256 of its content, hexadecimal.
    pub sha256: String,
}

impl Hashed {
    /// The log at `path`, hashed from its `content`.
    pub fn new(path: &Path, content: &[u8]) -> Hashed {
        Hashed { path: path.display().to_string(), sha256: sha256(content) }
    }
}

/// SHA-256 of `content`, hexadecimal.
pub fn sha256(content: &[u8]) -> String {
    Sha256::digest(content).iter().map(|b| format!("{b:02x}")).collect()
}

/// Content of `amend.json`.
#[derive(Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    story: &'a Amendment,
    model_file: String,
    logs: &'a [Hashed],
    hold_out: &'a [Hashed],
}

/// File name of the amended model.
pub const MODEL: &str = "model.toml";
/// File name of the amendment's result.
pub const STORY: &str = "amend.json";

/// Reason why the files of an amended model cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum DocumentError {
    /// A file of the original model cannot be read.
    #[error("cannot read {}: {source}; check that it exists and may be read", path.display())]
    Read {
        /// Path of the unreadable file.
        path: PathBuf,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// The model file cannot be edited.
    #[error(transparent)]
    Edit(#[from] EditError),
    /// The result holds a number that JSON cannot represent.
    #[error("cannot write {STORY}: {0}")]
    Json(#[from] serde_json::Error),
    /// The model has a learned residual.
    #[error(
        "cannot write the amended model: {model} has a learned residual, which no fit changes and which would be missing \
         beside it; amend the model without the residual"
    )]
    Residual {
        /// Name of the model.
        model: String,
    },
    /// Two files of the amended model have the same name.
    #[error(
        "cannot write the amended model: it has two files {name}; rename the airframe file or the effect"
    )]
    Twice {
        /// The name of both files.
        name: String,
    },
}

/// Files of the original model.
#[derive(Clone, Debug)]
pub struct Original {
    /// Path of the model file.
    pub path: PathBuf,
    /// Text of the model file.
    pub text: String,
    /// File name of the airframe that the model file names.
    pub airframe: String,
    /// Text of the airframe file.
    pub airframe_text: String,
}

impl Original {
    /// Reads the model file at `path` with its airframe.
    ///
    /// # Errors
    /// If one of them cannot be read.
    pub fn read(path: &Path) -> Result<Original, DocumentError> {
        let read = |path: &Path| {
            let unread = |source| DocumentError::Read { path: path.into(), source };
            std::fs::read_to_string(path).map_err(unread)
        };
        let text = read(path)?;
        let table: toml::Table = toml::from_str(&text).unwrap_or_default();
        let named = table.get("airframe").and_then(toml::Value::as_str).unwrap_or_default();
        let airframe = path.parent().unwrap_or(Path::new(".")).join(named);
        let name = airframe.file_name().unwrap_or("airframe.toml".as_ref());
        Ok(Original {
            path: path.into(),
            airframe: name.to_string_lossy().into_owned(),
            airframe_text: read(&airframe)?,
            text,
        })
    }
}

/// Name and text of each file of an amended model: airframe, effects, model, result. `logs` are the fitted logs, `hold_out` the
/// held-out ones, which the fit did not use.
///
/// # Errors
/// If the original is no model file, if the model has a learned residual, if the result holds a number that JSON cannot
/// represent, or if two files would have the same name.
pub fn files(
    original: &Original,
    before: &GreyBox,
    amended: &Amended,
    [logs, hold_out]: [&[Hashed]; 2],
) -> Result<Vec<(String, String)>, DocumentError> {
    without_residual(before)?;
    let airframe = original.airframe.clone();
    let text = edit(before, amended, logs, airframe.clone()).apply(&original.text)?;
    let model_file = original.path.display().to_string();
    let document = Document { story: &amended.amendment, model_file, logs, hold_out };
    let story = serde_json::to_string_pretty(&document)? + "\n";
    let mut files = vec![(airframe, original.airframe_text.clone())];
    files.extend(amended.model.written().map(|own| (effect_file(own), own.text.clone())));
    files.extend([(MODEL.into(), text), (STORY.into(), story)]);
    distinct(&files)?;
    Ok(files)
}

/// Fails if `model` has a learned residual, because the written model would name a residual file that is not written.
fn without_residual(model: &GreyBox) -> Result<(), DocumentError> {
    match &model.residual {
        Some(_) => Err(DocumentError::Residual { model: model.name.clone() }),
        None => Ok(()),
    }
}

/// Fails if two of `files` have the same name, because one would replace the other.
fn distinct(files: &[(String, String)]) -> Result<(), DocumentError> {
    let mut names: Vec<&str> = files.iter().map(|(name, _)| name.as_str()).collect();
    names.sort_unstable();
    match names.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(DocumentError::Twice { name: pair[0].into() }),
        None => Ok(()),
    }
}

/// The changes that turn the original model file into the file of the amended model.
fn edit(before: &GreyBox, amended: &Amended, logs: &[Hashed], airframe: String) -> Edit {
    let fitted = &amended.amendment.parameters;
    let known = before.coefficients().len();
    let number = |c: &greylag_model::Named| {
        let sd = fitted.iter().find(|p| p.name == c.name).map(|p| p.sd);
        Number { name: c.name.clone(), value: c.value, sd, bounds: c.bounds }
    };
    let new = |name: &str| !before.coefficients().iter().any(|c| c.name == name);
    let source = |name: &str| {
        let id = name.split('.').next().unwrap_or_default();
        catalogue::describe(id).map_or("", |about| about.source).into()
    };
    let all = amended.model.coefficients();
    let changed = all.iter().filter(|c| fitted.iter().any(|p| p.name == c.name && !p.added));
    let taken = amended.amendment.conventions.iter().filter(|t| t.kept);
    let logs: Vec<String> = logs.iter().map(short).collect();
    let name = match known == all.len() {
        true => format!("{}-tuned", before.name),
        false => amended.model.name.clone(),
    };
    let shortened = format!("{}-amended", before.name.chars().take(40).collect::<String>());
    Edit {
        name: if name.len() <= NAME { name } else { shortened },
        airframe,
        changed: changed.map(number).collect(),
        dropped: amended.dropped(),
        replaced: taken.map(|t| (t.convention.key(), t.to)).collect(),
        added: all.iter().filter(|c| new(&c.name)).map(|c| (number(c), source(&c.name))).collect(),
        effect_files: amended.model.written().map(effect_file).collect(),
        fitted_to: logs.join(", "),
        known: (amended.model.known != before.known).then(|| (*amended.model.known).clone()),
    }
}

/// File name of an effect in the folder of its model.
pub fn effect_file(effect: &Written) -> String {
    format!("{}.toml", effect.about.id)
}

fn short(log: &Hashed) -> String {
    let name = Path::new(&log.path).file_name().unwrap_or_default().to_string_lossy().into_owned();
    format!("{name} (sha256 {})", &log.sha256[..PREFIX])
}

/// The first difference between `read` and `meant`, in words: a model structure option such as the integrator, the number of
/// coefficients, constants of the installation or of flights, or a coefficient with other bits. `None` if there is no
/// difference.
pub fn differs(read: &GreyBox, meant: &GreyBox) -> Option<String> {
    if let Some(other) = Convention::ALL.into_iter().find(|c| c.of(read) != c.of(meant)) {
        return Some(other.key().join("."));
    }
    if read.coefficients().len() != meant.coefficients().len() {
        return Some("number of coefficients".into());
    }
    if read.known != meant.known {
        return Some("installation or flights".into());
    }
    let same = |name: &str, value: f64| {
        read.coefficients().iter().any(|c| c.name == name && c.value.to_bits() == value.to_bits())
    };
    meant.coefficients().iter().find(|c| !same(&c.name, c.value)).map(|c| c.name.clone())
}

#[cfg(test)]
mod tests {
    use super::*;
    use greylag_model::Residual;
    use greylag_num::Dense;

    #[test]
    fn a_model_that_would_not_be_whole_is_not_written() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/x8/jsbsim.toml");
        let mut model = GreyBox::load(&path).unwrap();
        without_residual(&model).unwrap();
        let network = Dense::new(&[9, 8], vec![0.0; 9 * 8 + 8]).unwrap();
        model.residual = Some(Residual::new(network, &model.airframe, model.scale()).unwrap());
        let why = without_residual(&model).unwrap_err().to_string();
        assert!(why.contains("has a learned residual"), "{why}");
        let named = |names: &[&str]| -> Vec<(String, String)> {
            names.iter().map(|name| ((*name).to_owned(), String::new())).collect()
        };
        distinct(&named(&["airframe.toml", MODEL, STORY])).unwrap();
        let why = distinct(&named(&["model.toml", MODEL, STORY])).unwrap_err().to_string();
        assert!(why.contains("two files model.toml"), "{why}");
    }
}
