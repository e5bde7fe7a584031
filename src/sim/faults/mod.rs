//! Simulated flights under faults of link, sensors, clocks, processor and disk. The faults are drawn from a seed, and the
//! flights are checked automatically.
//!
//! A case is a seed, a controller and a vehicle. [`CompanionFactory::fly`] flies a case for 60 s, in lockstep within
//! this process. It uses the companion's pilot and vehicle link, and the aircraft and MAVLink side of the simulator.

mod counterpart;
mod flight;
mod judge;
mod mix;
pub mod policies;
mod scenario;
pub mod search;
pub mod temporal;
mod wire;

pub use counterpart::{ControllerMode, Counterpart};
pub use flight::{
    ATTITUDE_DEG, Case, CompanionFactory, FAILS_S, Failure, FaultsError, Report, Watched, Witnessed,
};
pub use judge::{Cause, Finding, Found};
pub use mix::{Fault, FaultKind, draw};
pub use scenario::{Asked, Asking, ControllerSetting, Leg, Scenario, Setting};
