//! The search of free forms, where no shape of the library is what is missing.
//!
//! All expressions of a [`grammar`] of at most nine nodes are tried on the whitened residual of a channel
//! ([`screen`]), the best ones' constants are fitted ([`refine`]), and what the same search finds in flights that
//! lack nothing sets what is asked of them ([`search`]).

mod evaluate;
pub mod grammar;
mod refine;
pub mod samples;
mod screen;
pub mod search;
pub mod trend;

pub use grammar::Free;
