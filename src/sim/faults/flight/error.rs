//! Errors in setting up a simulated flight with faults.

use greylag_sitl::shim::ShimError;

use greylag_control::SetupError;
use greylag_flight::pilot::ConfigError;

/// Reason why a simulated flight with faults cannot be set up.
#[derive(Debug, thiserror::Error)]
pub enum FaultsError {
    /// The aircraft cannot be built.
    #[error(transparent)]
    Aircraft(#[from] ShimError),
    /// The simulator's effect that represents a failure cannot be built.
    #[error(transparent)]
    Hidden(#[from] greylag_sitl::hidden::HiddenError),
    /// The fallback controller cannot be built.
    #[error(transparent)]
    Fallback(#[from] SetupError),
    /// The companion's pilot refuses its settings.
    #[error(transparent)]
    Pilot(#[from] ConfigError),
    /// The companion refuses a parameter of the scenario.
    #[error("setting {name} to {times} times its default: {why}")]
    Parameter {
        /// Name of the parameter.
        name: String,
        /// Value of the parameter as a multiple of its default.
        times: f64,
        /// Reason for the refusal.
        why: String,
    },
    /// The recorder's thread cannot be started.
    #[error("starting the recorder of a flight: {0}; close other programs and try again")]
    Recorder(#[from] std::io::Error),
}
