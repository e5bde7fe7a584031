//! A companion at a played flight controller, in lockstep in this process.
#![allow(dead_code)] // each test that includes this module uses its part

use std::sync::LazyLock;
use std::time::Duration;

use greylag::control::{Controller, ControllerKind, build};
use greylag::flight::desk::Desk;
use greylag::flight::pilot::{Config, Decision, Pilot};
use greylag::flight::runtime::{Companion, Placement};
use greylag::link::autopilot::{AttitudeSetpoint, Autopilot, Mode, Verdict};
use greylag::link::framing::pieces;
use greylag::link::signing::Signer;
use greylag::link::vehicle::{Authority, Profile, Real, Stack, Telemetry, Vehicle};
use greylag_sitl::plant::{PlantOptions, Start, Truth};
use greylag_sitl::shim::controller::FlightController;
use greylag_sitl::shim::{Launch, Personality, ShimOptions};

use crate::flight_support::x8;

const HEARTBEAT: u32 = 0;
pub const STEP: Duration = Duration::from_millis(10);

/// The profile that fits a personality.
pub fn profile(personality: Personality, authority: Authority) -> Profile {
    let stack = match personality {
        Personality::Px4 => Stack::Px4,
        Personality::Ardupilot => Stack::Ardupilot,
    };
    Profile { stack, authority, actuators: x8().airframe.actuators }
}

/// An LQI with an LQI to fall back on; the design, which takes most of a bench's time, is made once.
fn lqi() -> Companion {
    static DESIGN: LazyLock<(Config, Box<dyn Controller>)> = LazyLock::new(|| {
        (Config::for_model(x8()).unwrap(), build(ControllerKind::Lqi, x8()).unwrap())
    });
    let (config, design) = &*DESIGN;
    let [controller, fallback] = [(), ()].map(|()| design.boxed_clone());
    let pilot = Pilot::new(config.clone(), fallback).unwrap();
    Companion { pilot, controller, placement: Placement::Loop }
}

/// What the bench saw at one state.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    pub state: Telemetry,
    pub truth: Truth,
    pub decision: Decision,
}

pub struct Bench {
    pub desk: Desk,
    pub controller: FlightController,
    pub host: Duration,
    pub seen: Vec<Seen>,
    /// Bytes on their way to the controller.
    up: Vec<u8>,
    /// The wire is cut.
    pub cut: bool,
    /// The controller's heartbeats do not come through.
    pub heartless: bool,
    /// The controller signs what it sends, and ignores what is not signed.
    pub signer: Option<Signer>,
}

impl Bench {
    pub fn new(
        personality: Personality,
        authority: Authority,
        change: impl FnOnce(&mut ShimOptions),
    ) -> Self {
        let mut options = ShimOptions::new(PlantOptions::default(), Start::NEUTRAL);
        options.launch = Launch::Immediate;
        change(&mut options);
        let vehicle = Vehicle::Real(Box::new(Real::new(profile(personality, authority))));
        Bench {
            desk: Desk::new(lqi(), vehicle),
            controller: FlightController::new(personality, &options).unwrap(),
            host: Duration::from_secs(1),
            seen: Vec::new(),
            up: Vec::new(),
            cut: false,
            heartless: false,
            signer: None,
        }
    }

    pub fn step(&mut self) {
        let mut down = Vec::new();
        self.controller.show(&mut down);
        if self.heartless {
            let mut rest = Vec::new();
            pieces(&down, |bytes, frame| {
                if frame.is_none_or(|frame| frame.id != HEARTBEAT) {
                    rest.extend_from_slice(bytes);
                }
            });
            down = rest;
        }
        if let Some(signer) = &mut self.signer {
            down = signer.sign(self.host.as_micros() as u64, 0, &down);
        }
        let truth = self.controller.measured();
        if !self.cut {
            let seen = &mut self.seen;
            self.desk.receive(self.host, &down, &mut self.up, |state, decision| {
                seen.push(Seen { state: *state, truth, decision: *decision });
            });
        }
        self.desk.poll(self.host, &mut self.up);
        let up = std::mem::take(&mut self.up);
        if !self.cut && self.signer.is_none() {
            self.controller.receive(&up);
        }
        assert_eq!(self.controller.fly().unwrap(), None, "the flight is over");
        self.host += STEP;
    }

    /// Bytes of somebody else on the wire between controller and companion.
    pub fn beside(&mut self, bytes: &[u8]) {
        self.desk.receive(self.host, bytes, &mut self.up, |_, _| {});
    }

    pub fn run(&mut self, seconds: f64) {
        (0..(seconds * 100.0) as usize).for_each(|_| self.step());
    }

    /// Arms the companion and enters OFFBOARD at an attitude.
    pub fn engage(&mut self, roll_deg: f64, pitch_deg: f64) {
        assert_eq!(self.desk.arm(self.host), Verdict::Accepted, "{:?}", self.texts());
        self.wish(roll_deg, pitch_deg);
        let now = self.desk.now(self.host);
        assert_eq!(self.desk.pilot().set_mode(now, Mode::Offboard), Verdict::Accepted);
    }

    pub fn wish(&mut self, roll_deg: f64, pitch_deg: f64) {
        let setpoint = AttitudeSetpoint {
            roll: roll_deg.to_radians(),
            pitch: pitch_deg.to_radians(),
            thrust: None,
        };
        let now = self.desk.now(self.host);
        self.desk.pilot().attitude_setpoint(now, setpoint);
    }

    /// Flies an attitude for some seconds, with setpoints at 10 Hz.
    pub fn steer(&mut self, roll_deg: f64, pitch_deg: f64, seconds: f64) {
        for _ in 0..(seconds * 10.0) as usize {
            self.wish(roll_deg, pitch_deg);
            self.run(0.1);
        }
    }

    pub fn texts(&self) -> Vec<String> {
        self.desk.texts.iter().map(|text| text.words.clone()).collect()
    }

    pub fn said(&self, words: &str) -> bool {
        self.texts().iter().any(|text| text.contains(words))
    }

    /// Mean of roll and pitch RMSE of the truth over the last two seconds, degrees.
    pub fn settled_deg(&self, roll_deg: f64, pitch_deg: f64) -> f64 {
        let last = &self.seen[self.seen.len() - 200..];
        let rmse = |error: &dyn Fn(&Truth) -> f64| {
            let sum: f64 = last.iter().map(|seen| error(&seen.truth).powi(2)).sum();
            (sum / last.len() as f64).sqrt()
        };
        0.5 * (rmse(&|t| t.roll_rad.to_degrees() - roll_deg)
            + rmse(&|t| t.pitch_rad.to_degrees() - pitch_deg))
    }
}
