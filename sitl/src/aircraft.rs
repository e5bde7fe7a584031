//! The aircraft files that JSBSim loads: those built into the program, or a folder on disk.

use std::path::{Path, PathBuf};

use jsbsim::{Error, Fdm, FileResolver, MemoryResolver, Resolver};

use crate::hidden::{self, Hidden, HiddenError};
use crate::plant::Properties;

/// The files of the aircraft built into the program, by their path in a JSBSim tree.
const BUILT_IN: [(&str, &str); 12] = [
    ("x8/x8.xml", include_str!("../aircraft/x8/x8.xml")),
    ("x8/Engines/x8_motor.xml", include_str!("../aircraft/x8/Engines/x8_motor.xml")),
    ("x8/Engines/x8_direct.xml", include_str!("../aircraft/x8/Engines/x8_direct.xml")),
    ("aerosonde/aerosonde.xml", include_str!("../aircraft/aerosonde/aerosonde.xml")),
    (
        "aerosonde/Engines/aerosonde_motor.xml",
        include_str!("../aircraft/aerosonde/Engines/aerosonde_motor.xml"),
    ),
    (
        "aerosonde/Engines/aerosonde_direct.xml",
        include_str!("../aircraft/aerosonde/Engines/aerosonde_direct.xml"),
    ),
    ("x8-elevons/x8-elevons.xml", include_str!("../aircraft/x8-elevons/x8-elevons.xml")),
    (
        "x8-elevons/Engines/x8-elevons_motor.xml",
        include_str!("../aircraft/x8-elevons/Engines/x8-elevons_motor.xml"),
    ),
    (
        "x8-elevons/Engines/x8-elevons_direct.xml",
        include_str!("../aircraft/x8-elevons/Engines/x8-elevons_direct.xml"),
    ),
    ("c172p/c172p.xml", include_str!("../aircraft/c172p/c172p.xml")),
    ("c172p/Engines/c172p_motor.xml", include_str!("../aircraft/c172p/Engines/c172p_motor.xml")),
    ("c172p/Engines/c172p_direct.xml", include_str!("../aircraft/c172p/Engines/c172p_direct.xml")),
];

/// Name of the default aircraft.
pub(crate) const BUILT_IN_NAME: &str = "x8";
/// Names of the built-in aircraft.
const BUILT_IN_NAMES: &str = "x8, aerosonde, x8-elevons, c172p";

/// Why an aircraft could not be loaded.
#[derive(Debug, thiserror::Error)]
pub enum AircraftError {
    /// No built-in aircraft has that name, and no folder was given.
    #[error(
        "no aircraft '{name}' is built in (only {BUILT_IN_NAMES}); give the folder that holds \
         {name}/{name}.xml with --aircraft-dir"
    )]
    NotBuiltIn {
        /// The requested name.
        name: String,
    },
    /// The aircraft's file does not exist or cannot be read.
    #[error("cannot read the aircraft file {}: {source}; check --aircraft-dir and --aircraft", path.display())]
    Read {
        /// Path of the aircraft's XML file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// JSBSim cannot load the aircraft.
    #[error("JSBSim cannot load the aircraft '{name}': {source}; correct its XML")]
    Load {
        /// Name of the aircraft.
        name: String,
        /// Error that JSBSim returned.
        source: Error,
    },
    /// A hidden effect could not be written into the aircraft.
    #[error(transparent)]
    Hidden(#[from] HiddenError),
}

/// Files of a JSBSim tree; files in memory take precedence over files on disk.
struct Tree {
    disk: Option<FileResolver>,
    memory: MemoryResolver,
}

impl Resolver for Tree {
    fn resolve(&self, path: &str) -> Result<Vec<u8>, Error> {
        match (self.memory.resolve(path), &self.disk) {
            (Ok(bytes), _) => Ok(bytes),
            (Err(_), Some(disk)) => disk.resolve(path),
            (Err(missing), None) => Err(missing),
        }
    }

    fn exists(&self, path: &str) -> bool {
        self.memory.exists(path) || self.disk.as_ref().is_some_and(|disk| disk.exists(path))
    }
}

/// Loads the aircraft `name` into `fdm`, with `effects` written into its XML and the properties `held` declared.
///
/// With `dir`, the file is `dir/NAME/NAME.xml`. JSBSim then searches an engine first in `dir/NAME/Engines`, then in
/// `dir/../engine`, as in a JSBSim tree. Set the time step before this call: JSBSim's filters keep the step that is set at
/// loading.
pub(crate) fn load(
    fdm: &mut Fdm,
    dir: Option<&Path>,
    name: &str,
    properties: &Properties,
    effects: &[Hidden],
    held: &[(String, f64)],
) -> Result<(), AircraftError> {
    let plain = declared(&read(dir, name)?, held);
    let properties = properties.in_document(&plain);
    let document = hidden::write_into(&plain, &properties, effects, fdm.dt())?;
    let mut tree = Tree { disk: dir.map(FileResolver::new), memory: MemoryResolver::new() };
    if dir.is_none() {
        for (path, text) in BUILT_IN {
            tree.memory.insert(path, text);
        }
    }
    fdm.set_engine_path("../engine");
    fdm.set_systems_path("../systems");
    let path = format!("{name}/{name}.xml");
    tree.memory.insert(path.clone(), document);
    fdm.load_model_file(&tree, &path)
        .map_err(|source| AircraftError::Load { name: name.to_owned(), source })
}

/// The document with an added system that declares the `held` properties. Without this system, an aircraft that reads a
/// property that only another program defines does not load.
fn declared(document: &str, held: &[(String, f64)]) -> String {
    let end = document.rfind("</fdm_config>").filter(|_| !held.is_empty());
    let Some(end) = end else { return document.to_owned() };
    let plain = |name: &str| {
        !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || "/-_[].".contains(c))
    };
    let lines: String = held
        .iter()
        // properties that JSBSim defines or that the file writes are not declared again
        .filter(|(name, _)| {
            plain(name)
                && !document.contains(&format!("<output>{name}<"))
                && !name.ends_with("-cmd-norm")
        })
        .map(|(name, value)| format!("<property value=\"{value}\">{name}</property>"))
        .collect();
    if lines.is_empty() {
        return document.to_owned();
    }
    let system = format!("<system name=\"held\">{lines}</system>");
    [&document[..end], &system, &document[end..]].concat()
}

/// Reads the main document `NAME/NAME.xml` of a built-in aircraft, or of an aircraft in `dir`.
pub(crate) fn read(dir: Option<&Path>, name: &str) -> Result<String, AircraftError> {
    match dir {
        None => {
            let path = format!("{name}/{name}.xml");
            let found = BUILT_IN.iter().find(|(built_in, _)| *built_in == path);
            let missing = || AircraftError::NotBuiltIn { name: name.to_owned() };
            found.map(|(_, text)| (*text).to_owned()).ok_or_else(missing)
        }
        Some(dir) => {
            let path = dir.join(name).join(format!("{name}.xml"));
            std::fs::read_to_string(&path).map_err(|source| AircraftError::Read { path, source })
        }
    }
}
