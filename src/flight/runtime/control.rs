//! The control thread: a loop that answers each state frame, a message with the vehicle's state, and then serves clients (ground
//! stations and offboard programs).

mod clients;
mod vehicle;

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use crossbeam_channel::{Sender, select_biased};

use super::clock::Clock;
use super::lateness::{Attention, Behind, Cause, Reports, Waited, lateness};
use super::planner::Planner;
use super::ports::Ports;
use super::recording_autopilot::RecordingAutopilot;
use super::stamps::Stamps;
use super::summary::Summary;
use super::timing::Timing;
use super::{Event, FlightOptions};
use crate::pilot::Pilot;
use crate::recorder::{Call, Recorder};
use greylag_link::autopilot::Severity;
use greylag_link::client::{Clients, Now};
use greylag_link::framing::Source;
use greylag_link::routing::Router;
use greylag_link::transport::{Arrival, Remark};
use greylag_link::vehicle::{Outputs, Real, Sitl, Vehicle};
use greylag_physics::Time;

/// Interval of periodic duties: heartbeats, streams, timeouts.
const POLL: Duration = Duration::from_millis(10);
/// Period of the control loop.
const CYCLE: Duration = Duration::from_millis(10);
/// If no state has arrived by this time after the start, the vehicle is reported as missing.
const NO_VEHICLE: Duration = Duration::from_secs(2);
/// Weight of the newest tick in the load that is reported to clients, an exponential mean over the ticks.
const LOAD_WEIGHT: f64 = 0.02;
/// MAVLink system and component ids of the autopilot in messages to clients.
const AUTOPILOT: Source = Source { system: 1, component: 1 };

/// After a stall, a state of at most this age counts as live. Older states are left over from the stall. It is also the
/// longest wait for a live state.
const CATCH_UP: Duration = Duration::from_millis(50);
/// Longest wait for the network thread to deliver queued packets after a stall.
const HAND_OVER: Duration = Duration::from_secs(2);
/// Interval between two readings of the operating system's scheduler counters, which show the cause of a stall.
const WAITED: Duration = Duration::from_secs(1);

/// A received packet with its origin.
enum Arrived {
    Vehicle(Arrival),
    Client(Arrival),
}

/// State owned by the control thread.
pub(super) struct Control {
    pilot: Pilot,
    planner: Planner,
    vehicle: Vehicle,
    clients: Clients,
    /// Router between clients and a real flight controller; `None` for the simulator.
    router: Option<Router>,
    ports: Ports,
    recorder: Option<Recorder>,
    stamps: Stamps,
    events: Sender<Event>,
    clock: Clock,
    timing: Timing,
    attention: Attention,
    /// The scheduler's counters at the last reading, and the time of the next reading.
    waited: Waited,
    next_waited: Instant,
    reports: Reports,
    started: Instant,
    duration: Option<Duration>,
    last_arrival: Option<Instant>,
    outputs: Outputs,
    load: f64,
    told_no_vehicle: bool,
    told_refusals: bool,
}

impl Control {
    pub(super) fn new(
        options: &FlightOptions,
        mut pilot: Pilot,
        planner: Planner,
        ports: Ports,
        recorder: Option<Recorder>,
        events: Sender<Event>,
    ) -> Self {
        let vehicle = match options.controller {
            None => Vehicle::Sitl(
                Sitl::new(AUTOPILOT.system, options.travels).with_mixer(options.mixer.clone()),
            ),
            Some(profile) => {
                let mut real = Real::new(profile);
                real.bear(options.delay_margin);
                Vehicle::Real(Box::new(real))
            }
        };
        pilot.take_on(&vehicle);
        let started = Instant::now();
        Control {
            pilot,
            planner,
            vehicle,
            clients: match options.controller {
                None => Clients::new(AUTOPILOT),
                Some(_) => Clients::onboard(),
            },
            router: options.controller.map(|_| Router::default()),
            ports,
            recorder,
            stamps: Stamps::since(started),
            events,
            clock: Clock::new(options.pace),
            timing: Timing::default(),
            attention: Attention::new(started),
            waited: Waited::default(),
            next_waited: started,
            reports: Reports::default(),
            started,
            duration: options.duration,
            last_arrival: None,
            outputs: Outputs::Disarmed,
            load: 0.0,
            told_no_vehicle: false,
            told_refusals: false,
        }
    }

    pub(super) fn run(mut self, stop: &AtomicBool, rounds: &AtomicU64) -> Summary {
        self.welcome_targets();
        self.attention.resume(Instant::now(), self.ports.rounds());
        let mut next_poll = self.started;
        while !stop.load(Ordering::Relaxed) && !self.is_over() {
            self.take_one(next_poll);
            let host = Instant::now();
            if host >= next_poll {
                self.poll(host);
                rounds.fetch_add(1, Ordering::Relaxed);
                // after a stall, missed periods are skipped
                next_poll = (next_poll + POLL).max(host);
            }
        }
        self.finish()
    }

    fn is_over(&self) -> bool {
        self.duration.is_some_and(|duration| self.started.elapsed() >= duration)
    }

