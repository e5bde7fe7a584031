//! The flight: the pilot that decides, the runtime that keeps time, the recorder that remembers.

pub mod pilot;
pub mod recorder;
pub mod runtime;
