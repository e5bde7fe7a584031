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

/// Folders that this run has made, the deepest first. Those that are empty when this value is dropped are removed.
pub struct Made(Vec<PathBuf>);

impl Made {
    /// Makes `folder` and the folders above it, as far as they do not exist.
    ///
    /// # Errors
    /// If a folder cannot be made.
    pub fn folder(folder: &Path) -> Result<Made> {
        let missing = folder.ancestors().take_while(|path| !path.exists());
        let missing = missing.filter(|path| !path.as_os_str().is_empty());
        let made = Made(missing.map(Path::to_owned).collect());
        fs::create_dir_all(folder).with_context(|| {
            format!("cannot make the folder {}; name another one", folder.display())
        })?;
        Ok(made)
    }
}

impl Drop for Made {
    fn drop(&mut self) {
        for folder in &self.0 {
            // `remove_dir` does not remove a folder with files
            let _ = fs::remove_dir(folder);
        }
    }
}

/// The files of the original model, and the folder for the results.
pub struct Places {
    original: Original,
    folder: PathBuf,
}

impl Places {
    /// Reads the file `original`, from which `model` was loaded. It fails now, before the fit, if the results could not be
    /// written into `folder` after the fit. A folder that does not exist is made and removed again: an end of the program
    /// during the fit leaves no empty folder.
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
        let places = Places { original: Original::read(original)?, folder: folder.into() };
        let _made = Made::folder(folder)?;
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
        let _made = Made::folder(&self.folder)?;
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
    fn folders_that_stay_empty_are_removed() {
        let scratch = tempfile::tempdir().unwrap();
        let above = scratch.path().join("above");
        let inner = above.join("inner");
        drop(Made::folder(&inner).unwrap());
        assert!(!above.exists() && scratch.path().exists());
        let made = Made::folder(&inner).unwrap();
        fs::write(inner.join("file"), "mine").unwrap();
        drop(made);
        assert!(inner.exists());
    }

    #[test]
    fn a_model_with_a_residual_is_refused_before_the_fit() {
        let out = tempfile::tempdir().unwrap().path().join("out");
        let file = Path::new("params/x8/learned/model.toml");
        let model = GreyBox::load(file).unwrap();
        let error = Places::new(file, &model, &out, Overwrite::New).err().unwrap().to_string();
        assert!(error.contains("residual") && !out.exists(), "{error}");
    }
}