    /// Handles one packet, or waits for a packet until `until`. Packets of the vehicle come before packets of clients.
    fn take_one(&mut self, until: Instant) {
        let wait = until.saturating_duration_since(Instant::now());
        let arrived = select_biased! {
            recv(self.ports.from_vehicle) -> arrival => arrival.ok().map(Arrived::Vehicle),
            recv(self.ports.from_clients) -> arrival => arrival.ok().map(Arrived::Client),
            default(wait) => None,
        };
        let resumed = self.excuse_stall();
        match arrived {
            Some(Arrived::Vehicle(arrival)) => self.take_vehicles(Some(arrival), resumed),
            Some(Arrived::Client(arrival)) => {
                // The states are handled first, because setpoints are stamped with vehicle time, which did not advance in
                // the stall.
                if resumed.is_some() {
                    self.take_vehicles(None, resumed);
                }
                self.take_client(arrival);
            }
            None if resumed.is_some() => self.take_vehicles(None, resumed),
            None => {}
        }
    }

    /// Detects a stall of this program or its network thread, waits until the packets that arrived in it are delivered, and
    /// excludes its duration from all timeouts. Returns the vehicle time from which on states count as live; `None` without a
    /// stall.
    fn excuse_stall(&mut self) -> Option<Time> {
        let host = Instant::now();
        let (behind, since) = self.attention.look(host, self.ports.rounds())?;
        let before = self.clock.at(since);
        // The network thread runs in rounds. Its present round may have begun before the end of the stall. Only the next one is
        // sure to poll every socket.
        let handed_over = self.ports.rounds() + 2;
        while self.ports.rounds() < handed_over && host.elapsed() < HAND_OVER {
            std::thread::sleep(CYCLE / 5);
        }
        let now = Instant::now();
        self.attention.resume(now, self.ports.rounds());
        let missed = lateness(since, now);
        self.note(Call::Excuse(missed));
        self.pilot.excuse(missed);
        self.vehicle.excuse(missed);
        self.clock.listen(now);
        self.timing.stalls += 1;
        self.timing.longest_stall = self.timing.longest_stall.max(missed);
        let waited = Waited::now();
        let cause = match behind {
            Behind::Control => self.waited.cause(waited, missed),
            Behind::Network => Cause::Busy,
        };
        self.waited = waited;
        if let Some(words) = self.reports.note(now, missed, cause) {
            self.pilot.send_text(Severity::Warning, &words);
        }
        Some(before.plus(missed.saturating_sub(CATCH_UP)))
    }

    /// Sends a remark of the transport about a link to the clients, as a warning.
    fn remark(&mut self, remark: &Remark) {
        self.pilot.send_text(Severity::Warning, &remark.to_string());
    }

    /// Performs the periodic duties. `host` is the present time of this computer.
    fn poll(&mut self, host: Instant) {
        self.clock.listen(host);
        let now = self.now(host);
        self.note(Call::Advance(now.vehicle));
        self.pilot.advance(now.vehicle);
        self.pilot.note_load(self.load);
        if host >= self.next_waited {
            (self.waited, self.next_waited) = (Waited::now(), host + WAITED);
        }
        if let Some(words) = self.reports.due(host) {
            self.pilot.send_text(Severity::Warning, &words);
        }
        if let Some(trouble) = self.recorder.as_ref().and_then(Recorder::trouble) {
            self.pilot.send_text(Severity::Warning, &trouble);
        }
        if let Some(trouble) = self.ports.trouble() {
            self.pilot.send_text(Severity::Warning, &trouble);
        }
        self.take_notices();
        let mut pilot = RecordingAutopilot {
            pilot: &mut self.pilot,
            vehicle: &self.vehicle,
            recorder: self.recorder.as_ref(),
            hear: |event| drop(self.events.try_send(event)),
        };
        self.clients.poll(now, &mut pilot);
        self.send_to_clients();
        self.send_due(now.host);
        if self.last_arrival.is_none() && now.host > NO_VEHICLE && !self.told_no_vehicle {
            self.told_no_vehicle = true;
            self.say(Event::NoVehicle);
        }
    }

    /// Records a packet that was received or sent at the time `host` of this computer.
    fn record(&mut self, host: Instant, bytes: &[u8]) {
        if let Some(recorder) = &self.recorder {
            recorder.bytes(self.stamps.of(host), bytes);
        }
    }

    fn note(&self, call: Call) {
        if let Some(recorder) = &self.recorder {
            recorder.call(call);
        }
    }

    fn say(&self, event: Event) {
        // the control thread does not wait for a reader of the events
        let _ = self.events.try_send(event);
    }

    fn now(&self, host: Instant) -> Now {
        Now { host: host.saturating_duration_since(self.started), vehicle: self.clock.at(host) }
    }

    fn finish(self) -> Summary {
        let recording =
            self.recorder.map(|recorder| (recorder.folder().to_owned(), recorder.finish()));
        let summary = Summary {
            duration_s: self.started.elapsed().as_secs_f64(),
            vehicle: self.vehicle.counts(),
            clients: self.clients.counts(),
            signing: self.ports.signing(),
            timing: self.timing,
            derivatives: self.pilot.derivatives(),
            recording,
        };
        summary.save();
        summary
    }
}
