//! Campaigns: many runs of this program over priors, controllers and seeds, with statistics over them.
//!
//! A campaign file names axes, seeds and stages. [`plan`](plan()) expands it into *cells*: command lines of this
//! program, each with an identity derived from its command, its input files and the cells before it. [`store`] keeps
//! the result of a cell: one JSON line, written atomically. [`gather`] collects the lines; [`tables`] summarises them
//! over seeds.
//!
//! This crate runs no cell: `greylag campaign run` does, and a cluster's scheduler calls it ([`launch`]).

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
