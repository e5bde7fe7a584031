//! The vehicle link to the simulator `greylag-sitl` (profile `sitl`). The shim, the simulator's MAVLink side, sends each state of
//! the vehicle as five messages (a state frame). The companion (Greylag's autopilot) answers each with one command message.

use std::time::Duration;

use super::{Faults, Notice, Order, Outputs, Telemetry, VANE_SD, limits};
use crate::autopilot::Severity;
use crate::framing::{Frame, FrameCounts, Frames, Source, Version};
use crate::peer::PeerId;
use crate::wire::Message;
use crate::wire::setpoint::euler;
use crate::wire::sitl::{self as wire, VehicleMessage};
use greylag_physics::mixer::Mixer;
use greylag_physics::servos::{Travel, Travels};
use greylag_physics::{ActuatorState, Command, State, Time};

/// Component id of the shim.
const SHIM: u8 = 200;
/// Component id of the companion.
const COMPANION: u8 = 1;
/// Nominal time between state frames, µs.
const PERIOD_US: u64 = 10_000;
/// If a timestamp is older than the last one by more than this, µs, the vehicle has restarted. If it is older by less, the
/// datagram is late.
const RESTART_US: u64 = 1_000_000;
/// Silence of the present peer (network address) of the link after which another peer may take over.
const TAKEOVER: Duration = Duration::from_secs(1);
/// Largest relative difference at which surface travels of airframe file and vehicle count as equal. The airframe file has
/// four digits.
const TRAVEL_TOLERANCE: f64 = 1e-3;
const HEARTBEAT: Duration = Duration::from_secs(1);

/// Counters of the vehicle link.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct VehicleCounts {
    /// MAVLink frames, valid and invalid.
    pub frames: FrameCounts,
    /// State frames delivered as new.
    pub states: u64,
    /// State frames lost, counted from gaps between the timestamps.
    pub lost: u64,
    /// State frames with the same timestamp as the one before.
    pub repeated: u64,
    /// State frames that arrived after a newer one.
    pub late: u64,
    /// State frames that lack a message, or whose messages have different timestamps.
    pub incomplete: u64,
    /// State frames with at least one fault (implausible value).
    pub faulty: u64,
    /// Starts of the vehicle's clock, including the first.
    pub starts: u64,
    /// Valid MAVLink frames from senders other than the vehicle.
    pub foreign: u64,
    /// Commands that were not finite and were replaced by the last finite command.
    pub bad_commands: u64,
}

/// Contents of the messages of the next state frame that have been received so far.
#[derive(Clone, Copy, Debug, Default)]
struct Parts {
    imu: Option<(Time, [f64; 3])>,
    air: Option<(f64, f64)>,
    incidence: Option<(Time, f64, f64)>,
    actuators: Option<(Time, [f64; 7], Travels)>,
}

/// Connection to a vehicle with the `sitl` profile.
#[derive(Clone, Debug)]
pub struct Sitl {
    system: u8,
    /// Travels of the surfaces from the airframe file.
    travels: Travels,
    /// Surfaces and motors of the airframe; `None` if the airframe does not name them.
    mixer: Option<Mixer>,
    /// The vehicle's surface travels, if they differ from those of the airframe file.
    foreign_travel: Option<Travels>,
    told_foreign_travel: bool,
    parts: Parts,
    /// The newest delivered state. Parts of the next state that are faulty take their values from it.
    last: Telemetry,
    peer: Option<(PeerId, Duration)>,
    last_command: Command,
    sequence: u8,
    next_heartbeat: Duration,
    counts: VehicleCounts,
}

