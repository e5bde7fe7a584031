//! A flight in memory, with the formats it is read from or written to.
//!
//! [`load`] reads any of the four formats, distinguished by their first bytes, onto one table.

pub mod csv;
pub mod finding;
mod columns;
mod dataflash;
mod derive;
mod flight;
mod format;
mod growing;
pub mod info;
mod load;
pub mod mapping;
mod mixed;
mod names;
pub mod phases;
pub mod rudder;
mod resample;
mod rows;
mod screening;
mod table;
mod tlog;
mod topics;
mod ulog;

pub use flight::{Flight, FlowAngles, Sample, Sampling};
pub use format::Format;
pub use growing::Growing;
pub use load::{Channel, Log, LogError, Options, inspect, load, parse};
pub use names::names;
