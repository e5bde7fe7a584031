//! A formula for what no effect of the catalogue holds: shapes searched, tested on other flights, put into words.

mod draft;
mod forward;
mod grades;
mod held_out;
mod library;
mod propose;
mod result;
mod sentences;

pub use library::{Form, Shape};
pub use propose::propose;
pub use result::{Alternative, Grades, HeldOut, Proposal, Rung};
