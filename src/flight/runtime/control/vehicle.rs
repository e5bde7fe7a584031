//! Vehicle side of the control thread: it receives the states of the vehicle (flight controller or simulator) and answers with
//! commands.
//!
//! In real time only the newest state is answered; older queued states are only recorded. In lockstep every state is answered.

use std::time::{Duration, Instant};

use super::{CATCH_UP, CYCLE, Control, LOAD_WEIGHT};
use crate::pilot::{Decision, Plan};
use crate::recorder::call::Planned;
use crate::recorder::{Call, Row};
use crate::runtime::stamps::unix_us;
use crate::runtime::{Event, Pace};
use greylag_link::autopilot::{Autopilot, Severity};
use greylag_link::peer::PeerId;
use greylag_link::transport::Arrival;
use greylag_link::vehicle::{Notice, Order, Telemetry};
use greylag_physics::Time;

/// Largest number of states from one packet. A TCP chunk of 1024 bytes holds four. If there are more, the last place
/// holds the newest.
const STATES_PER_PACKET: usize = 8;

/// A state with the peer and the arrival time of the packet that completed it.
#[derive(Clone, Copy)]
struct Heard {
    state: Telemetry,
    peer: PeerId,
    arrived: Instant,
}

impl Control {
    /// Handles `arrival` and all queued arrivals. In real time only the newest state is answered. In lockstep every state is
    /// answered, because the vehicle waits for each reply. After a stall (a time in which this computer did not run the
    /// program) only states from the vehicle time `live` on are up to date.
    pub(super) fn take_vehicles(&mut self, arrival: Option<Arrival>, live: Option<Time>) {
        let mut newest = arrival.and_then(|arrival| self.take_vehicle(arrival, None));
        if self.clock.pace() == Pace::RealTime {
            // arrivals after this moment are handled in the next round of the loop
            for _ in 0..self.ports.from_vehicle.len() {
                let Ok(arrival) = self.ports.from_vehicle.try_recv() else { break };
                newest = self.take_vehicle(arrival, newest);
            }
            // the program may have been suspended since the last check
            if let Some(live) = live.or_else(|| self.excuse_stall()) {
                newest = self.catch_up(newest, live);
            }
        }
        if let Some(heard) = newest {
            self.tick(&heard);
        }
        self.take_notices();
    }

    /// Handles arrivals until a state from the time `live` or later arrives, for at most 50 ms. A socket buffer that became
    /// full in a stall holds old states, which come first.
    fn catch_up(&mut self, mut newest: Option<Heard>, live: Time) -> Option<Heard> {
        let until = Instant::now() + CATCH_UP;
        while newest.is_none_or(|heard| heard.state.time < live) {
            let Ok(arrival) = self.ports.from_vehicle.recv_deadline(until) else { break };
            newest = self.take_vehicle(arrival, newest);
        }
        newest
    }

    /// Handles one arrival. Returns the last state that the arrival completed, or `newest` if it completed none.
    fn take_vehicle(&mut self, arrival: Arrival, newest: Option<Heard>) -> Option<Heard> {
        let packet = match arrival {
            Arrival::Packet(mut packet) => {
                self.ports.sift(unix_us(), &mut packet);
                self.report_refusals();
                packet
            }
            Arrival::Remark(remark) => {
                self.remark(&remark);
                return newest;
            }
            Arrival::Opened(_) | Arrival::Closed(_) => return newest,
        };
        self.record(packet.arrived, &packet.bytes);
        // The states are collected first, because the reply to each tick also uses `vehicle`.
        let mut states: [Option<Telemetry>; STATES_PER_PACKET] = [None; STATES_PER_PACKET];
        let mut count = 0;
        self.vehicle.handle(
            packet.arrived.saturating_duration_since(self.started),
            packet.peer,
            &packet.bytes,
            |state| {
                if state.order != Order::Late {
                    states[count.min(STATES_PER_PACKET - 1)] = Some(state);
                    count += 1;
                }
            },
        );
        if let Some(router) = &self.router {
            for peer in self.clients.peers() {
                let frames = router.to_client(&packet.bytes, peer);
                if !frames.is_empty() {
                    self.ports.send_to_client(unix_us(), peer, frames);
                }
            }
        }
        let mut newest = newest;
        for state in states.into_iter().flatten() {
            let heard = Heard { state, peer: packet.peer, arrived: packet.arrived };
            match (newest.replace(heard), self.clock.pace()) {
                (Some(_), Pace::RealTime) => self.timing.overtaken += 1,
                (Some(before), Pace::Lockstep) => self.tick(&before),
                (None, _) => {}
            }
        }
        newest
    }

