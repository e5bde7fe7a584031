//! Proposes a formula for an effect (a physical contribution to forces and moments) that a model lacks and that the catalogue of
//! known effects does not contain. The formula is searched for, tested on held-out flights, which the search did not use, and
//! described in words.

mod beyond;
mod draft;
mod forward;
mod free;
mod grades;
mod held_out;
mod lags;
mod library;
mod propose;
mod result;
mod sentences;
mod signals;

pub use free::{Free, trend::trend};
pub use library::{Form, Shape};
pub use propose::propose;
pub use result::{Alternative, FreeForms, Grades, HeldOut, Proposal, Rung};
pub use signals::signals;
