//! A campaign: many runs of this program over priors, controllers and seeds, and what they say together.
//!
//! A campaign file names axes, seeds and stages. [`plan`](plan()) makes of it *cells*: command lines of this program, each
//! with an identity that its command, its input files and the cells before it decide. [`store`] keeps what a cell
//! gave: one JSON line, written whole. [`gather`] joins the lines; [`tables`] sums them up over seeds.
//!
//! Nothing here runs a cell: `greylag campaign run` does, and a cluster's scheduler calls that ([`launch`]).

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
