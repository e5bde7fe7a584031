//! The PX4 simulator API: the shim as the simulator to which stock PX4 SITL connects.
//!
//! PX4 is the TCP client, port 4560. The shim sends HIL_SENSOR at 250 Hz and HIL_GPS at 10 Hz of simulated time, and
//! HIL_STATE_QUATERNION on request. PX4 answers with HIL_ACTUATOR_CONTROLS.
//!
//! Until the first answer, time advances freely, because PX4 has to boot. After an answer with the lockstep flag, each step waits
//! for the answer, for at most 3 s. The protocol is that of PX4's public documentation (Simulator MAVLink API), as its module
//! `simulator_mavlink` implements it.

mod actuation;
mod client;
mod clock;
mod events;
mod magnetism;
mod sensors;

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use super::codec::Frame;
use super::error::ShimError;
use super::flight::Over;
use super::launch::Launcher;
use super::link::{Arrival, Link};
use super::options::{Pace, ShimOptions};
use super::outputs::OutputMap;
use super::summary::{Event, Notice, Summary};
use super::truth_log::TruthLog;
use crate::plant::Inputs;
use client::Client;
pub use events::Px4Event;
pub use sensors::Px4Noise;
use sensors::Sensors;

/// One step, µs: 250 Hz.
pub const STEP_US: u64 = 4_000;
/// Simulated time of the first step, µs. It is not 0, because the clock's offset would then be ambiguous.
pub const FIRST_US: u64 = 1_000_000_000;
/// Number of steps between two HIL_GPS messages: 10 Hz.
const GPS_EVERY: u64 = 25;
const STEP: Duration = Duration::from_micros(STEP_US);
/// Silence of PX4 after which an event reports it.
const SILENCE: Duration = Duration::from_secs(1);
/// Delay beyond which the schedule restarts at the present time, without a burst of steps.
const HOPELESS: Duration = Duration::from_millis(100);
/// Time without an answer after which lockstep makes a step. After a mode change, PX4 may wait for a sensor before it sends
/// actuators; without the step, both sides would wait forever.
const NUDGE: Duration = Duration::from_secs(3);
/// Time for which the loop waits for an answer by yielding.
const SPIN: Duration = Duration::from_micros(300);
/// Interval between polls of the link after `SPIN`.
const LOOK: Duration = Duration::from_micros(100);
/// Interval between polls of the link without a client.
const IDLE: Duration = Duration::from_millis(5);

/// Options of a run against PX4 only.
#[derive(Clone, Debug, PartialEq)]
pub struct Px4Options {
    /// Assignment of the outputs to the aircraft's controls.
    pub outputs: OutputMap,
    /// Sensor noise; constant sensor errors are in [`ShimOptions::bias`].
    pub noise: Px4Noise,
}

impl Default for Px4Options {
    /// The outputs of the stock fixed-wing airframes and the noise of PX4's simulators.
    fn default() -> Self {
        Px4Options { outputs: OutputMap::px4(), noise: Px4Noise::STANDARD }
    }
}

/// State of one run against PX4.
struct Run<'a> {
    link: Link,
    options: &'a ShimOptions,
    outputs: &'a OutputMap,
    observer: &'a mut dyn FnMut(Notice),
    launcher: Launcher,
    sensors: Sensors,
    log: Option<TruthLog>,
    client: Option<Client>,
    /// Number of connections so far.
    connection: u64,
    counts: Summary,
    time_us: u64,
    flown: u64,
    sent: Instant,
}

