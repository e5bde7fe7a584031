//! The control thread: one loop that answers state frames, then serves clients.

mod clients;

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use crossbeam_channel::{Sender, select_biased};

use super::clock::{Clock, Pace};
use super::planner::Planner;
use super::ports::Ports;
use super::recording_autopilot::RecordingAutopilot;
use super::stamps::{Stamps, unix_us};
use super::summary::Summary;
use super::timing::Timing;
use super::{Event, FlightOptions};
use crate::pilot::{Decision, Pilot, Plan};
use crate::recorder::call::Planned;
use crate::recorder::{Call, Recorder, Row};
use greylag_link::autopilot::{Autopilot, Severity};
use greylag_link::client::{Clients, Now};
use greylag_link::framing::Source;
use greylag_link::routing::Router;
use greylag_link::transport::{Arrival, Packet, Remark};
use greylag_link::vehicle::{Notice, Order, Outputs, Real, Sitl, Telemetry, Vehicle};

/// Between two looks at what is due: heartbeats, streams, lost links.
const POLL: Duration = Duration::from_millis(10);
/// A cycle of the control loop.
const CYCLE: Duration = Duration::from_millis(10);
/// Silence at the start after which it is said that there is no vehicle.
const NO_VEHICLE: Duration = Duration::from_secs(2);
/// Weight of the newest tick in the load that the status shows.
const LOAD_WEIGHT: f64 = 0.02;
/// The autopilot identity.
const AUTOPILOT: Source = Source { system: 1, component: 1 };

