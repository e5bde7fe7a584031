//! Greylag: a MAVLink offboard autopilot companion for fixed-wing aircraft.
//!
//! It turns commanded roll and pitch into actuator outputs with a grey-box model of the
//! aircraft. The modules below are declared in the order of their layers: each may use those
//! above it, never those below (`tests/architecture.rs` holds them to it).
//!
//! ```text
//! in flight   link ──► flight ──► link           flight ⇄ control ──► model ──► physics ──► num
//!             bytes    100 Hz     bytes          (pilot)              (grey box) (effects)   (numbers)
//!
//! on ground   logs ──► params ──► sim ──► report ──► fly again
//!             flight   TOML       episodes, figures
//!                                 scores
//! ```
//!
//! # From the paper to the code
//!
//! | equation of \[GSFM26\] | item |
//! |---|---|
//! | 4, 6 (state) | `physics::State` |
//! | 5, 7–12 (rigid body) | `physics::rigid_body` |
//! | 21 (scale x_c) | `model::GreyBox::scale` |
//! | 27 (actuator state) | `physics::actuators::ActuatorState` |
//! | 36–46 (forces, moments) | `physics::effects` |
//! | 13 (CEM-MPC) | `control::cem` |
//! | 30 (reward) | `control::task` |
//!
//! # Bibliography
//!
//! - **\[GSFM26\]** T. Guerin, O. Sigaud, P. Fournier, J. Marzat, "Model-based deep reinforcement
//!   learning for fixed-wing UAV attitude control with prior physics knowledge", 2026.
//! - **\[Gryte18\]** K. Gryte et al., "Aerodynamic modeling of the Skywalker X8 Fixed-Wing UAV",
//!   ICUAS 2018.
//! - **\[BM12\]** R. W. Beard, T. W. McLain, *Small Unmanned Aircraft*, Princeton, 2012.

pub mod num;
pub mod physics;
pub mod model;
pub mod control;
pub mod link;
pub mod logs;
pub mod flight;
pub mod sysid;
#[cfg(feature = "sitl")]
pub mod sim;
pub mod report;
pub mod commands;
