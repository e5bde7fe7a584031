//! Where `greylag amend` reads and writes: the model, its airframe, what was done.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use crate::commands::files::{self, Overwrite};
use crate::model::GreyBox;
use crate::sysid::amend::Amended;
use crate::sysid::amend::document::{self, Hashed, differs, effect_file};

/// The logs with their hashes.
pub fn hashed(paths: &[PathBuf]) -> Result<Vec<Hashed>> {
    let one = |path: &PathBuf| {
        let content = std::fs::read(path).with_context(|| {
            format!("cannot read flight log {}; name a file that exists", path.display())
        })?;
        Ok(Hashed::new(path, &content))
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
        let text = document::model(&text, before, amended, logs, airframe)?;
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
        let story = document::story(amended, &self.original, logs, hold_out)?;
        files::write(&self.json(), &story, overwrite)?;
        println!("wrote {}", self.model().display());
        Ok(())
    }
}
