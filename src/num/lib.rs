//! Numerics: the trait [`Real`], neural networks, tables, statistics and random numbers from a seed. The model equations are
//! generic over number types that implement [`Real`]: f64, SIMD vectors and dual numbers.

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
