//! Envelope protection for every controller: load factor, angle of attack, bank and sideslip.

mod bounds;
mod guarded;
mod limiter;
mod load;

pub use bounds::Bounds;
pub use guarded::Guarded;
pub use limiter::{EnvelopeLimiter, Limit, Limited};
pub use load::{G0, load_factor, load_factor_slopes, load_factor_under};
