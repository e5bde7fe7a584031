//! The companion in flight: pilot, runtime, recorder, replay and model monitor, and a desk for tests.

mod delay_margin;
pub mod desk;
pub mod monitor;
pub mod pilot;
pub mod recorder;
pub mod replay;
pub mod runtime;
mod threads;

pub use delay_margin::delay_margin;
