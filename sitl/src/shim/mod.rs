//! The shim: simulates the flight controller for a companion, over MAVLink.
//!
//! `sitl/PROTOCOL.md` specifies the messages. The shim sends the measured state of the plant in state frames and steps the plant
//! with the companion's answers, in [`Pace::Lockstep`] or in [`Pace::RealTime`]. It shares no MAVLink code with the companion.
//!
//! ```text
//! Flight ─ Truth ─► Sensors ─► StateFrame ─► codec ─► Link ─► companion
//!    ▲                                                           │
//!    └──────────── Inputs ◄── Answer ◄── codec ◄── Link ◄────────┘
//! ```

mod answer;
mod ardupilot_sim;
pub mod bench;
pub mod codec;
pub mod controller;
mod distortion;
mod error;
mod faults;
mod flight;
mod launch;
mod link;
mod lockstep;
mod options;
mod outputs;
mod px4_sim;
mod realtime;
mod sensors;
mod session;
mod summary;
mod telemetry;
mod truth_log;

pub use crate::plant::FULL_DEFLECTION_RAD;
pub use ardupilot_sim::{
    ArdupilotEvent, ArdupilotOptions, ChannelRange, Home, PwmRange, PwmRangeError,
};
pub use distortion::Distortion;
pub use error::ShimError;
pub use flight::Over;
pub use link::{Address, AddressError, LinkError, Transport};
pub use options::{Bias, Existing, FrameFaults, Launch, Noise, Pace, ShimOptions, TruthFile};
pub use outputs::{OutputMap, OutputMapError};
pub use px4_sim::{FIRST_US, Px4Event, Px4Noise, Px4Options, STEP_US};
pub use session::{COMPANION, SHIM};
pub use summary::{Event, Latency, Notice, Summary};

use std::sync::atomic::AtomicBool;
use std::time::Instant;

use controller::FlightController;
pub use controller::Personality;
use faults::Faults;
use flight::Flight;
use link::{Link, Wait};
use session::Session;

/// Runs until `stop` is set (polled about every 20 ms), the flight is over, or the plant fails. Reports every change of state to
/// `observer`. Blocks the calling thread.
///
/// The options are checked and the link is opened before the truth file is created. A run that cannot begin therefore leaves no
/// file.
pub fn run(
    options: &ShimOptions,
    stop: &AtomicBool,
    observer: &mut dyn FnMut(Notice),
) -> Result<Summary, ShimError> {
    options.check()?;
    let wait = match options.pace {
        Pace::Lockstep => Wait::Patient,
        Pace::RealTime => Wait::Never,
    };
    if let Some(px4) = &options.px4 {
        // A step is due every 4 ms; a patient wait could take longer.
        let link = Link::open(&options.link, Wait::Never)?;
        return px4_sim::fly(link, options, px4, stop, observer);
    }
    if let Some(ardupilot) = &options.ardupilot {
        let link = Link::open(&options.link, Wait::Patient)?;
        return ardupilot_sim::fly(link, options, ardupilot, stop, observer);
    }
    let link = Link::open(&options.link, wait)?;
    let mut flight = Flight::new(options)?;
    for note in flight.notes() {
        observer(Notice { time_s: 0.0, event: Event::Note(note) });
    }
    let mut faults = Faults::new(options.faults, options.seed);
    if let Some(personality) = options.personality {
        let mut controller = FlightController::with(personality, flight, &options.parameters)?;
        return controller::real_time::fly(link, options, &mut controller, stop, observer);
    }
    let mut session = Session::new(link, options.link.clone(), observer);
    let begun = Instant::now();
    let first_us = flight.shown_us();
    let over = match options.pace {
        Pace::Lockstep => lockstep::fly(&mut session, &mut flight, &mut faults, stop),
        Pace::RealTime => {
            let delay = options.faults.delay_ms;
            realtime::fly(&mut session, &mut flight, &mut faults, delay, stop)
        }
    };
    flight.finish()?;
    let mut summary = session.finish();
    summary.over = over?;
    summary.simulated_s = (flight.shown_us() - first_us) as f64 * 1e-6;
    summary.flown_s = flight.flown_s();
    summary.wall_s = begun.elapsed().as_secs_f64();
    Ok(summary)
}