impl Sitl {
    /// A connection to the vehicle with the system id `system`. `travels` are the surface travels of the airframe file. The
    /// vehicle normalises surface positions by its own travels. If these differ from `travels`, it cannot be controlled.
    pub fn new(system: u8, travels: Travels) -> Self {
        let nan = f64::NAN;
        let nothing = Telemetry {
            time: Time::default(),
            order: Order::First,
            faults: Faults::NONE,
            state: State::NEUTRAL,
            incidence_sd: VANE_SD,
            yaw: 0.0,
            rate_hold_s: PERIOD_US as f64 * 1e-6,
            specific_force: [0.0, 0.0, -9.81],
            actuators: ActuatorState::default(),
            altitude: 0.0,
            position: [nan; 2],
            velocity: [nan; 3],
            wind: [nan; 3],
        };
        Sitl {
            system,
            travels,
            mixer: None,
            foreign_travel: None,
            told_foreign_travel: false,
            parts: Parts::default(),
            last: nothing,
            peer: None,
            last_command: Command::IDLE,
            sequence: 0,
            next_heartbeat: Duration::ZERO,
            counts: VehicleCounts::default(),
        }
    }

    /// With a mixer, a command message also has the commands of the individual surfaces and motors, after those of aileron,
    /// elevator, throttle and rudder.
    pub fn with_mixer(self, mixer: Option<Mixer>) -> Self {
        Sitl { mixer, ..self }
    }

    /// Handles received bytes, see [`super::Vehicle::handle`].
    pub fn handle(
        &mut self,
        host: Duration,
        peer: PeerId,
        bytes: &[u8],
        mut deliver: impl FnMut(Telemetry),
    ) {
        let mut counts = FrameCounts::default();
        for frame in Frames::new(bytes, &mut counts) {
            if !self.is_vehicle(host, peer, &frame) {
                self.counts.foreign += 1;
            } else if let Some(message) = wire::read(&frame)
                && let Some(telemetry) = self.take(message)
            {
                deliver(telemetry);
            }
        }
        self.counts.frames.add(counts);
    }

    /// Whether the frame is from the vehicle: it has the right ids and comes from the present peer of the link. The states of
    /// two simulators that run at the same time are therefore not mixed.
    fn is_vehicle(&mut self, host: Duration, peer: PeerId, frame: &Frame<'_>) -> bool {
        if frame.source != (Source { system: self.system, component: SHIM }) {
            return false;
        }
        match self.peer {
            Some((owner, heard)) if owner != peer && host.saturating_sub(heard) < TAKEOVER => false,
            _ => {
                self.peer = Some((peer, host));
                true
            }
        }
    }

    fn take(&mut self, message: VehicleMessage) -> Option<Telemetry> {
        match message {
            VehicleMessage::Imu { time, specific_force } => {
                self.parts.imu = Some((time, specific_force))
            }
            VehicleMessage::Air { airspeed, altitude } => {
                self.parts.air = Some((airspeed, altitude))
            }
            VehicleMessage::Incidence { time, alpha, beta } => {
                self.parts.incidence = Some((time, alpha, beta))
            }
            VehicleMessage::Actuators { time, active, outputs, travels } => {
                self.parts.actuators = (active >= 5).then_some((time, outputs, travels));
            }
            VehicleMessage::Position { position, velocity } if limits::position(position) => {
                (self.last.position, self.last.velocity) = (position, velocity);
            }
            VehicleMessage::Wind(wind) if limits::wind(wind) => self.last.wind = wind,
            VehicleMessage::Attitude { boot_ms, quaternion, rates } => {
                let parts = std::mem::take(&mut self.parts);
                return self.complete(parts, boot_ms, quaternion, rates);
            }
            VehicleMessage::Position { .. }
            | VehicleMessage::Wind(_)
            | VehicleMessage::Heartbeat => {}
        }
        None
    }