/// Simulates for each client that connects, until a stop request or the end of the flight.
pub(super) fn fly(
    link: Link,
    options: &ShimOptions,
    px4: &Px4Options,
    stop: &AtomicBool,
    observer: &mut dyn FnMut(Notice),
) -> Result<Summary, ShimError> {
    let mut plant = options.plant.clone();
    plant.step_s = STEP_US as f64 * 1e-6;
    let mut launcher = Launcher::new(&plant, &options.start, options.launch)?;
    let travel = launcher.travel()?;
    let field = magnetism::field_ned_gauss(
        plant.latitude_deg,
        plant.longitude_deg,
        options.start.altitude_m,
    )?;
    let begun = Instant::now();
    let mut run = Run {
        link,
        options,
        outputs: &px4.outputs,
        observer,
        launcher,
        sensors: Sensors::new(px4.noise, options.bias, field, options.seed),
        log: options
            .truth
            .as_ref()
            .map(|t| TruthLog::create(t, STEP_US as f64 * 1e-6, &travel))
            .transpose()?,
        client: None,
        connection: 0,
        counts: Summary::default(),
        time_us: FIRST_US,
        flown: 0,
        sent: begun,
    };
    let over = run.go(stop);
    run.log.as_mut().map_or(Ok(()), TruthLog::finish)?;
    let mut summary = run.counts;
    summary.over = over?;
    summary.simulated_s = (run.time_us - FIRST_US) as f64 * 1e-6;
    summary.flown_s = run.flown as f64 * plant.step_s;
    summary.wall_s = begun.elapsed().as_secs_f64();
    Ok(summary)
}

