//! One flight of 60 s under faults, in lockstep in this process.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::time::Duration;

use anyhow::{Context, Result};
use greylag_sitl::plant::{PlantOptions, Start, Truth};
use greylag_sitl::shim::bench::Bench;
use greylag_sitl::shim::controller::{FlightController, Mode as TheirMode};
use greylag_sitl::shim::{Distortion, Launch, Noise, Personality, ShimOptions};

use super::judge::{Finding, Judge};
use super::mix::{Fault, Kind, draw};
use super::wire::Wire;
use crate::commands::fly::{POLICY, crew};
use crate::control::Kind as ControllerKind;
use crate::flight::desk::Desk;
use crate::flight::runtime::Crew;
use crate::link::autopilot::{AttitudeSetpoint, Autopilot, Mode, Verdict};
use crate::link::vehicle::{Authority, Profile, Real, Sitl, Stack, Vehicle};
use crate::model::GreyBox;

/// Steps of a flight: 60 s.
const STEPS: u64 = 6000;
/// Setpoints come at 10 Hz.
const SETPOINT_EVERY: u64 = 10;
/// What the client asks for, s, roll, pitch in degrees: turns both ways, a climb, a descent.
const LEGS: [(f64, f64, f64); 6] = [
    (0.0, 0.0, 3.0),
    (12.0, 35.0, 5.0),
    (20.0, -40.0, 3.0),
    (28.0, 10.0, 12.0),
    (36.0, 30.0, -3.0),
    (44.0, 0.0, 3.0),
];
/// A dead link must have handed the aircraft back after this time, s.
const HAND_BACK_S: f64 = 0.5;

/// What is at the other end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Opposite {
    /// The simulator's shim.
    Sitl,
    /// PX4 by surfaces.
    Px4,
    /// PX4 by attitude.
    Px4Attitude,
    /// ArduPilot by channels.
    Ardupilot,
    /// ArduPilot by attitude.
    ArdupilotAttitude,
}

impl Opposite {
    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Opposite::Sitl => "sitl",
            Opposite::Px4 => "px4",
            Opposite::Px4Attitude => "px4-attitude",
            Opposite::Ardupilot => "ardupilot",
            Opposite::ArdupilotAttitude => "ardupilot-attitude",
        }
    }

    fn personality(self) -> Option<(Personality, Authority)> {
        match self {
            Opposite::Sitl => None,
            Opposite::Px4 => Some((Personality::Px4, Authority::Surfaces)),
            Opposite::Px4Attitude => Some((Personality::Px4, Authority::Attitude)),
            Opposite::Ardupilot => Some((Personality::Ardupilot, Authority::Surfaces)),
            Opposite::ArdupilotAttitude => Some((Personality::Ardupilot, Authority::Attitude)),
        }
    }
}

/// A flight to be flown.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    /// Its number, from which everything random follows.
    pub seed: u64,
    /// Who steers.
    pub controller: ControllerKind,
    /// Whom it steers through.
    pub opposite: Opposite,
}

/// What came of it.
#[derive(Clone, Debug)]
pub struct Report {
    /// The flight.
    pub case: Case,
    /// What befell it.
    pub faults: Vec<Fault>,
    /// What was found wrong, with its time, s.
    pub findings: Vec<(f64, Finding)>,
    /// What was said to the ground stations, with nothing left out.
    pub texts: Vec<String>,
}

/// The aircraft with what flies it.
enum Aircraft {
    Sitl(Box<Bench>),
    Real(Box<FlightController>),
}

impl Aircraft {
    fn new(case: &Case) -> Result<Self> {
        let mut options = ShimOptions::new(PlantOptions::default(), Start::NEUTRAL);
        options.seed = case.seed;
        options.noise = Noise::REALISTIC;
        Ok(match case.opposite.personality() {
            None => Aircraft::Sitl(Box::new(Bench::new(&options)?)),
            Some((personality, _)) => {
                options.launch = Launch::Immediate;
                Aircraft::Real(Box::new(FlightController::new(personality, &options)?))
            }
        })
    }

    fn show(&mut self, distortion: Distortion) -> Vec<u8> {
        let mut bytes = Vec::new();
        match self {
            Aircraft::Sitl(bench) => {
                bench.distort(distortion);
                bench.show(&mut bytes);
            }
            Aircraft::Real(controller) => {
                controller.distort(distortion);
                controller.show(&mut bytes);
            }
        }
        bytes
    }

