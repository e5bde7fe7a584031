//! False alarms and detection delays of the model monitor, which compares measured accelerations with those that the model
//! predicts. The flights are simulated with an emulated ArduPlane whose attitude estimate has errors. The companion is engaged
//! when it has control of the aircraft.

use std::time::Duration;

use greylag_sitl::hidden::Hidden;
use greylag_sitl::shim::controller::FlightController;
use greylag_sitl::shim::{Launch, Noise, Personality, ShimOptions};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{CompanionFactory, FaultsError};
use crate::faults::Counterpart;
use crate::faults::scenario::Scenario;
use greylag_flight::desk::Desk;
use greylag_flight::monitor::Monitor;
use greylag_link::autopilot::{AttitudeSetpoint, Autopilot, Mode, Verdict};

/// Id of the random stream of attitude errors and winds.
const DRAWN: u64 = 30;
/// Bounds (±) of the uniformly drawn errors of roll, pitch and heading, degrees. They represent alignment and compass
/// errors.
pub const ATTITUDE_DEG: [f64; 3] = [1.0, 1.0, 2.0];
/// Bound of each uniformly drawn wind component, m/s.
const WIND_MPS: f64 = 4.0;
/// Duration of a flight, s.
const FLIGHT_S: f64 = 60.0;
/// Time at which a surface jams, s. The companion is engaged earlier, within the first 10 s.
pub const FAILS_S: f64 = 25.0;
/// Commanded roll and pitch of the legs, degrees. Each leg lasts `LEG_S` seconds.
const LEGS: [[f64; 2]; 6] =
    [[0.0, 2.0], [25.0, 3.0], [-20.0, 5.0], [0.0, 0.0], [-35.0, 4.0], [15.0, 6.0]];
const LEG_S: f64 = 5.0;

/// Failure of the aircraft.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failure {
    /// The aircraft has no failure.
    None,
    /// The elevator jams in flight.
    StuckElevator,
    /// The aileron jams in flight.
    StuckAileron,
    /// Ice from the start: the simulator's effect `drag_alpha2=100`, which doubles the drag at cruise.
    Ice,
    /// A centre of gravity that is 4 cm further aft, from the start.
    ShiftedLoad,
}

impl Failure {
    /// All kinds of failure.
    pub const ALL: [Failure; 5] = [
        Failure::None,
        Failure::StuckElevator,
        Failure::StuckAileron,
        Failure::Ice,
        Failure::ShiftedLoad,
    ];

    /// The name in tables and reports.
    pub fn name(self) -> &'static str {
        match self {
            Failure::None => "healthy",
            Failure::StuckElevator => "elevator sticks",
            Failure::StuckAileron => "aileron sticks",
            Failure::Ice => "ice: twice the drag",
            Failure::ShiftedLoad => "load 4 cm aft",
        }
    }

    /// The simulator's effect that represents the failure and is active from the start. `None` without failure and for a surface
    /// that jams in flight.
    fn effect(self) -> Option<&'static str> {
        match self {
            Failure::Ice => Some("drag_alpha2=100"),
            Failure::ShiftedLoad => Some("cg_shift=0.04"),
            Failure::None | Failure::StuckElevator | Failure::StuckAileron => None,
        }
    }
}

/// Reports of the monitor in one flight.
#[derive(Clone, Debug, PartialEq)]
pub struct Watched {
    /// Constant errors of the estimated roll, pitch and yaw, degrees.
    pub attitude_error_deg: [f64; 3],
    /// Time from which the companion can observe the failure, s. It is the time of the failure, or the time of the first
    /// engagement if that is later. `None` if the companion was never engaged.
    pub since_s: Option<f64>,
    /// Reports of the monitor with their times, s.
    pub said: Vec<(f64, String)>,
}

