//! Files of `greylag amend`, which refits a model with added effects: its inputs, and the folder with the amended model and
//! the results.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use crate::commands::files::{self, Overwrite};
use crate::model::GreyBox;
use crate::sysid::amend::Amended;
use crate::sysid::amend::document::{self, Hashed, MODEL, Original, STORY, differs};

/// Reads the logs at `paths` and computes their hashes.
pub fn hashed(paths: &[PathBuf]) -> Result<Vec<Hashed>> {
    let one = |path: &PathBuf| {
        let content = fs::read(path).with_context(|| {
            format!("cannot read flight log {}; name a file that exists", path.display())
        })?;
        Ok(Hashed::new(path, &content))
    };
    paths.iter().map(one).collect()
}

/// The files of the original model, and the folder for the results.
pub struct Places {
    original: Original,
    folder: PathBuf,
    /// Whether this run made the folder.
    made: bool,
}

impl Drop for Places {
    /// Removes the folder if this run made it and it is empty.
    fn drop(&mut self) {
        if self.made {
            // `remove_dir` does not remove a folder with files
            let _ = fs::remove_dir(&self.folder);
        }
    }
}

impl Places {
    /// Reads the file `original`, from which `model` was loaded, and makes `folder`. It fails now, before the fit, if the
    /// results could not be written after the fit.
    pub fn new(
        original: &Path,
        model: &GreyBox,
        folder: &Path,
        overwrite: Overwrite,
    ) -> Result<Places> {
        if model.residual.is_some() {
            // the file of the residual is not copied, so the written model would lack it
            bail!(
                "model {} has a learned residual, which amend does not write: amend its prior, then learn the residual \
                 again",
                model.name
            );
        }
        let (read, made) = (Original::read(original)?, !folder.exists());
        fs::create_dir_all(folder).with_context(|| {
            format!("cannot make the folder {}; name another one", folder.display())
        })?;
        let places = Places { original: read, folder: folder.into(), made };
        let original = fs::canonicalize(original)?;
        if fs::canonicalize(places.model()).is_ok_and(|p| p == original) {
            bail!("{} is the model to start from; name another folder", places.model().display());
        }
        files::writable(&places.model(), overwrite)?;
        files::writable(&folder.join(STORY), overwrite)?;
        let airframe = folder.join(&places.original.airframe);
        if !holds(&airframe, &places.original.airframe_text) {
            files::writable(&airframe, overwrite)?;
        }
        Ok(places)
    }

    /// Path of the amended model.
    pub fn model(&self) -> PathBuf {
        self.folder.join(MODEL)
    }

    /// Writes the amended model and the results. Then reads the model back and checks that its numbers are the same to the
    /// bit.
    pub fn write(
        &self,
        before: &GreyBox,
        amended: &Amended,
        logs: [&[Hashed]; 2],
        overwrite: Overwrite,
    ) -> Result<()> {
        for (name, text) in document::files(&self.original, before, amended, logs)? {
            let path = self.folder.join(name);
            // the files of airframe and effects may exist already if an amended model is amended again
            if !holds(&path, &text) {
                files::write(&path, &text, overwrite)?;
            }
        }
        let read = GreyBox::load(&self.model())?;
        if let Some(lost) = differs(&read, &amended.model) {
            fs::remove_file(self.model())?;
            bail!("the written model read back with another {lost}, and was removed; report this");
        }
        println!("wrote {}", self.model().display());
        Ok(())
    }
}

/// Whether the file at `path` has exactly the content `text`.
fn holds(path: &Path, text: &str) -> bool {
    fs::read_to_string(path).is_ok_and(|there| there == text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_model_with_a_residual_is_refused_before_the_fit() {
        let out = tempfile::tempdir().unwrap().path().join("out");
        let file = Path::new("params/x8/learned/model.toml");
        let model = GreyBox::load(file).unwrap();
        let error = Places::new(file, &model, &out, Overwrite::New).err().unwrap().to_string();
        assert!(error.contains("residual") && !out.exists(), "{error}");
    }
}
