//! The types for threads, queues and counters that the control loop, the planner and the recorder use.
//!
//! Other modules import them only from here. `tests/interleavings.rs` can therefore compile the same sources with the types
//! of the crate shuttle, which tests other interleavings of the threads in each run.

pub use std::sync::atomic::{AtomicU64, Ordering};
pub use std::thread::{Builder, JoinHandle};

pub use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, bounded};
