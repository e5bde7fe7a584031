//! The workbench: one session with flights, the errors of a model, the effects that it lacks, and the amended model.
//!
//! [`Bench`] contains the session and its results, and has no network access. [`server`] serves it to a browser on the same
//! computer. The computations are those of the commands `compare`, `diagnose` and `amend`.

mod act;
mod ahead;
mod bench;
mod commands;
mod curves;
mod error;
#[cfg(feature = "sitl")]
mod failsafe;
mod fit;
mod flights;
mod fly;
mod installation;
mod jobs;
mod key;
mod mapping;
mod own;
mod proposal;
mod reading;
mod roles;
pub mod server;
pub mod session;
mod tuned;
mod view;

pub use act::{Act, Request};
pub use bench::{Bench, Given};
pub use curves::FlightData;
pub use error::{Kind, WorkbenchError};
#[cfg(feature = "sitl")]
pub use failsafe::{Answer, Failsafes};
pub use fly::{Order, Part};
pub use own::{Checked, check, grammar};
pub use reading::Reading;
pub use tuned::Way;
pub use view::{FreeRun, RunRequest};