    /// Assembles a state frame. Returns `None` if messages are missing or have different timestamps.
    fn complete(
        &mut self,
        parts: Parts,
        boot_ms: u32,
        q: [f64; 4],
        rates: [f64; 3],
    ) -> Option<Telemetry> {
        let whole = parts.imu.zip(parts.air).zip(parts.incidence.zip(parts.actuators));
        let Some((((time, force), air), ((time_b, alpha, beta), (time_c, outputs, travels)))) =
            whole
        else {
            self.counts.incomplete += 1;
            return None;
        };
        // The timestamp in milliseconds may be rounded up or down.
        let off_ms = boot_ms.wrapping_sub((time.as_micros() / 1000) as u32);
        if time_b != time || time_c != time || !matches!(off_ms, 0 | 1 | u32::MAX) {
            self.counts.incomplete += 1;
            return None;
        }
        let order = self.order(time);
        let mut next = Telemetry { time, order, faults: Faults::NONE, ..self.last };
        fill_motion(&mut next, q, rates);
        fill_air(&mut next, air, [alpha, beta], force);
        fill_actuators(&mut next, outputs, &travels);
        self.compare_travel(travels);
        self.counts.faulty += u64::from(!next.faults.is_empty());
        if order != Order::Late {
            self.last = next;
        }
        Some(next)
    }

    fn compare_travel(&mut self, found: Travels) {
        self.foreign_travel = (!alike(&found, &self.travels)).then_some(found);
    }

    /// Reason for which the companion cannot take control of the vehicle, see [`super::Vehicle::obstacle`].
    pub fn obstacle(&self) -> Option<String> {
        self.foreign_travel.map(|found| {
            format!(
                "the vehicle's travel is {}, the airframe file's is {}: give the model and airframe of \
                 this aircraft",
                described(&found),
                described(&self.travels)
            )
        })
    }

    /// The next notice, see [`super::Vehicle::take_notice`]. The only notice of this profile is about differing travels, once.
    pub fn take_notice(&mut self) -> Option<Notice> {
        if self.told_foreign_travel {
            return None;
        }
        let obstacle = self.obstacle()?;
        self.told_foreign_travel = true;
        Some(Notice::Text(Severity::Error, format!("cannot be engaged: {obstacle}")))
    }

    /// Compares the timestamp of a state frame with that of the newest one, and updates the counters.
    fn order(&mut self, time: Time) -> Order {
        let (now, before) = (time.as_micros(), self.last.time.as_micros());
        if self.counts.starts == 0 || now.saturating_add(RESTART_US) < before {
            self.counts.starts += 1;
            self.counts.states += 1;
            return Order::First;
        }
        match now.cmp(&before) {
            std::cmp::Ordering::Less => {
                self.counts.late += 1;
                Order::Late
            }
            std::cmp::Ordering::Equal => {
                self.counts.repeated += 1;
                Order::Repeated
            }
            std::cmp::Ordering::Greater => {
                let periods = (now - before).saturating_add(PERIOD_US / 2) / PERIOD_US;
                let lost = u32::try_from(periods.saturating_sub(1)).unwrap_or(u32::MAX);
                self.counts.lost = self.counts.lost.saturating_add(lost.into());
                self.counts.states += 1;
                Order::Next { lost }
            }
        }
    }

    /// The reply to a state, see [`super::Vehicle::answer`]. A command that is not finite is replaced by the last finite one.
    pub fn command(&mut self, time: Time, outputs: Outputs) -> Vec<u8> {
        let outputs = match outputs {
            Outputs::Armed(command) if !command.is_finite() => {
                self.counts.bad_commands += 1;
                Outputs::Armed(self.last_command)
            }
            Outputs::Armed(command) => {
                self.last_command = command;
                outputs
            }
            Outputs::Disarmed => {
                self.last_command = Command::IDLE;
                outputs
            }
        };
        self.write(&wire::actuator_controls(time, outputs, self.mixer.as_ref()))
    }

    /// The heartbeat if it is due at `host`, see [`super::Vehicle::due`].
    pub fn heartbeat(&mut self, host: Duration, outputs: Outputs) -> Option<Vec<u8>> {
        if host < self.next_heartbeat {
            return None;
        }
        self.next_heartbeat = host + HEARTBEAT;
        Some(self.write(&wire::heartbeat(outputs)))
    }