    fn tick(&mut self, heard: &Heard) {
        let Heard { state, peer, arrived } = heard;
        self.clock.set(*arrived, state.time);
        let request = self.pilot.observe(state.time, state);
        let plan = request.map_or(Plan::None, |request| self.planner.plan(&request, *arrived));
        let decision = self.pilot.decide(plan);
        let demand = decision.demand();
        self.outputs = demand.outputs;
        let host = arrived.saturating_duration_since(self.started);
        let frame = self.vehicle.answer(host, state.time, &demand);
        let copy = (self.recorder.is_some() && !frame.is_empty()).then(|| frame.clone());
        if !frame.is_empty() {
            self.ports.send_to_vehicle(unix_us(), *peer, frame);
        }
        let latency = arrived.elapsed();
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
        self.account(heard, &decision, plan, latency);
    }

    /// Records the timing and the log row of a tick, after its command is sent.
    fn account(&mut self, heard: &Heard, decision: &Decision, plan: Plan, latency: Duration) {
        let Heard { state, peer, arrived } = heard;
        if self.last_arrival.is_none() {
            self.say(Event::VehicleFound(*peer));
        }
        if let Some(last) = self.last_arrival.replace(*arrived) {
            self.timing.interval.note(arrived.saturating_duration_since(last));
        }
        self.timing.latency.note(latency);
        self.timing.missed += u64::from(match self.clock.pace() {
            Pace::RealTime => latency > CYCLE,
            Pace::Lockstep => state.order == Order::Repeated,
        });
        self.timing.late_plans += u64::from(matches!(plan, Plan::Late | Plan::Busy));
        let share = (latency.as_secs_f64() / CYCLE.as_secs_f64()).min(1.0);
        self.load += LOAD_WEIGHT * (share - self.load);
        // surface positions are unknown while the companion does not command them
        match self.vehicle.moves_surfaces() {
            true => self.pilot.monitor(state),
            false => self.pilot.forget_residuals(),
        }
        let shown = self.vehicle.flies_surfaces();
        if let Some(recorder) = self.recorder.as_ref().filter(|_| state.order != Order::Repeated) {
            let latency_us = latency.as_secs_f64() * 1e6;
            let mut row = Row::new(state, decision, latency_us);
            row.residuals = self.pilot.residual_shares();
            row.derivatives = self.pilot.derivatives();
            recorder.row(if shown { row } else { row.without_surfaces() });
        }
    }

    /// Handles the vehicle's notices, such as the start and the end of control authority.
    pub(super) fn take_notices(&mut self) {
        while let Some(notice) = self.vehicle.take_notice() {
            if let Some(words) = notice.ending() {
                let now = self.clock.at(Instant::now());
                self.note(Call::Disarm(now, true));
                // a forced disarming is never refused
                let _ = self.pilot.disarm(now, true);
                self.pilot.send_text(Severity::Critical, &words);
            }
            match notice {
                Notice::Text(severity, words) => self.pilot.send_text(severity, &words),
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

    /// Sends the frames that are due on the vehicle's link, if its peer is known.
    pub(super) fn send_due(&mut self, host: Duration) {
        let Some(peer) = self.vehicle.peer().or(self.ports.vehicle_target()) else {
            return;
        };
        if let Some(frame) = self.vehicle.due(host, self.outputs) {
            self.record(Instant::now(), &frame);
            self.ports.send_to_vehicle(unix_us(), peer, frame);
        }
    }
}