/// All that the control thread owns.
pub(super) struct Control {
    pilot: Pilot,
    planner: Planner,
    vehicle: Vehicle,
    clients: Clients,
    /// Between clients and a real controller.
    router: Option<Router>,
    ports: Ports,
    recorder: Option<Recorder>,
    stamps: Stamps,
    events: Sender<Event>,
    clock: Clock,
    timing: Timing,
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
            Some(profile) => Vehicle::Real(Box::new(Real::new(profile))),
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
        let mut next_poll = self.started;
        while !stop.load(Ordering::Relaxed) && !self.is_over() {
            self.take_one(next_poll);
            let host = Instant::now();
            if host >= next_poll {
                self.poll(host);
                rounds.fetch_add(1, Ordering::Relaxed);
                // After a stall the beats that were missed stay missed.
                next_poll = (next_poll + POLL).max(host);
            }
        }
        self.finish()
    }

    fn is_over(&self) -> bool {
        self.duration.is_some_and(|duration| self.started.elapsed() >= duration)
    }

    /// Takes one arrival, the vehicle's before a client's, or waits until `until`.
    fn take_one(&mut self, until: Instant) {
        let wait = until.saturating_duration_since(Instant::now());
        select_biased! {
            recv(self.ports.from_vehicle) -> arrival => if let Ok(arrival) = arrival { self.take_vehicle(arrival) },
            recv(self.ports.from_clients) -> arrival => if let Ok(arrival) = arrival { self.take_client(arrival) },
            default(wait) => {}
        }
    }

    fn take_vehicle(&mut self, arrival: Arrival) {
        let packet = match arrival {
            Arrival::Packet(mut packet) => {
                self.ports.sift(unix_us(), &mut packet);
                packet
            }
            Arrival::Remark(remark) => return self.remark(&remark),
            Arrival::Opened(_) | Arrival::Closed(_) => return,
        };
        self.record(packet.arrived, &packet.bytes);
        // The vehicle is taken out for the time of the call, since each tick answers through it.
        let mut states: [Option<Telemetry>; STATES_PER_PACKET] = [None; STATES_PER_PACKET];
        let mut places = states.iter_mut();
        self.vehicle.handle(
            packet.arrived.saturating_duration_since(self.started),
            packet.peer,
            &packet.bytes,
            |state| {
                if let Some(place) = places.next() {
                    *place = Some(state);
                }
            },
        );
        for state in states.iter().flatten() {
            self.tick(state, &packet);
        }
        self.heed_vehicle();
        if let Some(router) = &self.router {
            for peer in self.clients.peers() {
                let frames = router.to_client(&packet.bytes, peer);
                if !frames.is_empty() {
                    self.ports.send_to_client(unix_us(), peer, frames);
                }
            }
        }
    }

    fn tick(&mut self, state: &Telemetry, packet: &Packet) {
        if state.order == Order::Late {
            return;
        }
        self.clock.set(packet.arrived, state.time);
        let request = self.pilot.observe(state.time, state);
        let plan =
            request.map_or(Plan::None, |request| self.planner.plan(&request, packet.arrived));
        let decision = self.pilot.decide(plan);
        let demand = decision.demand();
        self.outputs = demand.outputs;
        let host = packet.arrived.saturating_duration_since(self.started);
        let frame = self.vehicle.answer(host, state.time, &demand);
        let copy = (self.recorder.is_some() && !frame.is_empty()).then(|| frame.clone());
        if !frame.is_empty() {
            self.ports.send_to_vehicle(unix_us(), packet.peer, frame);
        }
        let latency = packet.arrived.elapsed();
        if let Some(frame) = copy {
            self.record(Instant::now(), &frame);
        }
        let planned = match plan {
            Plan::Ready(command) => Planned::Ready(command),
            Plan::Late => Planned::Late,
            Plan::Busy => Planned::Busy,
            Plan::None => Planned::None,
        };
        self.note(Call::Tick(state.time, planned, decision.command));
        self.account(state, &decision, plan, packet, latency);
    }

    /// Notes timing and the row of a tick, after its command is out.
    fn account(
        &mut self,
        state: &Telemetry,
        decision: &Decision,
        plan: Plan,
        packet: &Packet,
        latency: Duration,
    ) {
        if self.last_arrival.is_none() {
            self.say(Event::VehicleFound(packet.peer));
        }
        if let Some(last) = self.last_arrival.replace(packet.arrived) {
            self.timing.interval.note(packet.arrived.saturating_duration_since(last));
        }
        self.timing.latency.note(latency);
        self.timing.missed += u64::from(match self.clock.pace() {
            Pace::RealTime => latency > CYCLE,
            Pace::Lockstep => state.order == Order::Repeated,
        });
        self.timing.late_plans += u64::from(matches!(plan, Plan::Late | Plan::Busy));
        let share = (latency.as_secs_f64() / CYCLE.as_secs_f64()).min(1.0);
        self.load += LOAD_WEIGHT * (share - self.load);
        // What surfaces do that were not commanded by us is not known.
        match self.vehicle.moves_surfaces() {
            true => self.pilot.monitor(state),
            false => self.pilot.forget_residuals(),
        }
        let shown = self.vehicle.flies_surfaces();
        if let Some(recorder) = self.recorder.as_ref().filter(|_| state.order != Order::Repeated) {
            let latency_us = latency.as_secs_f64() * 1e6;
            let mut row = Row::new(state, decision, latency_us);
            row.residuals = self.pilot.residual_shares();
            recorder.row(if shown { row } else { row.without_surfaces() });
        }
    }

    /// Does what the vehicle has to tell.
    fn heed_vehicle(&mut self) {
        while let Some(notice) = self.vehicle.take_notice() {
            if let Some(words) = notice.ending() {
                let now = self.clock.at(Instant::now());
                self.note(Call::Disarm(now, true));
                // Its verdict cannot be a refusal: it is forced.
                let _ = self.pilot.disarm(now, true);
                self.pilot.tell(Severity::Critical, &words);
            }
            match notice {
                Notice::Text(severity, words) => self.pilot.tell(severity, &words),
                Notice::System(system) => self.clients.adopt(system),
                Notice::Engaged => {
                    let now = self.clock.at(Instant::now());
                    self.note(Call::Engaged(now));
                    self.pilot.engaged(now);
                }
                Notice::Released(_) | Notice::HandedBack(_) => {}
            }
        }
    }

    /// Says something about a link to the ground stations, and to whoever shows events.
    fn remark(&mut self, remark: &Remark) {
        self.pilot.tell(Severity::Warning, &remark.to_string());
    }

    /// Does what is due at `host`.
    fn poll(&mut self, host: Instant) {
        self.clock.listen(host);
        let now = self.now(host);
        self.note(Call::Advance(now.vehicle));
        self.pilot.advance(now.vehicle);
        self.pilot.note_load(self.load);
        if let Some(trouble) = self.recorder.as_ref().and_then(Recorder::trouble) {
            self.pilot.tell(Severity::Warning, &trouble);
        }
        self.heed_vehicle();
        let mut pilot = RecordingAutopilot {
            pilot: &mut self.pilot,
            vehicle: &self.vehicle,
            recorder: self.recorder.as_ref(),
            hear: |event| drop(self.events.try_send(event)),
        };
        self.clients.poll(now, &mut pilot);
        self.send_to_clients();
        self.greet_vehicle(now.host);
        if self.last_arrival.is_none() && now.host > NO_VEHICLE && !self.told_no_vehicle {
            self.told_no_vehicle = true;
            self.say(Event::NoVehicle);
        }
    }

    /// Sends what is due on the vehicle's link, when there is somebody to hear it.
    fn greet_vehicle(&mut self, host: Duration) {
        let Some(peer) = self.vehicle.peer().or(self.ports.vehicle_target()) else {
            return;
        };
        if let Some(frame) = self.vehicle.due(host, self.outputs) {
            self.record(Instant::now(), &frame);
            self.ports.send_to_vehicle(unix_us(), peer, frame);
        }
    }

    /// Records a packet that arrived, or left, at `host`.
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
        // Nobody may be listening; control does not wait to be heard.
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
            recording,
        };
        summary.save();
        summary
    }
}

/// States in one packet at most: a TCP chunk of 1024 bytes holds four.
const STATES_PER_PACKET: usize = 8;