    /// The present peer of the link, see [`super::Vehicle::peer`].
    pub fn peer(&self) -> Option<PeerId> {
        self.peer.map(|(peer, _)| peer)
    }

    /// Traffic counters, see [`super::Vehicle::counts`].
    pub fn counts(&self) -> VehicleCounts {
        self.counts
    }

    fn write(&mut self, message: &Message) -> Vec<u8> {
        let source = Source { system: self.system, component: COMPANION };
        self.sequence = self.sequence.wrapping_add(1);
        message.encode(Version::V2, self.sequence, source).unwrap_or_default()
    }
}

fn fill_motion(next: &mut Telemetry, quaternion: [f64; 4], rates: [f64; 3]) {
    match euler(quaternion) {
        Ok((roll, pitch, yaw)) => {
            (next.state.roll, next.state.pitch, next.yaw) = (roll, pitch, yaw)
        }
        Err(_) => next.faults.insert(Faults::ATTITUDE),
    }
    match limits::rates(rates) {
        true => [next.state.p, next.state.q, next.state.r] = rates,
        false => next.faults.insert(Faults::RATES),
    }
}

fn fill_air(
    next: &mut Telemetry,
    (airspeed, altitude): (f64, f64),
    [alpha, beta]: [f64; 2],
    force: [f64; 3],
) {
    match limits::air(airspeed, altitude) {
        true => (next.state.airspeed, next.altitude) = (airspeed, altitude),
        false => next.faults.insert(Faults::AIR),
    }
    match limits::incidence(alpha, beta) {
        true => (next.state.alpha, next.state.beta) = (alpha, beta),
        false => next.faults.insert(Faults::INCIDENCE),
    }
    match limits::specific_force(force) {
        true => next.specific_force = force,
        false => next.faults.insert(Faults::SPECIFIC_FORCE),
    }
}

/// Whether the vehicle's travels `found` equal the airframe's travels `wanted`. A rudder that only the vehicle has stays
/// centred and is not compared.
fn alike(found: &Travels, wanted: &Travels) -> bool {
    let close = |a: f64, b: f64| (a - b).abs() <= TRAVEL_TOLERANCE * b.abs();
    let same = |a: Travel, b: Travel| close(a.least, b.least) && close(a.most, b.most);
    same(found.aileron, wanted.aileron)
        && same(found.elevator, wanted.elevator)
        && wanted.rudder.is_none_or(|wanted| found.rudder.is_some_and(|found| same(found, wanted)))
}

/// The travels of the surfaces as text.
fn described(travels: &Travels) -> String {
    let one = |travel: Travel| match travel.is_symmetric() {
        true => format!("{:.4} rad", travel.most),
        false => format!("{:.4} to {:.4} rad", travel.least, travel.most),
    };
    let rudder = travels.rudder.map_or("no rudder".into(), |t| format!("{} (rudder)", one(t)));
    let Travels { aileron, elevator, .. } = *travels;
    format!("{} (aileron), {} (elevator), {rudder}", one(aileron), one(elevator))
}

fn fill_actuators(next: &mut Telemetry, outputs: [f64; 7], travels: &Travels) {
    let [aileron, elevator, throttle, aileron_rate, elevator_rate, rudder, rudder_rate] = outputs;
    let full = |travel: Travel| travel.largest();
    let (ailerons, elevators) = (full(travels.aileron), full(travels.elevator));
    let rudders = travels.rudder.map_or(0.0, full);
    match limits::actuators(outputs) && limits::travels(travels) {
        true => {
            next.actuators = ActuatorState {
                aileron: aileron * ailerons,
                aileron_rate: aileron_rate * ailerons,
                elevator: elevator * elevators,
                elevator_rate: elevator_rate * elevators,
                throttle,
                rudder: rudder * rudders,
                rudder_rate: rudder_rate * rudders,
            }
        }
        false => next.faults.insert(Faults::ACTUATORS),
    }
}
