//! A flight in memory, and the formats it is read from and written to.

mod flight;

pub use flight::{Flight, Sample};
