//! Messages that clients, such as ground stations, receive periodically: heartbeats and telemetry streams.

use std::time::Duration;

use super::{Clients, Now};
use crate::autopilot::Status;
use crate::wire::mode::{self, Pulse};
use crate::wire::telemetry::{self, Home, NAMED_VALUE_FLOAT, STREAMS, Scene};

/// Interval between two heartbeats.
const HEARTBEAT: Duration = Duration::from_secs(1);

impl Clients {
    /// Sets the home position to the first known position of the vehicle, and later to its position at each arming.
    pub(super) fn note_home(&mut self, status: &Status) {
        let armed_now = status.armed && !self.was_armed;
        let known = status.position.iter().chain([&status.altitude]).all(|x| x.is_finite());
        if known && (self.home.is_none() || armed_now) {
            self.home = Some(Home { position: status.position, altitude: status.altitude });
        }
        self.was_armed = status.armed;
    }

    /// Sends a heartbeat to all clients every second and whenever its content changes, and at once to a new client.
    pub(super) fn beat(&mut self, now: Now, status: &Status) {
        let pulse = Some(Pulse::of(status));
        let everybody = now.host >= self.next_heartbeat || self.pulse != pulse;
        if everybody {
            self.next_heartbeat = now.host + HEARTBEAT;
            self.pulse = pulse;
        }
        let message = mode::heartbeat(status, self.role);
        for session in &mut self.sessions {
            if everybody || !session.greeted {
                session.greeted = true;
                session.send(&message, self.identity, &mut self.outbox);
            }
        }
    }

    pub(super) fn stream(&mut self, now: Now, status: &Status) {
        let scene = self.scene(now);
        for session in &mut self.sessions {
            for (at, stream) in STREAMS.iter().enumerate() {
                if !session.streams.is_due(at, now.host) {
                    continue;
                }
                let mut send = |message| session.send(&message, self.identity, &mut self.outbox);
                match stream.id {
                    NAMED_VALUE_FLOAT => telemetry::named_values(status, &scene).for_each(send),
                    id => telemetry::message(id, status, &scene).into_iter().for_each(&mut send),
                }
            }
        }
    }

    pub(super) fn scene(&self, now: Now) -> Scene {
        Scene { now: now.vehicle, home: self.home, bad_frames: self.counts.frames.bad() }
    }
}
