//! Formulas of effects that are read from files and need no compilation of the program.
//!
//! An effect is one physical contribution to the forces and moments of a model. The parser turns the text of its formula into
//! a tree ([`parser`]). The units of the tree are checked ([`units`]). The tree is then split into the factor of each
//! coefficient ([`split`]). The factors are compiled to a list of operations on numbers of the type
//! [`Real`](greylag_num::Real) ([`tape`]). An effect file ([`mod@file`]) has one effect, which
//! [`Kind::Written`](crate::effects::Kind::Written) makes usable like a compiled effect.

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
