//! ArduPilot's JSON interface: the shim as the simulator of stock ArduPlane SITL.
//!
//! ArduPilot sends a servo packet for every step to UDP port 9002 and waits for the state, one line of JSON. ArduPilot therefore
//! sets the pace: the simulation steps only on a new packet. Its option `--speedup` decides whether the run follows the wall
//! clock. The protocol is that of ArduPilot's public documentation (SITL, JSON interface).

mod events;
mod packet;
mod pwm;
mod state;

use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::error::ShimError;
use super::flight::Over;
use super::launch::Launcher;
use super::link::{Arrival, Link};
use super::options::ShimOptions;
use super::outputs::OutputMap;
use super::summary::{Event, Notice, Summary};
use super::truth_log::TruthLog;
use crate::plant::{Inputs, Truth};
pub use events::ArdupilotEvent;
use packet::ServoPacket;
pub use pwm::{ChannelRange, PwmRange, PwmRangeError};
pub use state::Home;

/// One step of JSBSim, µs.
const STEP_US: u64 = 1_000;
/// Largest number of JSBSim steps between two states that are sent. ArduPilot refuses to arm if its sensors update slower than
/// 1.8 times its own loop rate (SCHED_LOOP_RATE, up to 250 Hz on a plane), whatever step rate it requests.
const MOST_STEPS: u64 = 2;
/// Silence after which ArduPilot is reported as stopped and another ArduPilot may connect.
const SILENCE: Duration = Duration::from_secs(1);

/// Options of a run against ArduPilot only.
#[derive(Clone, Debug, PartialEq)]
pub struct ArdupilotOptions {
    /// Assignment of the channels to the aircraft's controls.
    pub outputs: OutputMap,
    /// Pulse widths of the channels that do not use 1000 to 2000 µs.
    pub ranges: Vec<ChannelRange>,
}

impl Default for ArdupilotOptions {
    /// Aileron, elevator, throttle, rudder on channels 1 to 4; 1000 to 2000 µs.
    fn default() -> Self {
        ArdupilotOptions { outputs: OutputMap::ardupilot(), ranges: Vec::new() }
    }
}

/// The connected ArduPilot.
struct Client {
    peer: SocketAddr,
    frame_count: u32,
    last_packet: Instant,
    silent: bool,
    /// Simulated time of this client since its first packet, µs.
    time_us: u64,
    /// The JSON line sent last.
    line: String,
}

/// State of one run against ArduPilot.
struct Run<'a> {
    link: Link,
    options: &'a ShimOptions,
    ardupilot: &'a ArdupilotOptions,
    observer: &'a mut dyn FnMut(Notice),
    launcher: Launcher,
    home: Home,
    log: Option<TruthLog>,
    client: Option<Client>,
    counts: Summary,
    /// Simulated time of all clients, µs.
    time_us: u64,
    flown_us: u64,
    garbage_reported: bool,
    second_reported: bool,
}

/// Simulates for the connected ArduPilot until a stop request or the end of the flight.
pub(super) fn fly(
    link: Link,
    options: &ShimOptions,
    ardupilot: &ArdupilotOptions,
    stop: &AtomicBool,
    observer: &mut dyn FnMut(Notice),
) -> Result<Summary, ShimError> {
    let mut plant = options.plant.clone();
    plant.step_s = STEP_US as f64 * 1e-6;
    let mut launcher = Launcher::new(&plant, &options.start, options.launch)?;
    let travel = launcher.travel()?;
    let log = options.truth.as_ref().map(|t| TruthLog::create(t, plant.step_s, &travel));
    let begun = Instant::now();
    let mut run = Run {
        link,
        options,
        ardupilot,
        observer,
        launcher,
        home: Home {
            latitude_deg: plant.latitude_deg,
            longitude_deg: plant.longitude_deg,
            altitude_m: options.start.altitude_m,
            heading_deg: options.start.yaw_rad.to_degrees().rem_euclid(360.0).round(),
        },
        log: log.transpose()?,
        client: None,
        counts: Summary::default(),
        time_us: 0,
        flown_us: 0,
        garbage_reported: false,
        second_reported: false,
    };
    let over = run.go(stop);
    run.log.as_mut().map_or(Ok(()), TruthLog::finish)?;
    let mut summary = run.counts;
    summary.over = over?;
    summary.simulated_s = run.time_us as f64 * 1e-6;
    summary.flown_s = run.flown_us as f64 * 1e-6;
    summary.wall_s = begun.elapsed().as_secs_f64();
    Ok(summary)
}

