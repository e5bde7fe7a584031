//! Tests of the plant: aircraft files, steps, air, and hidden effects.

mod air;
mod aircraft;
mod discovery;
mod electric;
mod facts;
mod flights;
mod hidden_channels;
mod hidden_effects;
mod step;
mod validate_jsbsim;
