//! Campaigns: many runs of this program over priors, controllers and seeds, with statistics over them.
//!
//! A campaign file names axes, seeds and stages. [`plan`](plan()) expands it into *cells*: command lines of this
//! program, each with an identity derived from its command, its input files and the cells before it. [`store`] keeps
//! the result of each cell as one JSON line, written atomically. [`gather`] collects these lines, and [`tables`]
//! summarises them over seeds.
//!
//! This crate runs no cells. `greylag campaign run` runs them. A cluster's scheduler can call this command
//! ([`launch`]).

pub mod cell;
pub mod error;
pub mod file;
pub mod gather;
pub mod harvest;
pub mod launch;
pub mod plan;
pub mod published;
pub mod statistics;
pub mod store;
pub mod tables;

pub use cell::{Cell, Record};
pub use error::CampaignError;
pub use file::CampaignFile;
pub use plan::{Plan, plan};
pub use store::{Standing, Store};
