//! The flight: the pilot that decides, the runtime that keeps time, the recorder that remembers, the
//! desk on which it is tested.

pub mod desk;
pub mod monitor;
pub mod pilot;
pub mod recorder;
pub mod replay;
pub mod runtime;
mod threads;
