//! Finds the files of the folder `params/` (models and policies) on the machine. The program contains a copy of this folder
//! and unpacks it if needed.

use std::ffi::OsString;
use std::io;
use std::path::{Path, PathBuf};

use include_dir::{Dir, File, include_dir};

use crate::model::residual::hash;

static PARAMS: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/params");

/// Name of the folder, in the source tree and in the folders that are searched.
const FOLDER: &str = "params";

/// Resolves a path. A path that exists is returned as given. A relative path below `params/` is searched in
/// `$XDG_CONFIG_HOME/greylag`, then in `/etc/greylag`, then in the program's copy, which is unpacked into
/// `$XDG_CACHE_HOME/greylag`.
pub fn shipped(path: &Path) -> PathBuf {
    if path.exists() || !path.starts_with(FOLDER) {
        return path.into();
    }
    let home = |variable: &str, below: &str| home(variable, below, &|name| std::env::var_os(name));
    let configured = [home("XDG_CONFIG_HOME", ".config"), Some(PathBuf::from("/etc"))];
    let mut places = configured.into_iter().flatten().map(|p| p.join("greylag").join(path));
    if let Some(found) = places.find(|p| p.exists()) {
        return found;
    }
    // a file that is found nowhere is reported with the requested path, not with a path in the cache
    if !path.strip_prefix(FOLDER).is_ok_and(|inside| PARAMS.contains(inside)) {
        return path.into();
    }
    let cache = home("XDG_CACHE_HOME", ".cache").unwrap_or_else(std::env::temp_dir);
    match unpacked(&cache.join("greylag")) {
        Ok(folder) => folder.join(path),
        Err(why) => {
            tracing::warn!("cannot unpack the shipped parameters into {}: {why}", cache.display());
            path.into()
        }
    }
}

/// The folder in the environment variable `variable` if it is an absolute path, else the folder `below` in the home folder.
/// `of` returns the value of an environment variable.
fn home(variable: &str, below: &str, of: &dyn Fn(&str) -> Option<OsString>) -> Option<PathBuf> {
    let named = of(variable).map(PathBuf::from).filter(|p| p.is_absolute());
    named.or_else(|| Some(Path::new(&of("HOME")?).join(below)))
}

/// The folder below `cache` with the program's `params/`, which is unpacked there if necessary.
fn unpacked(cache: &Path) -> io::Result<PathBuf> {
    let folder = cache.join(format!("{}-{}", env!("CARGO_PKG_VERSION"), &fingerprint()[..12]));
    if is_whole(&folder) {
        return Ok(folder);
    }
    std::fs::create_dir_all(cache)?;
    let part = tempfile::Builder::new().prefix(".part-").tempdir_in(cache)?;
    let params = part.path().join(FOLDER);
    std::fs::create_dir(&params)?;
    PARAMS.extract(&params)?;
    if folder.exists() {
        std::fs::remove_dir_all(&folder)?;
    }
    match std::fs::rename(part.path(), &folder) {
        // another process has unpacked the copy in the meantime
        Err(_) if is_whole(&folder) => Ok(folder),
        done => done.map(|()| folder),
    }
}

/// Whether `folder` holds every file of the program's copy with the same content.
fn is_whole(folder: &Path) -> bool {
    let same = |file: &&File<'_>| {
        let path = folder.join(FOLDER).join(file.path());
        std::fs::read(path).is_ok_and(|there| there == file.contents())
    };
    files(&PARAMS).iter().all(same)
}

/// SHA-256 over the names and contents of the files in the program's copy, hexadecimal.
fn fingerprint() -> String {
    let one =
        |file: &File<'_>| [file.path().as_os_str().as_encoded_bytes(), file.contents()].concat();
    hash(&files(&PARAMS).into_iter().flat_map(one).collect::<Vec<u8>>())
}

/// Every file below `folder`.
fn files<'a>(folder: &'a Dir<'a>) -> Vec<&'a File<'a>> {
    folder.files().chain(folder.dirs().flat_map(files)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_programs_copy_is_unpacked_once_and_mended() {
        let cache = tempfile::tempdir().unwrap();
        let folder = unpacked(cache.path()).unwrap();
        let model = folder.join("params/x8/learned/model.toml");
        let written = std::fs::metadata(&model).unwrap().modified().unwrap();
        crate::model::GreyBox::load(&model).unwrap();
        assert_eq!(unpacked(cache.path()).unwrap(), folder);
        assert_eq!(std::fs::metadata(&model).unwrap().modified().unwrap(), written);
        std::fs::write(&model, "spoiled").unwrap();
        unpacked(cache.path()).unwrap();
        crate::model::GreyBox::load(&model).unwrap();
        // no incomplete folder is left
        assert_eq!(std::fs::read_dir(cache.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_folder_named_by_the_environment_comes_before_the_home_folder() {
        let both = |name: &str| match name {
            "HOME" => Some(OsString::from("/me")),
            _ => Some(OsString::from("/elsewhere")),
        };
        assert_eq!(home("XDG_CACHE_HOME", ".cache", &both), Some("/elsewhere".into()));
        let bare = |name: &str| (name == "HOME").then(|| OsString::from("/me"));
        assert_eq!(home("XDG_CACHE_HOME", ".cache", &bare), Some("/me/.cache".into()));
        assert_eq!(home("XDG_CACHE_HOME", ".cache", &|_| None), None);
    }

    #[test]
    fn a_path_that_is_none_of_the_programs_stays_as_given() {
        assert_eq!(shipped(Path::new("my/model.toml")), Path::new("my/model.toml"));
        assert_eq!(
            shipped(Path::new("params/x8/missing.toml")),
            Path::new("params/x8/missing.toml")
        );
    }
}
