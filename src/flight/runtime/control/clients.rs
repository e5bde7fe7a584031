//! The part of the control thread that serves the clients, for example ground stations. It processes their requests, sends them
//! telemetry and forwards their frames to the flight controller.

use std::time::{Duration, Instant};

use super::Control;
use crate::runtime::recording_autopilot::RecordingAutopilot;
use crate::runtime::stamps::unix_us;
use greylag_link::autopilot::Severity;
use greylag_link::transport::{Arrival, Packet};
use greylag_link::vehicle::Outputs;

impl Control {
    /// Forwards a client's frames to the flight controller, if there is one.
    fn route(&mut self, host: Duration, packet: &Packet) {
        let Some(router) = &mut self.router else { return };
        router.learn(host, packet.peer, &packet.bytes);
        let engaged = self.outputs != Outputs::Disarmed;
        let frames = router.to_controller(&packet.bytes, self.clients.identity(), engaged);
        if let Some(peer) = self.vehicle.peer().filter(|_| !frames.is_empty()) {
            self.ports.send_to_vehicle(unix_us(), peer, frames);
        }
    }

    pub(super) fn take_client(&mut self, arrival: Arrival) {
        let host = Instant::now();
        let now = self.now(host);
        match arrival {
            Arrival::Packet(mut packet) => {
                self.ports.sift(unix_us(), &mut packet);
                self.report_refusals();
                self.route(now.host, &packet);
                let mut pilot = RecordingAutopilot {
                    pilot: &mut self.pilot,
                    vehicle: &self.vehicle,
                    recorder: self.recorder.as_ref(),
                    hear: |event| drop(self.events.try_send(event)),
                };
                self.clients.handle(now, packet.peer, &packet.bytes, &mut pilot);
                self.record(packet.arrived, &packet.bytes);
            }
            Arrival::Opened(peer) => self.clients.welcome(now, peer),
            Arrival::Closed(peer) => {
                self.clients.forget(peer);
                self.router.iter_mut().for_each(|router| router.forget(peer));
            }
            Arrival::Remark(remark) => self.remark(&remark),
        }
        self.send_to_clients();
    }

    /// Reports, once in a flight, that frames were refused because their signature is missing or invalid.
    pub(super) fn report_refusals(&mut self) {
        let refused = self.ports.signing().map_or(0, |counts| counts.refused());
        if refused > 0 && !self.told_refusals {
            self.told_refusals = true;
            let words =
                "frames without a right signature are refused: sign them with the key of --sign";
            self.pilot.send_text(Severity::Warning, words);
        }
    }

    pub(super) fn welcome_targets(&mut self) {
        let now = self.now(self.started);
        let targets = self.ports.clients.iter().filter_map(|link| link.target());
        for peer in targets.collect::<Vec<_>>() {
            self.clients.welcome(now, peer);
        }
    }

    pub(super) fn send_to_clients(&mut self) {
        let unix_us = unix_us();
        for (peer, frame) in self.clients.drain() {
            if let Some(recorder) = &self.recorder {
                recorder.bytes(self.stamps.of(Instant::now()), &frame);
            }
            self.ports.send_to_client(unix_us, peer, frame);
        }
    }
}
