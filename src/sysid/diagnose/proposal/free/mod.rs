//! Search over free forms, which are formulas composed of variables, constants and operations. It is used for residuals that no
//! function shape of the built-in library explains.
//!
//! All expressions of a [`grammar`] with at most nine nodes are evaluated against the whitened residual of a channel
//! ([`screen`]). The constants of the best expressions are fitted ([`refine`]). The same search on bootstrap draws under the
//! null hypothesis that no effect is missing determines the critical value ([`search`]).

mod evaluate;
pub mod grammar;
mod refine;
pub mod samples;
mod screen;
pub mod search;
pub mod trend;

pub use grammar::Free;
