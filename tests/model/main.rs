//! Grey-box models: files, facts, derivatives, JSBSim aircraft, and the equations against JSBSim.

#[cfg(feature = "sitl")]
mod aircraft_files;
mod derivatives;
mod effect_files;
#[cfg(feature = "sitl")]
mod effects_lqi;
mod facts;
mod files;
mod join;
mod linear;
#[cfg(feature = "sitl")]
mod validate_effects;
#[cfg(feature = "sitl")]
mod validate_model;
#[cfg(feature = "sitl")]
#[path = "../support/validate.rs"]
mod validate_support;
