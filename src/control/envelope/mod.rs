//! The envelope, kept behind every controller: predicted load factor, incidence, sideslip and attitude.

mod bounds;
mod filter;
mod guarded;
mod load;

pub use bounds::Bounds;
pub use filter::{EnvelopeFilter, Filtered, Limit};
pub use guarded::Guarded;
pub use load::{G0, load_factor, load_factor_slopes};
