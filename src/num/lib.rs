//! Numerics: the trait [`Real`] of the number types for which the model equations are generic (f64, SIMD vectors, dual numbers),
//! and neural networks, tables, statistics and random numbers from a seed.

pub mod bootstrap;
pub mod dense;
mod dual;
mod grid;
mod lanes;
mod least_squares;
mod real;
mod register;
mod table;
pub mod statistics;
pub mod stream;

pub use dense::Dense;
pub use dual::Dual;
pub use grid::{Grid, GridError};
#[cfg(target_arch = "x86_64")]
pub use lanes::{Avx2, Avx512};
pub use lanes::{BASE_FUSED, Base, Lanes, Packed, ROW};
pub use least_squares::least_squares;
pub use real::{Real, each};
pub use register::{Pair, Register};
pub use table::{Table, TableError};
