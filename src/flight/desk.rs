//! The companion (Greylag's autopilot) as a function of received bytes and time, without threads, sockets or a wall clock.
//!
//! It runs the same pilot, vehicle link and controller as [`runtime`](super::runtime). Fault campaigns use it to fly
//! thousands of flights in one process. Host time is the time of the companion's computer. Vehicle time is the time in the
//! vehicle's state frames.

use std::time::Duration;

use crate::pilot::{Decision, Pilot, Plan};
use crate::recorder::{Recorder, Row};
use crate::runtime::Companion;
use greylag_control::Controller;
use greylag_link::autopilot::{Autopilot, Severity, Text, Verdict};
use greylag_link::peer::{LinkId, PeerId, SERIAL};
use greylag_link::vehicle::{Notice, Order, Outputs, Telemetry, Vehicle};
use greylag_physics::Time;

/// The only peer of the vehicle link.
const WIRE: PeerId = PeerId { link: LinkId(0), address: SERIAL };

/// A companion whose input and time are arguments.
///
/// Call [`Desk::receive`] with received bytes, and [`Desk::poll`] every 10 ms. Both append the bytes to send to `out`.
/// The host time `host` must not decrease from call to call.
pub struct Desk {
    pilot: Pilot,
    controller: Box<dyn Controller>,
    vehicle: Vehicle,
    outputs: Outputs,
    /// Host time and vehicle time of the newest state.
    anchor: Option<(Duration, Time)>,
    recorder: Option<Recorder>,
    /// All texts sent to the ground stations.
    pub texts: Vec<Text>,
}

impl Desk {
    /// A companion for `vehicle`, before any byte is received. The controller runs synchronously, even if it has a
    /// separate thread in flight.
    pub fn new(companion: Companion, vehicle: Vehicle) -> Self {
        let mut pilot = companion.pilot;
        pilot.take_on(&vehicle);
        Desk {
            pilot,
            controller: companion.controller,
            vehicle,
            outputs: Outputs::Disarmed,
            anchor: None,
            recorder: None,
            texts: Vec::new(),
        }
    }

    /// Starts recording with `recorder`.
    pub fn record(&mut self, recorder: Recorder) {
        self.recorder = Some(recorder);
    }

    /// Processes `bytes` that arrive at the host time `host`, and appends the replies to `out`. Calls `watch` with each
    /// state that is not late and with the pilot's decision for it.
    pub fn receive(
        &mut self,
        host: Duration,
        bytes: &[u8],
        out: &mut Vec<u8>,
        mut watch: impl FnMut(&Telemetry, &Decision),
    ) {
        let mut states = Vec::new();
        self.vehicle.handle(host, WIRE, bytes, |state| states.push(state));
        if let Some(recorder) = &self.recorder {
            recorder.bytes(host.as_micros() as u64, bytes);
        }
        for state in states.iter().filter(|state| state.order != Order::Late) {
            self.anchor = Some((host, state.time));
            let request = self.pilot.observe(state.time, state);
            let plan = request
                .map_or(Plan::None, |request| Plan::Ready(request.ask(self.controller.as_mut())));
            let decision = self.pilot.decide(plan);
            let demand = decision.demand();
            self.outputs = demand.outputs;
            out.extend(self.vehicle.answer(host, state.time, &demand));
            match self.vehicle.moves_surfaces() {
                true => self.pilot.monitor(state),
                false => self.pilot.forget_residuals(),
            }
            let shown = self.vehicle.flies_surfaces();
            if let Some(recorder) = &self.recorder {
                let mut row = Row::new(state, &decision, 0.0);
                row.residuals = self.pilot.residual_shares();
                row.derivatives = self.pilot.derivatives();
                recorder.row(if shown { row } else { row.without_surfaces() });
            }
            watch(state, &decision);
        }
        self.heed(host);
    }

    /// Performs the periodic duties (timeouts, due messages, texts) at the host time `host`. Call it every 10 ms.
    pub fn poll(&mut self, host: Duration, out: &mut Vec<u8>) {
        let now = self.now(host);
        self.pilot.advance(now);
        if let Some(trouble) = self.recorder.as_ref().and_then(Recorder::trouble) {
            self.pilot.send_text(Severity::Warning, &trouble);
        }
        out.extend(self.vehicle.due(host, self.outputs).unwrap_or_default());
        self.heed(host);
        self.texts.extend(std::iter::from_fn(|| self.pilot.take_text()));
    }

    fn heed(&mut self, host: Duration) {
        while let Some(notice) = self.vehicle.take_notice() {
            if let Some(words) = notice.ending() {
                // a forced disarming is never refused
                let _ = self.pilot.disarm(self.now(host), true);
                self.pilot.send_text(Severity::Critical, &words);
            }
            match notice {
                Notice::Text(severity, words) => self.pilot.send_text(severity, &words),
                Notice::System(_) | Notice::Released(_) | Notice::HandedBack(_) => {}
                Notice::Engaged => self.pilot.engaged(self.now(host)),
            }
        }
    }

    /// Vehicle time at the host time `host`, extrapolated from the newest state; zero before the first state.
    pub fn now(&self, host: Duration) -> Time {
        self.anchor.map_or(Time::default(), |(at, time)| time.plus(host.saturating_sub(at)))
    }

    /// Arms the companion, as the request of a client (a ground station or an offboard program) does. If the vehicle cannot be
    /// engaged, rejects the request with the reason.
    pub fn arm(&mut self, host: Duration) -> Verdict {
        match self.vehicle.obstacle() {
            Some(obstacle) => Verdict::Rejected(obstacle),
            None => self.pilot.arm(self.now(host), false),
        }
    }

    /// The pilot, for the requests of a client.
    pub fn pilot(&mut self) -> &mut Pilot {
        &mut self.pilot
    }

    /// The link to the vehicle.
    pub fn vehicle(&self) -> &Vehicle {
        &self.vehicle
    }
}
