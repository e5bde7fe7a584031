//! Where `greylag amend` reads and writes: the model, its airframe, what was done.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use serde::Serialize;
use sha2::{Digest, Sha256};

use crate::commands::files::{self, Overwrite};
use crate::model::GreyBox;
use crate::model::edit::{Edit, Number};
use crate::physics::catalogue;
use crate::physics::formula::Written;
use crate::sysid::amend::{Amended, Amendment, Convention};

/// Characters of a file's SHA-256 that sources carry.
const PREFIX: usize = 12;
/// Longest name of a model, bytes.
const NAME: usize = 64;

/// A log with its hash.
#[derive(Serialize)]
pub struct Hashed {
    path: String,
    sha256: String,
}

/// What goes into `amend.json`.
#[derive(Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    story: &'a Amendment,
    model_file: String,
    logs: &'a [Hashed],
    hold_out: &'a [Hashed],
}

/// The logs with their hashes.
pub fn hashed(paths: &[PathBuf]) -> Result<Vec<Hashed>> {
    let one = |path: &PathBuf| {
        let content = std::fs::read(path).with_context(|| {
            format!("cannot read flight log {}; name a file that exists", path.display())
        })?;
        let sha256 = Sha256::digest(content).iter().map(|b| format!("{b:02x}")).collect();
        Ok(Hashed { path: path.display().to_string(), sha256 })
    };
    paths.iter().map(one).collect()
}

/// Where things are read and written.
pub struct Places {
    original: PathBuf,
    airframe: PathBuf,
    folder: PathBuf,
}

impl Places {
    /// Fails at once if something could not be written later, so that no long work is lost to it.
    pub fn new(original: &Path, folder: &Path, overwrite: Overwrite) -> Result<Places> {
        let text = std::fs::read_to_string(original)?;
        let table: toml::Table = toml::from_str(&text)?;
        let named = table.get("airframe").and_then(toml::Value::as_str).unwrap_or_default();
        let airframe = original.parent().unwrap_or(Path::new(".")).join(named);
        std::fs::create_dir_all(folder).with_context(|| {
            format!("cannot make the folder {}; name another one", folder.display())
        })?;
        let places = Places { original: original.into(), airframe, folder: folder.into() };
        let original = std::fs::canonicalize(original)?;
        if std::fs::canonicalize(places.model()).is_ok_and(|p| p == original) {
            bail!("{} is the model to start from; name another folder", places.model().display());
        }
        files::writable(&places.model(), overwrite)?;
        files::writable(&places.json(), overwrite)?;
        if !places.airframe_is_there()? {
            files::writable(&places.own_airframe(), overwrite)?;
        }
        Ok(places)
    }

    /// The new model.
    pub fn model(&self) -> PathBuf {
        self.folder.join("model.toml")
    }

    fn json(&self) -> PathBuf {
        self.folder.join("amend.json")
    }

    /// The airframe beside the new model.
    fn own_airframe(&self) -> PathBuf {
        self.folder.join(self.airframe.file_name().unwrap_or("airframe.toml".as_ref()))
    }

    /// Whether the airframe stands beside the new model already, the same to the byte.
    fn airframe_is_there(&self) -> Result<bool> {
        let own = self.own_airframe();
        Ok(own.exists() && std::fs::read(own)? == std::fs::read(&self.airframe)?)
    }

    /// Writes the model and what was done; what was written reads back to the bit.
    pub fn write(
        &self,
        before: &GreyBox,
        amended: &Amended,
        logs: &[Hashed],
        hold_out: &[Hashed],
        overwrite: Overwrite,
    ) -> Result<()> {
        let text = std::fs::read_to_string(&self.original)?;
        let own = self.own_airframe();
        let airframe = own.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let text = edit(before, amended, logs, airframe).apply(&text)?;
        if !self.airframe_is_there()? {
            files::write(&own, &std::fs::read_to_string(&self.airframe)?, overwrite)?;
        }
        for effect in amended.model.written() {
            let path = self.folder.join(effect_file(effect));
            // the same effect may stand there already, as where a model is amended again
            if std::fs::read_to_string(&path).is_ok_and(|old| old == effect.text) {
                continue;
            }
            files::write(&path, &effect.text, overwrite)?;
        }
        files::write(&self.model(), &text, overwrite)?;
        let read = GreyBox::load(&self.model())?;
        if let Some(lost) = differs(&read, &amended.model) {
            std::fs::remove_file(self.model())?;
            bail!("the written model read back with another {lost}, and was removed; report this");
        }
        let document = Document {
            story: &amended.amendment,
            model_file: self.original.display().to_string(),
            logs,
            hold_out,
        };
        files::write(&self.json(), &(serde_json::to_string_pretty(&document)? + "\n"), overwrite)?;
        println!("wrote {}", self.model().display());
        Ok(())
    }
}

/// What changes in the model file.
fn edit(before: &GreyBox, amended: &Amended, logs: &[Hashed], airframe: String) -> Edit {
    let fitted = &amended.amendment.parameters;
    let known = before.coefficients().len();
    let number = |c: &crate::model::Named| {
        let sd = fitted.iter().find(|p| p.name == c.name).map(|p| p.sd);
        Number { name: c.name.clone(), value: c.value, sd }
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
    }
}

/// The file of an effect beside a model.
fn effect_file(effect: &Written) -> String {
    format!("{}.toml", effect.about.id)
}

fn short(log: &Hashed) -> String {
    let name = Path::new(&log.path).file_name().unwrap_or_default().to_string_lossy().into_owned();
    format!("{name} (sha256 {})", &log.sha256[..PREFIX])
}

/// A coefficient that is not the same to the bit, or a convention that is not the same.
fn differs(read: &GreyBox, meant: &GreyBox) -> Option<String> {
    if let Some(other) = Convention::ALL.into_iter().find(|c| c.of(read) != c.of(meant)) {
        return Some(other.key().join("."));
    }
    if read.coefficients().len() != meant.coefficients().len() {
        return Some("number of coefficients".into());
    }
    let same = |name: &str, value: f64| {
        read.coefficients().iter().any(|c| c.name == name && c.value.to_bits() == value.to_bits())
    };
    meant.coefficients().iter().find(|c| !same(&c.name, c.value)).map(|c| c.name.clone())
}
