//! The client of the demonstration. It sends MAVLink commands over a UDP socket to the companion, the program that flies the
//! aircraft. It arms, enters offboard mode and commands the attitudes of a schedule.

use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};

use super::schedule::{Leg, Legs};
use crate::link::autopilot::Mode;
use crate::link::offboard::{ARM, Heard, OffboardClient, SET_MODE};

/// Time within which the companion must fulfil a request.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(10);
/// Interval between setpoints (50 Hz).
const SETPOINT_PERIOD: Duration = Duration::from_millis(20);

/// State of the flight as received by the client.
#[derive(Clone, Copy, Debug, Default)]
pub struct View {
    /// The autopilot's time since boot, s.
    pub time_s: f64,
    /// Roll angle, rad.
    pub roll: f64,
    /// Pitch angle, rad.
    pub pitch: f64,
    /// Airspeed of VFR_HUD, m/s.
    pub airspeed: f64,
    /// Altitude of VFR_HUD, m.
    pub altitude: f64,
    pub(super) armed: bool,
    pub(super) mode: Option<Mode>,
    pub(super) accepted: Option<u32>,
}

/// A client connected to one companion.
pub struct Client {
    socket: UdpSocket,
    protocol: OffboardClient,
    view: View,
    texts: Vec<(f64, String)>,
    started: Instant,
    setpoint_due: Instant,
    heartbeat_due: Instant,
    target: (f64, f64),
}

impl Client {
    /// Opens a UDP socket to the companion's address for clients.
    pub fn connect(companion: SocketAddr) -> Result<Client> {
        let open = || -> std::io::Result<UdpSocket> {
            let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?;
            socket.connect(companion)?;
            socket.set_read_timeout(Some(Duration::from_millis(5)))?;
            Ok(socket)
        };
        let now = Instant::now();
        Ok(Client {
            socket: open().context("opening the client's socket")?,
            protocol: OffboardClient::default(),
            view: View::default(),
            texts: Vec::new(),
            started: now,
            setpoint_due: now,
            heartbeat_due: now,
            target: (0.0, 0.0),
        })
    }

    /// Arms, enters offboard mode, commands the attitude of each leg, and enters hold mode. `watch` receives the index of
    /// the leg, the time since its start (s) and the view. If `ended` becomes true, the rest of the schedule is skipped.
    /// Returns the companion's texts with their times, s.
    pub fn fly(
        &mut self,
        legs: &Legs,
        ended: &AtomicBool,
        mut watch: impl FnMut(usize, f64, &View),
    ) -> Result<Vec<(f64, String)>> {
        legs.legs.first().into_iter().for_each(|leg| self.aim(leg));
        self.until(
            "a heartbeat and an attitude",
            |v| v.mode.is_some() && v.time_s > 0.0,
            |_| None,
        )?;
        self.until("arming", |v| v.armed && v.accepted == Some(ARM), |p| Some(p.arm()))?;
        let offboard = |v: &View| v.mode == Some(Mode::Offboard) && v.accepted == Some(SET_MODE);
        self.until("offboard mode", offboard, |p| Some(p.set_mode(Mode::Offboard)))?;
        for (k, leg) in legs.legs.iter().enumerate() {
            self.aim(leg);
            let start = self.view.time_s;
            let begun = Instant::now();
            while self.view.time_s - start < legs.seconds && !ended.load(Ordering::Relaxed) {
                self.turn()?;
                if begun.elapsed()
                    > ANSWER_TIMEOUT.mul_f64(2.0) + Duration::from_secs_f64(legs.seconds)
                {
                    bail!("the companion has fallen silent: {}", self.last_text());
                }
                if self.view.mode != Some(Mode::Offboard) {
                    bail!("the companion left offboard: {}", self.last_text());
                }
                watch(k, self.view.time_s - start, &self.view);
            }
        }
        self.until("hold mode", |v| v.mode == Some(Mode::Hold), |p| Some(p.set_mode(Mode::Hold)))?;
        Ok(std::mem::take(&mut self.texts))
    }

    fn aim(&mut self, leg: &Leg) {
        self.target = (leg.roll_deg.to_radians(), leg.pitch_deg.to_radians());
    }

    /// Sends the request `ask` every half second until the condition `so` is true. Fails after `ANSWER_TIMEOUT`.
    fn until(
        &mut self,
        what: &str,
        so: impl Fn(&View) -> bool,
        ask: impl Fn(&mut OffboardClient) -> Option<Vec<u8>>,
    ) -> Result<()> {
        let (start, mut due) = (Instant::now(), Instant::now());
        while !so(&self.view) {
            if start.elapsed() > ANSWER_TIMEOUT {
                bail!("no {what} within {} s: {}", ANSWER_TIMEOUT.as_secs(), self.last_text());
            }
            // the companion requires a recent setpoint before it enters offboard
            if Instant::now() >= due + Duration::from_millis(100) {
                if let Some(bytes) = ask(&mut self.protocol) {
                    self.send(&bytes);
                }
                due += Duration::from_millis(500);
            }
            self.turn()?;
        }
        Ok(())
    }

    /// Sends the messages that are due, and reads one datagram if there is one.
    fn turn(&mut self) -> Result<()> {
        let now = Instant::now();
        if now >= self.heartbeat_due {
            self.heartbeat_due = now + Duration::from_secs(1);
            let bytes = self.protocol.heartbeat();
            self.send(&bytes);
        }
        if now >= self.setpoint_due {
            self.setpoint_due = now + SETPOINT_PERIOD;
            let time_ms = self.started.elapsed().as_millis() as u32;
            let bytes = self.protocol.setpoint(time_ms, self.target.0, self.target.1);
            self.send(&bytes);
        }
        let mut datagram = [0; 2048];
        // a time-out, or a companion that has not started yet, is not an error
        let Ok(length) = self.socket.recv(&mut datagram) else { return Ok(()) };
        let (view, texts) = (&mut self.view, &mut self.texts);
        self.protocol.read(&datagram[..length], |heard| match heard {
            Heard::Heartbeat { armed, mode } => (view.armed, view.mode) = (armed, mode),
            Heard::Attitude { time_s, roll, pitch } => {
                (view.time_s, view.roll, view.pitch) = (time_s, roll, pitch);
            }
            Heard::Speed { airspeed, altitude } => {
                (view.airspeed, view.altitude) = (airspeed, altitude)
            }
            Heard::Ack { command, accepted } if accepted => view.accepted = Some(command),
            Heard::Ack { .. } => {}
            Heard::Text(words) => texts.push((view.time_s, words)),
        });
        Ok(())
    }

    fn send(&self, bytes: &[u8]) {
        // a failed send is not retried: every message is sent periodically
        let _ = self.socket.send(bytes);
    }

    /// The companion's last text that does not confirm a request.
    fn last_text(&self) -> &str {
        let done = |words: &str| words.starts_with("mode ") || words.starts_with("armed");
        let last = self.texts.iter().rev().find(|(_, words)| !done(words));
        last.map_or("it says no reason", |(_, words)| words)
    }
}
