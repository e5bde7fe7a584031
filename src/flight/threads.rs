//! Threads, queues and counters shared by control, planner and recorder.
//!
//! Other modules import them only from here. `tests/interleavings.rs` can therefore compile the same sources with the
//! types of shuttle, which explores other interleavings in each run.

pub use std::sync::atomic::{AtomicU64, Ordering};
pub use std::thread::{Builder, JoinHandle};

pub use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, bounded};
