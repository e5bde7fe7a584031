//! Formulas of effects that are read from files and need no compilation.
//!
//! A text becomes a tree ([`parser`]), its units are checked ([`units`]), it is split into the factor of each
//! coefficient ([`split`]), and these are compiled to a list of operations over [`Real`](greylag_num::Real)
//! ([`tape`]). An effect file ([`mod@file`]) holds one effect; once read,
//! [`Kind::Written`](crate::effects::Kind::Written) is an effect like all others.

mod corners;
pub mod dimension;
pub mod expression;
pub mod file;
pub mod fuzz;
mod memory;
pub mod parser;
pub mod register;
pub mod split;
pub mod tape;
pub mod units;
pub mod variable;
mod written;

pub use memory::Memory;
pub use variable::Variable;
pub use written::{Line, Status, Written};
