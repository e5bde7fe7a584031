//! Search over free forms, for residuals that no shape of the library explains.
//!
//! All expressions of a [`grammar`] of at most nine nodes are evaluated on the whitened residual of a channel
//! ([`screen`]). The constants of the best expressions are fitted ([`refine`]). The same search over null flights, in which
//! the model lacks no effect, determines the thresholds ([`search`]).

mod evaluate;
pub mod grammar;
mod refine;
pub mod samples;
mod screen;
pub mod search;
pub mod trend;

pub use grammar::Free;
