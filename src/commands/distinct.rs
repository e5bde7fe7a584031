//! Checks that the user names no flight twice. Otherwise the flight would count twice in a fit, or the fit would be
//! validated on its own data.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};

use crate::model::residual::hash;

/// Checks that no flight occurs twice among the flights to fit (`fitted`), twice among the flights for validation (`held`),
/// or in both. Files are compared by content, because a file can have several paths and copies.
///
/// # Errors
/// If two files have the same content. The error names both. A file that cannot be read is skipped, because the command
/// that reads it reports the error.
pub fn distinct(fitted: &[PathBuf], held: &[PathBuf]) -> Result<()> {
    let known = |paths: &[PathBuf]| -> Vec<(PathBuf, String)> {
        let content = |p: &PathBuf| Some((p.clone(), hash(&std::fs::read(p).ok()?)));
        paths.iter().filter_map(content).collect()
    };
    let (fitted, held) = (known(fitted), known(held));
    for all in [&fitted, &held] {
        for (k, (path, content)) in all.iter().enumerate() {
            if let Some(other) = named(&all[..k], content) {
                bail!("{}, so it would count twice; name it once", same(other, path));
            }
        }
    }
    for (path, content) in &fitted {
        if let Some(other) = named(&held, content) {
            bail!(
                "{}, which cannot be fitted to and held out at once; name it in one place",
                same(path, other)
            );
        }
    }
    Ok(())
}

/// Checks that no two of `logs` have the same file name. This is required if trims or axis angles are estimated for each
/// flight, because the model file stores them under the file name of the log.
///
/// # Errors
/// If two logs have the same file name. The error names both.
pub fn distinct_names<'a>(logs: impl Iterator<Item = &'a PathBuf>) -> Result<()> {
    let mut known: Vec<&Path> = Vec::new();
    for log in logs {
        if let Some(other) = known.iter().find(|other| other.file_name() == log.file_name()) {
            bail!(
                "{} and {} have the same name, by which the model's file keeps the trims and axes of a flight; rename one of them",
                other.display(),
                log.display()
            );
        }
        known.push(log);
    }
    Ok(())
}

fn named<'a>(all: &'a [(PathBuf, String)], content: &str) -> Option<&'a Path> {
    all.iter().find(|(_, other)| other == content).map(|(path, _)| path.as_path())
}

fn same(one: &Path, other: &Path) -> String {
    format!("{} and {} hold the same flight", one.display(), other.display())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logs_of_one_name_in_two_folders_are_refused() {
        let logs = ["one/flight.csv", "one/other.csv", "two/flight.csv"].map(PathBuf::from);
        distinct_names(logs[..2].iter()).unwrap();
        let why = distinct_names(logs.iter()).unwrap_err().to_string();
        assert!(why.starts_with("one/flight.csv and two/flight.csv have the same name"), "{why}");
    }

    #[test]
    fn a_flight_is_known_by_its_content() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            path
        };
        let (a, copy, b) = (file("a.csv", "1"), file("copy.csv", "1"), file("b.csv", "2"));
        distinct(&[a.clone(), b.clone()], &[]).unwrap();
        distinct(std::slice::from_ref(&a), std::slice::from_ref(&b)).unwrap();
        let twice = distinct(&[a.clone(), b.clone(), copy.clone()], &[]).unwrap_err().to_string();
        assert!(twice.contains("a.csv") && twice.contains("copy.csv") && twice.contains("twice"));
        assert!(distinct(std::slice::from_ref(&b), &[a.clone(), copy]).is_err());
        let spelled = folder.path().join("./a.csv");
        assert!(distinct(&[a, b], &[spelled]).unwrap_err().to_string().contains("held out"));
        distinct(&["missing.csv".into()], &["missing.csv".into()]).unwrap();
    }
}
