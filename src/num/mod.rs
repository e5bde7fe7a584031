//! Numbers: the scalar an equation is written over, the types that stand for it, and seeded streams.

mod real;

pub use real::Real;
