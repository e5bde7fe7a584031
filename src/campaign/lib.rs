//! Campaigns: many runs of this program with different aircraft models, controllers and random seeds, and the statistics
//! of their results.
//!
//! A campaign file lists stages (commands of this program), axes (the factors that are varied, such as the controller)
//! and seeds. [`plan`](plan()) expands it into *cells*. A cell is the command line of one stage for one combination of
//! axis levels and seed. Its identity is a hash of the command, its input files and the cells that it reads. [`store`]
//! keeps the result of each cell as one JSON line, written atomically. [`gather`] collects these lines, and [`tables`]
//! summarises them over the seeds.
//!
//! This crate does not run the cells; `greylag campaign run` does. [`launch`] writes scripts that submit this command to
//! the scheduler of a cluster.

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
