//! The runtime: threads, clocks, channels around the pilot.
//!
//! ```text
//! network thread ── vehicle channel ─► control thread ── bounded queue ─► recorder thread
//!                ── client channel ──►   │    ▲
//!                ◄── frames to send ─────┘    └─ one plan a tick ─ planner thread (slow controllers)
//! ```
//! The control thread owns the pilot, the vehicle's session, the client server. It serves the
//! vehicle first: a client's packet is looked at only when no state frame waits.

mod clock;
mod control;
mod guard;
mod planner;
mod ports;
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

/// Events that may wait for whoever shows them; more are dropped.
const EVENTS: usize = 1024;

/// How to fly.
#[derive(Clone, Debug)]
pub struct FlightOptions {
    /// The vehicle's link.
    pub vehicle: Address,
    /// The clients' links.
    pub clients: Vec<Address>,
    /// Where to record, if at all.
    pub record: Option<Place>,
    /// Real time or lockstep.
    pub pace: Pace,
    /// Ends by itself after this time.
    pub duration: Option<Duration>,
    /// Time after the arrival of a state frame at which a plan is late.
    pub plan_deadline: Duration,
    /// How far the airframe's surfaces go.
    pub travels: Travels,
    /// Surfaces and motors of the airframe, where it names them: the `sitl` profile sends their commands too.
    pub mixer: Option<Mixer>,
    /// How a real flight controller is flown; `None` is the simulator's shim.
    pub controller: Option<Profile>,
    /// How links are signed, if at all.
    pub signing: Option<Signing>,
}

impl FlightOptions {
    /// The time that a planner has by default: a cycle of 10 ms less what the rest of the loop
    /// and the link need.
    pub const PLAN_DEADLINE: Duration = Duration::from_millis(8);
}

/// Who flies.
pub struct Companion {
    /// Decides.
    pub pilot: Pilot,
    /// Computes the command of each tick.
    pub controller: Box<dyn Controller>,
    /// Where it computes it.
    pub placement: Placement,
}

/// Where a controller runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Placement {
    /// In the control loop: for controllers that need microseconds.
    Loop,
    /// On a thread of its own, with a deadline: for planners.
    Thread,
}

/// Why a flight cannot begin.
#[derive(Debug, thiserror::Error)]
pub enum FlightError {
    /// A link cannot be opened.
    #[error(transparent)]
    Link(#[from] TransportError),
    /// The recording cannot be created.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// Links cannot be signed.
    #[error(transparent)]
    Signing(#[from] SigningError),
    /// A thread cannot be started.
    #[error("starting the {0} thread: {1}; close other programs and try again")]
    Thread(&'static str, std::io::Error),
}

/// What a flight has to say while it lasts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Event {
    /// A line that also goes to the ground stations.
    Text(Text),
    /// The first state of the vehicle has come.
    VehicleFound(PeerId),
    /// No vehicle has been heard since the start.
    NoVehicle,
}

/// A flight under way.
pub struct Flight {
    /// What it has to say.
    pub events: Receiver<Event>,
    /// The address of the vehicle's link; none for `tcpout:`.
    pub vehicle: Option<SocketAddr>,
    /// The addresses of the clients' links, in the order of the options.
    pub clients: Vec<Option<SocketAddr>>,
    /// Where it is recorded.
    pub recording: Option<std::path::PathBuf>,
    /// How many rounds the control thread has gone, one in 10 ms at least while it lives.
    pub rounds: Arc<AtomicU64>,
    thread: JoinHandle<Summary>,
}

impl Flight {
    /// Opens the links and the recording, then flies on a thread of its own until `stop` is set
    /// or the duration is over. Either everything is open when this returns, or nothing.
    ///
    /// # Errors
    /// The first thing that cannot be opened.
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

    /// Whether it is still under way.
    pub fn is_flying(&self) -> bool {
        !self.thread.is_finished()
    }

    /// Waits for its end; `None` if the control thread has died of a panic.
    pub fn join(self) -> Option<Summary> {
        self.thread.join().ok()
    }
}
