//! Numbers: the scalar an equation is written over, the types that stand for it, and seeded streams.

pub mod bootstrap;
pub mod dense;
mod dual;
mod lanes;
mod real;
mod table;
pub mod statistics;
pub mod stream;

pub use dense::Dense;
pub use dual::Dual;
pub use lanes::Lanes;
pub use real::Real;
pub use table::{Table, TableError};