    fn truth(&self) -> Truth {
        match self {
            Aircraft::Sitl(bench) => bench.measured(),
            Aircraft::Real(controller) => controller.measured(),
        }
    }

    fn hear(&mut self, bytes: &[u8]) {
        match self {
            Aircraft::Sitl(bench) => bench.hear(bytes),
            Aircraft::Real(controller) => controller.hear(bytes),
        }
    }

    /// Flies a step; `false` when the flight has ended on the ground or outside the numbers.
    fn fly(&mut self) -> bool {
        let flown = match self {
            Aircraft::Sitl(bench) => bench.fly(),
            Aircraft::Real(controller) => controller.fly(),
        };
        matches!(flown, Ok(None))
    }

    /// Whether the companion has the surfaces, or the attitude.
    fn is_steered(&self) -> bool {
        match self {
            Aircraft::Sitl(_) => true,
            Aircraft::Real(c) => matches!(c.mode(), TheirMode::Manual | TheirMode::Guided),
        }
    }
}

/// A companion fresh from the works: the design of its controller is not made again.
pub struct Works {
    crew: Crew,
    model: GreyBox,
}

impl Works {
    /// The works for a controller.
    ///
    /// # Errors
    /// If the model does not allow it.
    pub fn new(controller: ControllerKind, model: &GreyBox) -> Result<Self> {
        Ok(Works { crew: crew(controller, model, Path::new(POLICY))?, model: model.clone() })
    }

    fn desk(&self, opposite: Opposite) -> Result<Desk> {
        let fallback = crate::control::build(ControllerKind::PidRetuned, &self.model)?;
        let config = self.crew.pilot.config().clone();
        let fallback = match self.crew.controller.name() {
            // As in flight: an LQI is its own fallback.
            "lqi" => self.crew.controller.boxed_clone(),
            _ => fallback,
        };
        let pilot = crate::flight::pilot::Pilot::new(config, fallback)?;
        let controller = self.crew.controller.boxed_clone();
        let vehicle = vehicle(opposite, &self.model);
        Ok(Desk::new(Crew { pilot, controller, seat: self.crew.seat }, vehicle))
    }

    /// Flies `case`; a panic of the companion is a finding.
    ///
    /// # Errors
    /// If the aircraft cannot be loaded.
    pub fn fly(&self, case: Case) -> Result<Report> {
        let faults = draw(case.seed);
        let mut flight = Flight {
            aircraft: Aircraft::new(&case)?,
            desk: self.desk(case.opposite)?,
            down: Wire::new(case.seed, 0),
            up: Wire::new(case.seed, 1),
            judge: Judge::new(self.model.airframe.envelope),
            faults: faults.clone(),
            clock_us: 0,
            armed: false,
            dead_since: None,
        };
        let flown = catch_unwind(AssertUnwindSafe(|| flight.fly()));
        if flown.is_err() {
            flight.judge.note(0.0, Finding::Panic);
        }
        flown.ok().transpose().context("flying a case")?;
        let texts = flight.desk.texts.iter().map(|text| text.words.clone()).collect();
        Ok(Report { case, faults, findings: flight.judge.findings(), texts })
    }
}

fn vehicle(opposite: Opposite, model: &GreyBox) -> Vehicle {
    let actuators = model.airframe.actuators;
    match opposite.personality() {
        None => Vehicle::Sitl(Sitl::new(1, actuators.deflection_max)),
        Some((personality, authority)) => {
            let stack = match personality {
                Personality::Px4 => Stack::Px4,
                Personality::Ardupilot => Stack::Ardupilot,
            };
            Vehicle::Real(Box::new(Real::new(Profile { stack, authority, actuators })))
        }
    }
}

/// A flight under way.
struct Flight {
    aircraft: Aircraft,
    desk: Desk,
    down: Wire,
    up: Wire,
    judge: Judge,
    faults: Vec<Fault>,
    /// What jumps have added to the vehicle's clock, µs.
    clock_us: i64,
    armed: bool,
    /// Since when nothing has come, while steering through a real controller.
    dead_since: Option<f64>,
}

impl Flight {
    fn fly(&mut self) -> Result<()> {
        for step in 0..STEPS {
            let now_s = step as f64 * 0.01;
            if !self.step(step, now_s) {
                self.judge.note(now_s, Finding::Crash);
                return Ok(());
            }
        }
        let end = STEPS as f64 * 0.01;
        let truth = self.aircraft.truth();
        // Who was handed back flies level; who was not flies the client's last leg, or level.
        let pitch = truth.pitch_rad.to_degrees().clamp(-2.0, 6.0);
        self.judge.end(end, &truth, [0.0, pitch]);
        Ok(())
    }

