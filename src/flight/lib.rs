//! The companion, which is Greylag's autopilot on board.
//!
//! The pilot decides, the runtime connects it to threads and sockets, the recorder writes flights and replay repeats them. The
//! monitor compares measurements with the model. The desk runs the companion without threads and sockets, for tests.

mod delay_margin;
pub mod desk;
pub mod monitor;
pub mod pilot;
pub mod recorder;
pub mod replay;
pub mod runtime;
mod threads;

pub use delay_margin::delay_margin;
