//! Proposes a formula for an effect that a model lacks and that no entry of the catalogue describes. The formula is searched for,
//! tested on held-out flights and described in words.

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