impl Run<'_> {
    fn go(&mut self, stop: &AtomicBool) -> Result<Option<Over>, ShimError> {
        self.notify(Event::Open(self.options.link.clone(), self.link.local()));
        for note in self.launcher.notes() {
            self.notify(Event::Note(note));
        }
        self.report(ArdupilotEvent::Waiting(self.options.link.clone(), self.home));
        while !stop.load(Ordering::Relaxed) {
            let Arrival::Datagram(bytes, from) = self.link.receive() else {
                self.watch();
                continue;
            };
            let (packet, length) = (ServoPacket::read(bytes), bytes.len());
            let Some(packet) = packet else {
                self.refuse(from, length);
                continue;
            };
            if let Some(over) = self.take(&packet, from)? {
                return Ok(Some(over));
            }
        }
        Ok(None)
    }

    fn notify(&mut self, event: Event) {
        (self.observer)(Notice { time_s: self.time_us as f64 * 1e-6, event });
    }

    fn report(&mut self, event: ArdupilotEvent) {
        self.notify(Event::Ardupilot(event));
    }

    /// Reports an ArduPilot that has sent nothing for [`SILENCE`].
    fn watch(&mut self) {
        let Some(client) = &mut self.client else { return };
        if !client.silent && client.last_packet.elapsed() >= SILENCE {
            client.silent = true;
            self.report(ArdupilotEvent::Stopped);
        }
    }

    /// Counts a datagram that is not a servo packet, and reports the first of them.
    fn refuse(&mut self, from: SocketAddr, length: usize) {
        self.counts.bad_frames += 1;
        if !std::mem::replace(&mut self.garbage_reported, true) {
            self.report(ArdupilotEvent::Garbage(from, length));
        }
        self.watch();
    }

    /// Answers a servo packet with the state after the requested step.
    fn take(&mut self, packet: &ServoPacket, from: SocketAddr) -> Result<Option<Over>, ShimError> {
        self.watch();
        match &self.client {
            Some(client) if client.peer != from && !client.silent => {
                self.turn_away(from);
                return Ok(None);
            }
            Some(client) if client.peer == from && client.frame_count == packet.frame_count => {
                self.repeat();
                return Ok(None);
            }
            Some(client) if client.peer == from && packet.frame_count > client.frame_count => {}
            Some(client) if client.peer == from => self.meet(packet, from, Meeting::Again)?,
            _ => self.meet(packet, from, Meeting::New)?,
        }
        self.resume();
        self.step(packet)
    }

    /// Counts packets of a second ArduPilot, and reports the first.
    fn turn_away(&mut self, from: SocketAddr) {
        self.counts.foreign_frames += 1;
        if !std::mem::replace(&mut self.second_reported, true) {
            self.report(ArdupilotEvent::Second(from));
        }
    }

    /// Sends the last state again: ArduPilot repeats its packet after a second without an answer.
    fn repeat(&mut self) {
        self.resume();
        self.counts.repeated_frames += 1;
        self.send();
    }

    fn send(&mut self) {
        let Some(client) = &self.client else { return };
        self.counts.unsent_frames += u64::from(!self.link.send(client.line.as_bytes()));
    }

    fn resume(&mut self) {
        let Some(client) = &mut self.client else { return };
        client.last_packet = Instant::now();
        if std::mem::replace(&mut client.silent, false) {
            self.report(ArdupilotEvent::Resumed);
        }
    }

    /// Begins a flight for an ArduPilot that has just started: the aircraft is at its start and the client's time is 0.
    fn meet(
        &mut self,
        packet: &ServoPacket,
        peer: SocketAddr,
        meeting: Meeting,
    ) -> Result<(), ShimError> {
        self.link.adopt(peer);
        self.launcher.begin_anew()?;
        self.client = Some(Client {
            peer,
            frame_count: packet.frame_count,
            last_packet: Instant::now(),
            silent: false,
            time_us: 0,
            line: String::new(),
        });
        if meeting == Meeting::Again {
            self.report(ArdupilotEvent::Restarted);
            return Ok(());
        }
        self.report(ArdupilotEvent::Connected {
            peer,
            channels: packet.channels,
            asked_hz: packet.frame_rate_hz,
            made_hz: 1_000_000 / (steps(packet.frame_rate_hz) * STEP_US),
        });
        let (wanted, channels) = (self.ardupilot.outputs.highest(), packet.channels);
        if wanted > channels {
            self.report(ArdupilotEvent::Missing { wanted, channels });
        }
        Ok(())
    }

    /// Makes the step that `packet` requests and sends the state after it.
    fn step(&mut self, packet: &ServoPacket) -> Result<Option<Over>, ShimError> {
        let inputs = self.inputs(packet);
        if self.launcher.let_go(true, inputs.throttle) {
            self.report(ArdupilotEvent::Catapult);
        }
        let mut truth = self.launcher.truth();
        for _ in 0..steps(packet.frame_rate_hz) {
            truth = self.advance(inputs)?;
        }
        self.show(packet, &truth);
        if truth.altitude_m <= 0.0 {
            return Ok(Some(Over::Ground));
        }
        let flown_s = self.flown_us as f64 * 1e-6;
        let last = self.options.duration_s.filter(|last| flown_s >= *last - 1e-9);
        Ok(last.map(|_| Over::Duration))
    }

    /// The commands of a packet. A channel that ArduPilot does not send counts as a channel without a pulse.
    fn inputs(&mut self, packet: &ServoPacket) -> Inputs {
        let ranges = &self.ardupilot.ranges;
        let command =
            |place, range| pwm::range_at(ranges, place).command(packet.pwm_us(place), range);
        let mixed = self.ardupilot.outputs.mix(command).unwrap_or_default();
        self.counts.answers += 1;
        self.counts.limited_answers += u64::from(mixed.limited);
        mixed.inputs
    }

    /// Makes one step of JSBSim.
    fn advance(&mut self, inputs: Inputs) -> Result<Truth, ShimError> {
        let was_flying = self.launcher.is_flying();
        if let (true, Some(log)) = (was_flying, &mut self.log) {
            log.row(self.time_us, &self.launcher.truth(), inputs)?;
        }
        let truth = self.launcher.advance(inputs)?;
        self.time_us += STEP_US;
        self.flown_us += if was_flying { STEP_US } else { 0 };
        if self.launcher.is_flying() && !was_flying {
            self.notify(Event::Launched);
        }
        Ok(truth)
    }

    /// Sends the state after a step, and keeps it for a repeated packet.
    fn show(&mut self, packet: &ServoPacket, truth: &Truth) {
        let Some(client) = &mut self.client else { return };
        client.frame_count = packet.frame_count;
        client.time_us += steps(packet.frame_rate_hz) * STEP_US;
        // The plant's state is finite, so it can always be serialised.
        client.line =
            state::line(client.time_us as f64 * 1e-6, truth, &self.home).unwrap_or_default();
        self.counts.frames += 1;
        self.send();
    }
}

/// How a packet of ArduPilot relates to the connected client.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Meeting {
    /// First packet of a client, or of another client than before.
    New,
    /// ArduPilot was started again on the same port.
    Again,
}

/// JSBSim steps between two states at the requested rate `asked_hz`, Hz: the nearest whole number from 1 to `MOST_STEPS`.
fn steps(asked_hz: u16) -> u64 {
    let nearest = (1e6 / (f64::from(asked_hz.max(1)) * STEP_US as f64)).round() as u64;
    nearest.clamp(1, MOST_STEPS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_follow_the_rate_asked_for_and_stay_finer_than_the_sensors_need() {
        // 1200 Hz is ArduPilot's default. It requests 501 Hz while it gets 500 Hz.
        for (asked_hz, made) in
            [(1200, 1), (1000, 1), (800, 1), (501, 2), (500, 2), (50, 2), (0, 2)]
        {
            assert_eq!(steps(asked_hz), made, "{asked_hz} Hz");
        }
    }
}
