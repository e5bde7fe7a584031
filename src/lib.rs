//! Greylag: a companion autopilot for fixed-wing aircraft. It communicates with flight controllers and clients by MAVLink.
//!
//! Greylag turns commanded roll and pitch into actuator outputs with a grey-box model of the aircraft: a physical prior
//! plus a learned residual. The modules below are declared in the order of their layers. Each layer may use only the layers
//! above it; `tests/house/architecture.rs` checks this order. Each layer is a separate crate, `greylag-num` to
//! `greylag-workbench`.
//!
//! ```text
//! in flight   link ──► flight ──► link           flight ⇄ control ──► model ──► physics ──► num
//!             bytes    100 Hz     bytes          (pilot)  LQI, policy (grey box) (effects)   (numbers)
//!                                                         and planner
//!
//! on ground   logs ──► sysid ──► params ──► sim ──► report ──► fly again
//!             flight   where it   TOML  ▲  episodes, figures
//!                      fails            │  scores
//!             logs ──► learn ───────────┘
//!                      residual and prior, then actor and critics (safetensors)
//! ```
//!
//! # One tick
//!
//! A tick is a control cycle of 10 ms. [`link::vehicle`] decodes a state frame into telemetry.
//! [`flight::pilot::Pilot::observe`] turns the telemetry into an observation with a target inside the envelope. A
//! [`control::Controller`] computes a command. [`flight::pilot::Pilot::decide`] takes this command or that of a fallback
//! controller and limits the slew rate of surfaces and throttle. The link sends the result. The pilot uses no socket and no
//! clock: the same telemetry gives the same commands.
//!
//! # From the paper to the code
//!
//! | equation of \[GSFM26\] | item |
//! |---|---|
//! | 4, 6 (state) | [`physics::State`] |
//! | 5, 19 (dynamics) | [`model::GreyBox::rate`] |
//! | 7–12, 35 (rigid body) | [`physics::rigid_body`] |
//! | 13 (CEM-MPC) | [`control::cem`] |
//! | 19 (residual) | [`model::Residual`] |
//! | 20, 22–24 (loss) | `learn::Objective` |
//! | 21 (scale x_c) | [`model::GreyBox::scale`] |
//! | 26 (hybrid controller) | [`control::cem`] |
//! | 27 (actuator state) | [`physics::ActuatorState`], exact filters in [`physics::actuators`] |
//! | 28 (observation) | [`control::policy::observe`] |
//! | 29 (action) | [`physics::Command`] |
//! | 30 (reward) | [`control::task::Task`] |
//! | 31–34 (air-relative velocity) | [`physics::rigid_body::air_velocity`] |
//! | 36, 39, 43 (forces in body axes) | [`physics::rigid_body::body_force`] |
//! | 37 (gravity) | [`physics::rigid_body::gravity_in_body`] |
//! | 38 (thrust) | [`physics::effects::ThrustLinear`] |
//! | 40 (drag) | [`physics::effects::DragLinear`] |
//! | 41 (lift) | [`physics::effects::LiftLinear`] |
//! | 42 (side force) | [`physics::effects::SideForceLinear`] |
//! | 44–46 (moments) | [`physics::effects::RollLinear`], [`physics::effects::PitchLinear`], [`physics::effects::YawLinear`] |
//! | Table II (targets) | `sim::targets` |
//! | Table VII (TD3) | `learn::Hyperparameters` |
//! | section V-E (protocol) | `sim::episode` |
//!
//! # Bibliography
//!
//! - **\[GSFM26\]** T. Guerin, O. Sigaud, P. Fournier, J. Marzat, "Model-based deep reinforcement
//!   learning for fixed-wing UAV attitude control with prior physics knowledge", 2026.
//! - **\[Gryte18\]** K. Gryte et al., "Aerodynamic modeling of the Skywalker X8 Fixed-Wing UAV",
//!   ICUAS 2018.
//! - **\[BM12\]** R. W. Beard, T. W. McLain, *Small Unmanned Aircraft*, Princeton, 2012.

// Numbers, random streams, statistics.
pub use greylag_num as num;

// State, actuators, airframe, rigid body, effects.
pub use greylag_physics as physics;

// The grey box: prior and residual.
pub use greylag_model as model;

// Controllers and planners.
pub use greylag_control as control;

// Flight-test schedules.
pub use greylag_manoeuvres as manoeuvres;

// MAVLink.
pub use greylag_link as link;

// Reading of flight logs.
pub use greylag_logs as logs;

// Pilot, runtime and recorder in flight.
pub use greylag_flight as flight;

// System identification: finds missing effects in a log.
pub use greylag_sysid as sysid;

// Flights simulated in JSBSim or in a model, with their scores.
#[cfg(any(feature = "demo", feature = "learn"))]
pub use greylag_sim as sim;

// Training of models and policies. Only this layer uses the machine-learning library burn.
#[cfg(feature = "learn")]
pub use greylag_learn as learn;

// Campaigns of many runs, which can be resumed.
#[cfg(feature = "study")]
pub use greylag_campaign as campaign;

// Reports as HTML pages.
pub use greylag_report as report;

// The workbench: identification and flights in a browser.
#[cfg(feature = "study")]
pub use greylag_workbench as workbench;

pub mod commands;
