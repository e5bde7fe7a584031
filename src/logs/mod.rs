//! A flight in memory, and the formats it is read from and written to.

pub mod csv;
mod flight;

pub use flight::{Flight, Sample};
