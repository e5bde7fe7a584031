//! Search over free forms, for residuals that no shape of the library explains.
//!
//! All expressions of a [`grammar`] with at most nine nodes are evaluated on the whitened residual of a channel
//! ([`screen`]). The constants of the best expressions are fitted ([`refine`]). The same search on bootstrap draws
//! under the null hypothesis that no effect is missing determines the critical value ([`search`]).

mod evaluate;
pub mod grammar;
mod refine;
pub mod samples;
mod screen;
pub mod search;
pub mod trend;

pub use grammar::Free;
