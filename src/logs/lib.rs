//! Flight logs: readers and writers of the file formats, and the table that holds a flight in memory.
//!
//! [`load`] recognises the format of a file by its first bytes and resamples the recorded channels to common times.

mod assess;
mod binary;
pub mod csv;
mod door;
mod error;
pub mod finding;
mod columns;
mod dataflash;
mod dataflash_text;
mod derive;
mod flight;
mod foreign;
mod format;
mod growing;
pub mod info;
mod lag;
mod load;
pub mod mapping;
mod mixed;
mod names;
mod number;
pub mod quality;
pub mod phases;
pub mod rudder;
mod resample;
#[cfg(feature = "ros")]
mod ros;
mod rows;
mod screening;
mod shell;
mod stretches;
pub mod sources;
mod table;
mod text;
mod tlog;
mod topics;
mod ulog;
pub mod vehicle;
mod window;

pub use error::LogError;
pub use flight::{Flight, FlowAngles, Sample, Sampling};
pub use format::Format;
pub use growing::Growing;
pub use load::{Channel, Log, Options, flights, inspect, inspect_all, load, parse};
pub use names::names;
pub use shell::quoted;
pub use stretches::Stretches;
