//! Errors that prevent or end a run of the shim.

use std::io;
use std::path::PathBuf;

use super::link::LinkError;
use crate::plant::PlantError;

/// Why a run of the shim could not begin or had to end.
#[derive(Debug, thiserror::Error)]
pub enum ShimError {
    /// An option has an invalid value.
    #[error("cannot start the shim: {rule}; correct the option")]
    Option {
        /// The violated rule.
        rule: &'static str,
    },
    /// The simulated stack has no parameter of that name.
    #[error("the {stack} personality has no parameter {name}; it has {known}")]
    Parameter {
        /// Name of the simulated stack.
        stack: &'static str,
        /// The parameter as given.
        name: String,
        /// Parameters that the stack has.
        known: String,
    },
    /// The World Magnetic Model has no field for the start.
    #[error(
        "the World Magnetic Model has no field at {latitude_deg}°, {longitude_deg}°, {altitude_m} m; \
         start between -1 and 850 km"
    )]
    Magnetism {
        /// Geodetic latitude of the start, deg.
        latitude_deg: f64,
        /// Longitude of the start, deg.
        longitude_deg: f64,
        /// Altitude of the start above mean sea level, m.
        altitude_m: f64,
    },
    /// The plant could not be loaded, started or stepped.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// The link could not be opened.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The truth file exists, and the options do not allow its replacement.
    #[error("the truth file {} exists; choose another name with --truth, or allow overwriting with --force", path.display())]
    TruthExists {
        /// Path of the truth file.
        path: PathBuf,
    },
    /// The truth file could not be written.
    #[error("cannot write the truth file {}: {source}; check the folder and the free space", path.display())]
    Truth {
        /// Path of the truth file.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
}
