//! The runtime: threads, clocks and channels around the pilot. The pilot decides on the command of each 10 ms cycle (tick).
//!
//! ```text
//! network thread ── vehicle channel ─► control thread ── bounded queue ─► recorder thread
//!                ── client channel ──►   │    ▲
//!                ◄── frames to send ─────┘    └─ one plan a tick ─ planner thread (slow controllers)
//! ```
//! The control thread owns the pilot, the vehicle's session and the server for clients (ground stations and offboard programs).
//! The vehicle has priority: a client's packet is processed only when no state frame is queued.

mod clock;
mod control;
mod guard;
mod lateness;
mod planner;
mod ports;
mod scheduling;
mod stamps;
mod summary;
mod timing;
mod recording_autopilot;

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64};
use std::thread::JoinHandle;
use std::time::Duration;

use crossbeam_channel::{Receiver, bounded};

pub use clock::{PATIENCE, Pace};
pub use guard::{Signing, SigningError, VehicleLink};
pub use scheduling::{Class, Punctuality, take_real_time};
pub use summary::Summary;
pub use timing::{Histogram, Timing};

use crate::pilot::Pilot;
use crate::recorder::{Place, RecordError, Recorder};
use control::Control;
use greylag_control::Controller;
use greylag_link::address::Address;
use greylag_link::autopilot::Text;
use greylag_link::peer::PeerId;
use greylag_link::transport::TransportError;
use greylag_link::vehicle::Profile;
use greylag_physics::mixer::Mixer;
use greylag_physics::servos::Travels;
use planner::{Planner, Threaded};
use ports::Ports;

/// Capacity of the event queue. Further events are dropped.
const EVENTS: usize = 1024;

/// Options of a flight.
#[derive(Clone, Debug)]
pub struct FlightOptions {
    /// Link address of the vehicle.
    pub vehicle: Address,
    /// Link addresses for clients.
    pub clients: Vec<Address>,
    /// Destination of the recording; `None` without a recording.
    pub record: Option<Place>,
    /// Real time or lockstep.
    pub pace: Pace,
    /// Duration after which the flight ends by itself; `None` without a limit.
    pub duration: Option<Duration>,
    /// Time from the arrival of a state frame after which its plan is late.
    pub plan_deadline: Duration,
    /// Travels of the airframe's surfaces.
    pub travels: Travels,
    /// Mixer from the commands to the airframe's individual surfaces and motors, whose commands the simulator also
    /// receives; `None` if the airframe does not name them.
    pub mixer: Option<Mixer>,
    /// Profile of a real flight controller; `None` for the simulator.
    pub controller: Option<Profile>,
    /// Delay margin of the control loop when the companion commands the surfaces through a real flight controller;
    /// `None` if it is unknown.
    pub delay_margin: Option<Duration>,
    /// Message signing of the links; `None` for unsigned links.
    pub signing: Option<Signing>,
}

impl FlightOptions {
    /// Default deadline of a planner: a cycle of 10 ms, less the time for the rest of the loop and the link.
    pub const PLAN_DEADLINE: Duration = Duration::from_millis(8);
}

/// Pilot and controller of a flight.
pub struct Companion {
    /// The pilot, which decides on the command of each tick.
    pub pilot: Pilot,
    /// The controller, which computes the command of each tick.
    pub controller: Box<dyn Controller>,
    /// Thread on which the controller runs.
    pub placement: Placement,
}

/// Thread that a controller runs on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Placement {
    /// The control thread, for controllers that compute for microseconds.
    Loop,
    /// A separate thread with a deadline, for planners.
    Thread,
}

/// A flight cannot be started.
#[derive(Debug, thiserror::Error)]
pub enum FlightError {
    /// A link cannot be opened.
    #[error(transparent)]
    Link(#[from] TransportError),
    /// The recording cannot be created.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// Signing cannot be set up.
    #[error(transparent)]
    Signing(#[from] SigningError),
    /// A thread cannot be started.
    #[error("starting the {0} thread: {1}; close other programs and try again")]
    Thread(&'static str, std::io::Error),
}

/// Events of a flight.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Event {
    /// A text that is also sent to the ground stations.
    Text(Text),
    /// The first state of the vehicle was received.
    VehicleFound(PeerId),
    /// No state of a vehicle was received in the first 2 s.
    NoVehicle,
}

/// A running flight.
pub struct Flight {
    /// Events of the flight.
    pub events: Receiver<Event>,
    /// The bound address of the vehicle's link; `None` for `tcpout:` and `serial:`.
    pub vehicle: Option<SocketAddr>,
    /// The bound addresses of the clients' links, in the order of the options.
    pub clients: Vec<Option<SocketAddr>>,
    /// Folder of the recording; `None` without a recording.
    pub recording: Option<std::path::PathBuf>,
    /// Counter of the control thread's loop iterations, about one per 10 ms.
    pub rounds: Arc<AtomicU64>,
    thread: JoinHandle<Summary>,
}

impl Flight {
    /// Opens the links and the recording. The flight then runs on a new thread until `stop` is set or the duration is
    /// over. After an error no link stays open.
    ///
    /// # Errors
    ///
    /// The first link, file or thread that cannot be opened or started.
    pub fn start(
        options: &FlightOptions,
        companion: Companion,
        stop: Arc<AtomicBool>,
    ) -> Result<Self, FlightError> {
        let ports = Ports::open(options)?;
        let recorder = options.record.as_ref().map(Recorder::start).transpose()?;
        let planner = match companion.placement {
            Placement::Loop => Planner::Inline(companion.controller),
            Placement::Thread => {
                Threaded::start(companion.controller, options.plan_deadline, options.pace)
                    .map(Planner::Threaded)
                    .map_err(|error| FlightError::Thread("planner", error))?
            }
        };
        let (say, events) = bounded(EVENTS);
        let (vehicle, clients) = (ports.vehicle_address(), ports.client_addresses());
        let recording = recorder.as_ref().map(|r| r.folder().to_owned());
        let rounds = Arc::new(AtomicU64::new(0));
        let counted = rounds.clone();
        let control = Control::new(options, companion.pilot, planner, ports, recorder, say);
        let thread = std::thread::Builder::new()
            .name("control".into())
            .spawn(move || control.run(&stop, &counted))
            .map_err(|error| FlightError::Thread("control", error))?;
        Ok(Flight { events, vehicle, clients, recording, rounds, thread })
    }

    /// Whether the flight is running.
    pub fn is_flying(&self) -> bool {
        !self.thread.is_finished()
    }

    /// Waits for the end; `None` if the control thread has panicked.
    pub fn join(self) -> Option<Summary> {
        self.thread.join().ok()
    }
}
