//! The aircraft in JSBSim: its files, its steps, the air, hidden effects.

mod air;
mod aircraft;
mod discovery;
mod facts;
mod flights;
mod hidden_channels;
mod hidden_effects;
mod step;
mod validate_jsbsim;
