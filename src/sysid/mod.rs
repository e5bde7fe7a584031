//! From flight logs to what is wrong with a model: reconstruct, compare, localise.

pub mod compare;
pub mod reconstruct;
pub mod reconstruction;
