//! Checks that the output files of a command destroy neither its inputs nor one another.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};

use crate::commands::files::{self, Overwrite};

/// Fails if a file of `outputs` cannot be written, is one of the files `inputs` that the command reads, or is named for two
/// outputs. A command calls this before a long computation, whose result would otherwise be lost. `--force` replaces a file of
/// an earlier run, but never an input.
pub fn check<'a>(
    outputs: impl IntoIterator<Item = &'a PathBuf>,
    inputs: impl IntoIterator<Item = impl AsRef<Path>>,
    overwrite: Overwrite,
) -> Result<()> {
    let outputs: Vec<&PathBuf> = outputs.into_iter().collect();
    separate(&outputs, inputs)?;
    outputs.iter().try_for_each(|path| files::writable(path, overwrite))
}

/// Fails if a file of `outputs` is one of `inputs`, or is named twice. Paths are compared after symbolic links are resolved.
pub fn separate(
    outputs: &[impl AsRef<Path>],
    inputs: impl IntoIterator<Item = impl AsRef<Path>>,
) -> Result<()> {
    let read: Vec<PathBuf> = inputs.into_iter().map(|path| resolved(path.as_ref())).collect();
    let mut written: Vec<PathBuf> = Vec::new();
    for path in outputs.iter().map(AsRef::as_ref) {
        let place = match files::is_stdout(Some(path)) {
            true => PathBuf::from("-"),
            false => resolved(path),
        };
        if read.contains(&place) {
            bail!(
                "{} is an input of this command and would be lost; name another file, or another folder for it",
                path.display()
            );
        }
        if written.contains(&place) {
            bail!("{} is named for two outputs; name another file for one of them", path.display());
        }
        written.push(place);
    }
    Ok(())
}

/// The absolute path without symbolic links. The last parts of the path need not exist.
fn resolved(path: &Path) -> PathBuf {
    if let Ok(whole) = path.canonicalize() {
        return whole;
    }
    match (path.parent(), path.file_name()) {
        (Some(folder), Some(name)) if folder.as_os_str().is_empty() => {
            resolved(Path::new(".")).join(name)
        }
        (Some(folder), Some(name)) => resolved(folder).join(name),
        _ => path.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_input_is_no_output_with_force_either() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let (log, page) = (at("log.csv"), at("page.html"));
        std::fs::write(&log, "mine").unwrap();
        std::fs::write(&page, "of an earlier run").unwrap();
        let said = |output: &PathBuf| {
            let error = check([output], [&log], Overwrite::Force).unwrap_err().to_string();
            assert!(error.contains("is an input"), "{error}");
        };
        said(&log);
        said(&at("./log.csv"));
        check([&page], [&log], Overwrite::Force).unwrap();
        let kept = check([&page], [&log], Overwrite::Never).unwrap_err().to_string();
        assert!(kept.contains("--force"), "{kept}");
    }

    #[cfg(unix)]
    #[test]
    fn a_link_to_an_input_is_no_output() {
        let folder = tempfile::tempdir().unwrap();
        let [log, link] = ["log.csv", "link.csv"].map(|name| folder.path().join(name));
        std::fs::write(&log, "mine").unwrap();
        std::os::unix::fs::symlink("log.csv", &link).unwrap();
        check([&link], [&log], Overwrite::Force).unwrap_err();
        check([&log], [&link], Overwrite::Force).unwrap_err();
    }

    #[test]
    fn two_outputs_are_two_files() {
        let folder = tempfile::tempdir().unwrap();
        let [new, same] = ["new/a.json", "./new/a.json"].map(|name| folder.path().join(name));
        let none: [&Path; 0] = [];
        for two in [[new.clone(), same], ["-".into(), "-".into()], ["a".into(), "./a".into()]] {
            let error = separate(&two, none).unwrap_err().to_string();
            assert!(error.contains("two outputs"), "{error}");
        }
        separate(&[new, "-".into()], none).unwrap();
    }
}