impl Run<'_> {
    fn go(&mut self, stop: &AtomicBool) -> Result<Option<Over>, ShimError> {
        self.notify(Event::Open(self.options.link.clone(), self.link.local()));
        self.wait();
        let mut deadline = Instant::now();
        while !stop.load(Ordering::Relaxed) {
            if self.client.is_none() {
                self.listen()?;
                thread::sleep(IDLE);
                deadline = Instant::now();
                continue;
            }
            self.show();
            deadline = self.next(deadline);
            if self.converse(deadline, stop)?
                && let Some(over) = self.advance()?
            {
                return Ok(Some(over));
            }
        }
        Ok(None)
    }

    fn notify(&mut self, event: Event) {
        (self.observer)(Notice { time_s: (self.time_us - FIRST_US) as f64 * 1e-6, event });
    }

    fn wait(&mut self) {
        self.notify(Event::Px4(Px4Event::Waiting(self.options.link.clone())));
    }

    /// Sends the sensors of this step. HIL_SENSOR comes last, because it advances PX4's clock.
    fn show(&mut self) {
        let truth = self.launcher.truth();
        let (time_us, step) = (self.time_us, (self.time_us - FIRST_US) / STEP_US);
        let Some(client) = &mut self.client else { return };
        let mut bytes = Vec::with_capacity(256);
        // PX4 has no time for its time stamps before the first HIL_SENSOR.
        if time_us > client.begun_us {
            if step.is_multiple_of(GPS_EVERY) {
                let gps = self.sensors.gps(time_us, &truth);
                client.encoder.encode(&gps, &mut bytes);
            }
            if client.wants_state(time_us) {
                client.encoder.encode(&sensors::state(time_us, &truth), &mut bytes);
            }
        }
        let inertial = self.sensors.inertial(time_us, step, &truth);
        client.encoder.encode(&inertial, &mut bytes);
        client.answered = false;
        self.counts.frames += 1;
        self.sent = Instant::now();
        self.counts.unsent_frames += u64::from(!self.link.send(&bytes));
    }

    /// Time at which the next step is due.
    fn next(&mut self, deadline: Instant) -> Instant {
        let now = Instant::now();
        let late = now.saturating_duration_since(deadline);
        let lockstep = self.client.as_ref().is_some_and(|client| client.lockstep);
        if late > HOPELESS || (lockstep && late > STEP) {
            if !lockstep {
                self.notify(Event::Skipped(late));
            }
            return now + STEP;
        }
        deadline + STEP
    }

    /// Exchanges messages until the next step is due; `false` if the client has disconnected or the run is stopped.
    fn converse(&mut self, deadline: Instant, stop: &AtomicBool) -> Result<bool, ShimError> {
        let connection = self.connection;
        while !stop.load(Ordering::Relaxed) {
            self.listen()?;
            let now = Instant::now();
            let Some(client) = &self.client else { return Ok(false) };
            if self.connection != connection {
                return Ok(false);
            }
            let hurried = client.lockstep && self.options.pace == Pace::Lockstep;
            let answered = client.answered || !client.lockstep;
            if answered && (hurried || now >= deadline) {
                return Ok(true);
            }
            self.watch(now);
            if !answered && now.saturating_duration_since(self.sent) >= NUDGE {
                return Ok(true);
            }
            if answered {
                thread::sleep(LOOK.min(deadline.saturating_duration_since(now)));
            } else if now.saturating_duration_since(self.sent) < SPIN {
                thread::yield_now();
            } else {
                thread::sleep(LOOK);
            }
        }
        Ok(false)
    }

    /// Reports a client that has become silent, and allows another client to replace it.
    fn watch(&mut self, now: Instant) {
        let Some(client) = &mut self.client else { return };
        let Some(last) = client.last_actuation.filter(|_| !client.silent) else { return };
        let since = if client.lockstep { last.max(self.sent) } else { last };
        if now.saturating_duration_since(since) < SILENCE {
            return;
        }
        client.silent = true;
        let event = if client.lockstep { Px4Event::Stopped } else { Px4Event::Silent };
        self.link.abandon();
        self.notify(Event::Px4(event));
    }

    /// Receives and handles everything that has arrived.
    fn listen(&mut self) -> Result<(), ShimError> {
        let mut frames: Vec<Frame> = Vec::new();
        loop {
            match self.link.receive() {
                Arrival::Nothing => return Ok(()),
                Arrival::Bytes(bytes) => {
                    if let Some(client) = &mut self.client {
                        let bad = client.parser.bad();
                        client.parser.stream(bytes, &mut |frame| frames.push(frame));
                        self.counts.bad_frames += client.parser.bad() - bad;
                    }
                    self.take(&frames);
                    frames.clear();
                }
                Arrival::Connected(peer) => {
                    self.connection += 1;
                    self.launcher.begin_anew()?;
                    self.client = Some(Client::new(self.time_us));
                    self.notify(Event::Px4(Px4Event::Connected(peer)));
                    return Ok(());
                }
                Arrival::Closed => {
                    self.client = None;
                    self.launcher.begin_anew()?;
                    self.notify(Event::Px4(Px4Event::Gone));
                    self.wait();
                    return Ok(());
                }
                Arrival::Datagram(..) => {}
            }
        }
    }

    fn take(&mut self, frames: &[Frame]) {
        let (mut reply, mut events) = (Vec::new(), Vec::new());
        let Some(client) = &mut self.client else { return };
        let answered = client.answered;
        for frame in frames {
            let (shown, counts) = (self.time_us, &mut self.counts);
            client.take(frame, shown, self.outputs, counts, &mut reply, &mut events);
        }
        if client.answered && !answered {
            self.counts.latency.record(self.sent.elapsed());
        }
        if !reply.is_empty() {
            self.link.send(&reply);
        }
        events.into_iter().for_each(|event| self.notify(Event::Px4(event)));
    }

    /// Makes one step with the last commands.
    fn advance(&mut self) -> Result<Option<Over>, ShimError> {
        let actuation = self.client.as_ref().and_then(|client| client.actuation);
        let (armed, inputs) = actuation.map_or((false, Inputs::default()), |a| (a.armed, a.inputs));
        if self.launcher.let_go(armed, inputs.throttle) {
            self.notify(Event::Px4(Px4Event::Catapult));
        }
        let was_flying = self.launcher.is_flying();
        if let (true, Some(log)) = (was_flying, &mut self.log) {
            log.row(self.time_us - FIRST_US, &self.launcher.truth(), inputs)?;
        }
        let truth = self.launcher.advance(inputs)?;
        self.time_us += STEP_US;
        self.flown += u64::from(was_flying);
        if self.launcher.is_flying() && !was_flying {
            self.notify(Event::Launched);
        }
        if truth.altitude_m <= 0.0 {
            return Ok(Some(Over::Ground));
        }
        let flown_s = self.flown as f64 * STEP_US as f64 * 1e-6;
        let last = self.options.duration_s.filter(|last| flown_s >= *last - 1e-9);
        Ok(last.map(|_| Over::Duration))
    }
}
