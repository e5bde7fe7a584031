//! Flight: the pilot, which decides; the runtime with threads and clocks; the recorder; and the desk for tests.

mod delay_margin;
pub mod desk;
pub mod monitor;
pub mod pilot;
pub mod recorder;
pub mod replay;
pub mod runtime;
mod threads;

pub use delay_margin::delay_margin;
