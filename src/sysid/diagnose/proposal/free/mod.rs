//! Search over free forms, for residuals that no shape of the library explains.
//!
//! All expressions of a [`grammar`] of at most nine nodes are evaluated on the whitened residual of a channel
//! ([`screen`]), the constants of the best ones are fitted ([`refine`]), and the same search over null flights, which
//! lack nothing, determines the thresholds ([`search`]).

mod evaluate;
pub mod grammar;
mod refine;
pub mod samples;
mod screen;
pub mod search;
pub mod trend;

pub use grammar::Free;
