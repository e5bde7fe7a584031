//! Envelope protection, which limits the commands of any controller so that load factor, angle of attack, bank and sideslip stay
//! within their limits.

mod bounds;
mod guarded;
mod limiter;
mod load;

pub use bounds::Bounds;
pub use guarded::Guarded;
pub use limiter::{EnvelopeLimiter, Limit, Limited};
pub use load::{G0, load_factor, load_factor_slopes, load_factor_under};