    /// One step of 10 ms; `false` when the aircraft is lost.
    fn step(&mut self, step: u64, now_s: f64) -> bool {
        let acting: Vec<Fault> = self.faults.iter().filter(|f| f.acts(now_s)).copied().collect();
        let host = Duration::from_secs(1) + Duration::from_millis(10 * step);
        let distortion = self.distortion(&acting, step);
        let bytes = self.aircraft.show(distortion);
        let rebooting = acting.iter().any(|fault| fault.kind == Kind::Reboot);
        if !rebooting && !bytes.is_empty() {
            self.down.send(step, bytes, &acting);
        }
        let mut up = Vec::new();
        let mut heard = false;
        for batch in self.down.receive(step) {
            heard = true;
            let judge = &mut self.judge;
            self.desk.hear(host, &batch, &mut up, |_, decision| judge.decision(now_s, decision));
        }
        self.client(step, now_s, host, &acting);
        self.desk.poll(host, &mut up);
        if !up.is_empty() {
            self.up.send(step, up, &acting);
        }
        for batch in self.up.receive(step) {
            self.aircraft.hear(&batch);
        }
        self.watch_link(now_s, heard);
        let flies = self.aircraft.fly();
        self.judge.aircraft(now_s, &self.aircraft.truth());
        flies
    }

    /// The client: arms when it can, then sends its legs.
    fn client(&mut self, step: u64, now_s: f64, host: Duration, acting: &[Fault]) {
        if acting.iter().any(|fault| fault.kind == Kind::Client)
            || !step.is_multiple_of(SETPOINT_EVERY)
        {
            return;
        }
        let (_, roll, pitch) =
            LEGS.iter().rev().find(|(from, ..)| *from <= now_s).copied().unwrap_or(LEGS[0]);
        let now = self.desk.now(host);
        let setpoint =
            AttitudeSetpoint { roll: roll.to_radians(), pitch: pitch.to_radians(), thrust: None };
        if !self.armed {
            self.armed = self.desk.arm(host) == Verdict::Accepted;
            if self.armed {
                self.desk.pilot().attitude_setpoint(now, setpoint);
                // Refused at most because something is lost at this very moment: HOLD is flown.
                let _ = self.desk.pilot().set_mode(now, Mode::Offboard);
            }
        }
        self.desk.pilot().attitude_setpoint(now, setpoint);
    }

    /// What the faults do to the sensors and the clock.
    fn distortion(&mut self, acting: &[Fault], step: u64) -> Distortion {
        let mut distortion = Distortion::default();
        for fault in acting {
            let s = fault.strength;
            match fault.kind {
                Kind::Frozen => distortion.frozen = true,
                // What a tube that has iced up shows: the speed of that moment, or less and less.
                Kind::Airspeed => distortion.airspeed_mps = Some(8.0 + 20.0 * s),
                Kind::Alpha => distortion.alpha_rad = 0.5 * (s - 0.5),
                Kind::NotANumber => distortion.rate_not_a_number = true,
                Kind::Clock => self.clock_us = (1e7 * s) as i64,
                // Time begins anew.
                Kind::Reboot => self.clock_us = -(10_000 * step as i64),
                _ => {}
            }
        }
        distortion.clock_us = self.clock_us;
        distortion
    }

    /// A link that is dead hands the aircraft back within half a second.
    fn watch_link(&mut self, now_s: f64, heard: bool) {
        let real = matches!(self.aircraft, Aircraft::Real(_));
        let engaged = match self.desk.vehicle() {
            Vehicle::Real(session) => session.is_engaged(),
            Vehicle::Sitl(_) => false,
        };
        if heard || !real || !engaged || !self.aircraft.is_steered() {
            self.dead_since = None;
            return;
        }
        let since = *self.dead_since.get_or_insert(now_s);
        if now_s - since > HAND_BACK_S {
            self.judge.note(now_s, Finding::SlowHandBack);
        }
    }
}

impl std::fmt::Display for Case {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "--controller {} --opposite {} --first {} --flights 1",
            self.controller.name(),
            self.opposite.name(),
            self.seed
        )
    }
}