impl CompanionFactory {
    /// Flies for 60 s with the monitor switched on. All random numbers follow from `seed`.
    ///
    /// # Errors
    ///
    /// If the flight cannot be set up; `FaultsError` lists the reasons.
    pub fn watched(&self, seed: u64, failure: Failure) -> Result<Watched, FaultsError> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(DRAWN);
        let attitude_error_deg = ATTITUDE_DEG.map(|most| random.random_range(-most..most));
        let [north, east] = [(); 2].map(|()| random.random_range(-WIND_MPS..WIND_MPS));
        let mut plant = self.plant.clone();
        if let Some(effect) = failure.effect() {
            plant.hidden.push(effect.parse::<Hidden>()?);
        }
        let scenario = Scenario {
            wind_ned_mps: [north, east, 0.0],
            turbulence: 1 + (seed % 3) as u8,
            ..Scenario::of_seed(Counterpart::Ardupilot, seed)
        };
        let mut options = ShimOptions::new(scenario.air(&plant), plant.start);
        options.seed = seed;
        options.noise = Noise::REALISTIC;
        options.bias.attitude_rad = attitude_error_deg.map(f64::to_radians);
        options.launch = Launch::Immediate;
        let mut desk = self.desk(Counterpart::Ardupilot)?;
        desk.pilot().monitor_with(Monitor::new(self.model.clone()));
        let mut bench = Bench {
            controller: FlightController::new(Personality::Ardupilot, &options)?,
            desk,
            armed: false,
            watched: Watched { attitude_error_deg, since_s: None, said: Vec::new() },
        };
        for step in 0..(100.0 * FLIGHT_S) as u64 {
            if step == (100.0 * FAILS_S) as u64 {
                bench.fail(failure);
            }
            if !bench.step(step) {
                break;
            }
        }
        Ok(bench.watched)
    }
}

/// A companion with its client and a simulated flight controller.
struct Bench {
    controller: FlightController,
    desk: Desk,
    armed: bool,
    watched: Watched,
}

impl Bench {
    fn fail(&mut self, failure: Failure) {
        match failure {
            Failure::StuckAileron => self.controller.jam_aileron(),
            Failure::StuckElevator => self.controller.jam_elevator(),
            Failure::None | Failure::Ice | Failure::ShiftedLoad => return,
        }
        self.watched.since_s = self.watched.since_s.map(|_| FAILS_S);
    }

    /// Advances by 10 ms. Returns `false` if the flight has ended on the ground or with a state that is not finite.
    fn step(&mut self, step: u64) -> bool {
        let (at_s, host) = (step as f64 * 0.01, Duration::from_millis(1000 + 10 * step));
        let (mut down, mut up) = (Vec::new(), Vec::new());
        self.controller.show(&mut down);
        self.desk.receive(host, &down, &mut up, |_, _| {});
        self.client(step, at_s, host);
        self.desk.poll(host, &mut up);
        for text in self.desk.texts.drain(..) {
            if text.words.starts_with("engaged") {
                self.watched.since_s.get_or_insert(at_s);
            }
            if text.words.contains("deviates from the model") {
                self.watched.said.push((at_s, text.words));
            }
        }
        self.controller.receive(&up);
        matches!(self.controller.fly(), Ok(None))
    }

    /// Sends the setpoint of the present leg. Arms the companion and sets OFFBOARD as soon as possible.
    fn client(&mut self, step: u64, at_s: f64, host: Duration) {
        let [roll, pitch] = LEGS[(at_s / LEG_S) as usize % LEGS.len()].map(f64::to_radians);
        let setpoint = AttitudeSetpoint { roll, pitch, thrust: None };
        let now = self.desk.now(host);
        self.desk.pilot().attitude_setpoint(now, setpoint);
        if !self.armed && step.is_multiple_of(10) {
            self.armed = self.desk.arm(host) == Verdict::Accepted;
            if self.armed {
                // The mode is refused only if the link is lost at this moment. The companion then flies in HOLD.
                let _ = self.desk.pilot().set_mode(now, Mode::Offboard);
            }
        }
    }
}

impl Watched {
    /// Delay from `since_s` to the first report after it, s; `None` if no report follows.
    pub fn delay_s(&self) -> Option<f64> {
        let since = self.since_s?;
        self.said.iter().map(|(at, _)| at - since).find(|delay| *delay >= 0.0)
    }

    /// Number of reports before `since_s`. All reports count if there is no failure or the companion was never engaged.
    pub fn false_alarms(&self, failure: Failure) -> usize {
        let healthy =
            |at: f64| failure == Failure::None || self.since_s.is_none_or(|since| at < since);
        self.said.iter().filter(|(at, _)| healthy(*at)).count()
    }
}
