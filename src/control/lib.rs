//! Controllers: from what is observed and what is wanted to a command, once every 10 ms.

pub mod aircraft_check;
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

/// What a controller sees: eq. (27) of \[GSFM26\] with the altitude, which sets the air density.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// Moment of the measurement, vehicle clock.
    pub time: Time,
    /// Physical state s^p.
    pub state: State,
    /// Observed actuator state z: positions and rates.
    pub actuators: ActuatorState,
    /// Altitude above mean sea level, m.
    pub altitude: f64,
    /// The commands in force at the last two ticks, newest first: with `actuators` they fix the
    /// actuator filters.
    pub previous: [Command; 2],
}

/// What is wanted: the commanded attitude (φ*, θ*) and the airspeed V_a* to hold meanwhile.
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
    /// The target with every component read as another kind of number.
    #[inline(always)]
    pub fn map<S: Copy>(&self, mut f: impl FnMut(R) -> S) -> Target<S> {
        Target { roll: f(self.roll), pitch: f(self.pitch), airspeed: f(self.airspeed) }
    }
}

/// A command that was not flown as its controller gave it, because it would have left the envelope.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Overruled {
    /// The command as it was given, in range.
    pub wanted: Command,
    /// The command that was flown instead.
    pub flown: Command,
}

/// A control law, called every 10 ms of vehicle time. A controller that cannot be built says so in [`build`]; one that
/// is built returns no errors: a command that is not finite says that it has none, see [`Controller::command`].
pub trait Controller: Send + Sync {
    /// The name that selects it on the command line.
    fn name(&self) -> &'static str;
    /// Forgets the past (integrators, warm starts), as before take-off or on re-engagement.
    ///
    /// The first command afterwards may differ from the one in force: whoever hands over limits
    /// how fast the surfaces move.
    fn reset(&mut self, seed: u64);
    /// The command for this tick; it need not be in range. A call neither allocates nor waits for the outside.
    ///
    /// A controller that has no command, as a planner without a plan, returns NaN: the caller must check
    /// [`Command::is_finite`] and fly something else, as the pilot does with its fallback.
    fn command(&mut self, seen: &Observation, target: &Target) -> Command;
    /// Hears, before its next command, that its last one was not flown: an integrator must not wind up behind a limit.
    fn overruled(&mut self, _by: &Overruled) {}
    /// Computes what it can before the next tick is seen: whoever has time between two commands calls this. The
    /// commands are the same if nobody does.
    fn prepare(&mut self) {}
    /// What the last command, for `seen`, was chosen from; `None` of a controller that does not plan.
    fn insight(&self, _seen: &Observation) -> Option<Insight> {
        None
    }
    /// Another controller like this one, for another core; the design is not made again.
    fn boxed_clone(&self) -> Box<dyn Controller>;
}
