//! Threads, queues and counters of the hand-offs between control, planner and recorder.
//!
//! Nothing else is imported there, so that `tests/interleavings.rs` can compile the same sources with those of shuttle, which
//! tries other orders of their steps in each run.

pub use std::sync::atomic::{AtomicU64, Ordering};
pub use std::thread::{Builder, JoinHandle};

pub use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, bounded};
