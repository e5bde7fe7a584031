//! Controllers: they map an observation and a target to a command every 10 ms. A tick is one such control cycle.

pub mod adaptive;
pub mod aircraft_check;
pub mod aircraft_estimate;
pub mod any;
mod authority;
pub mod cem;
mod disturbance;
pub mod envelope;
pub mod ilqr;
pub mod insight;
pub mod lqi;
pub mod pid;
pub mod policy;
pub mod quality;
pub mod stick_response;
pub mod task;
mod registry;

pub use registry::{ControllerKind, Needs, Pace, SetupError, Source, build};

use insight::Insight;

use greylag_physics::{ActuatorState, Command, State, Time};

/// Input of a controller: eq. (27) of \[GSFM26\] (T. Guerin et al., 2026, see `src/lib.rs`), and the altitude, which sets the air
/// density.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// Time of the measurement on the vehicle's clock.
    pub time: Time,
    /// Physical state s^p, eq. (4) of \[GSFM26\].
    pub state: State,
    /// Standard deviations of the angle of attack and the sideslip in `state`, rad. Zero where they are measured or exact.
    pub incidence_sd: [f64; 2],
    /// Observed actuator state z: positions and rates.
    pub actuators: ActuatorState,
    /// Altitude above mean sea level, m.
    pub altitude: f64,
    /// The commands of the last two ticks, newest first. Together with `actuators` they determine the state of the
    /// actuator filters.
    pub previous: [Command; 2],
}

/// Commanded attitude (φ*, θ*) and the airspeed V_a* to be held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target<R = f64> {
    /// Commanded roll φ*, rad.
    pub roll: R,
    /// Commanded pitch θ*, rad.
    pub pitch: R,
    /// Airspeed to hold as far as thrust allows, m/s.
    pub airspeed: R,
}

impl<R: Copy> Target<R> {
    /// The target with its components converted to another number type.
    #[inline(always)]
    pub fn map<S: Copy>(&self, mut f: impl FnMut(R) -> S) -> Target<S> {
        Target { roll: f(self.roll), pitch: f(self.pitch), airspeed: f(self.airspeed) }
    }
}

/// A command that the envelope limiter changed before it was flown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Overruled {
    /// The controller's command, clamped to its range.
    pub wanted: Command,
    /// The command that was flown instead.
    pub flown: Command,
}

/// Whether an increment of an integral led its command further beyond the limit that changed the command. `moved` is the flown
/// minus the wanted command, `effect` the change of the command by the increment, in the same unit. Only such an increment is
/// undone: one that leads back must remain, or an integral that demands more than the limit never falls.
pub(crate) fn winds_up(moved: f64, effect: f64) -> bool {
    moved * effect < 0.0
}

/// A control law, called every 10 ms of vehicle time.
///
/// Order of calls: [`Controller::reset`] before the first tick after the controller takes over, then [`Controller::command`]
/// once per tick. [`Controller::prepare`] is optional between two ticks. If the last command was limited,
/// [`Controller::overruled`] precedes the next command. [`Controller::insight`] describes the last command. Errors occur only
/// on construction ([`build`]).
pub trait Controller: Send + Sync {
    /// The name that selects the controller on the command line.
    fn name(&self) -> &'static str;
    /// Clears the internal state (integrators, warm starts) before take-off or when the controller takes over again.
    ///
    /// The first command after a reset may differ from the present deflections. The caller limits the slew rate of the
    /// surfaces.
    fn reset(&mut self, seed: u64);
    /// The command for this tick, not necessarily in range. A call neither allocates memory nor blocks.
    ///
    /// A controller without a command, such as a planner without a plan, returns NaN. The caller must check
    /// [`Command::is_finite`] and fly another controller, as the pilot does with its fallback controller.
    fn command(&mut self, seen: &Observation, target: &Target) -> Command;
    /// Informs the controller, before its next command, that its last command was limited. The controller then prevents its
    /// integrators from winding up.
    fn overruled(&mut self, _by: &Overruled) {}
    /// Computes part of the next tick in advance, in the time between two commands. The commands are the same without this
    /// call.
    fn prepare(&mut self) {}
    /// The candidate plans from which the last command was chosen, for the observation `seen`. `None` for a controller that
    /// does not plan.
    fn insight(&self, _seen: &Observation) -> Option<Insight> {
        None
    }
    /// A copy of this controller for another thread. The copy is not designed anew.
    fn boxed_clone(&self) -> Box<dyn Controller>;
}
