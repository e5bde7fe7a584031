//! Why a flight of a campaign cannot be flown.

use greylag_sitl::shim::ShimError;

use greylag_control::SetupError;
use greylag_flight::pilot::ConfigError;

/// Why a flight cannot be flown.
#[derive(Debug, thiserror::Error)]
pub enum FaultsError {
    /// The aircraft cannot be made.
    #[error(transparent)]
    Aircraft(#[from] ShimError),
    /// The simulator's effect that makes a failure cannot be made.
    #[error(transparent)]
    Hidden(#[from] greylag_sitl::hidden::HiddenError),
    /// The fallback cannot be built.
    #[error(transparent)]
    Fallback(#[from] SetupError),
    /// The pilot refuses its settings.
    #[error(transparent)]
    Pilot(#[from] ConfigError),
    /// A scenario has a parameter that the companion refuses.
    #[error("setting {name} to {times} times its default: {why}")]
    Parameter {
        /// Its name.
        name: String,
        /// Its value as a multiple of the default.
        times: f64,
        /// Why.
        why: String,
    },
    /// The recorder's thread cannot be started.
    #[error("starting the recorder of a flight: {0}; close other programs and try again")]
    Recorder(#[from] std::io::Error),
}
