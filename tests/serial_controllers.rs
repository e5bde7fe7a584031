//! The companion at played flight controllers over a serial wire of 921600 baud, in real time.
#![cfg(feature = "sitl")]

mod controller_support;
mod flight_support;
mod shim_support;
mod wire_support;

use std::time::{Duration, Instant};

use controller_support::profile;
use flight_support::*;
use greylag::flight::recorder::Place;
use greylag::flight::runtime::{Options, Pace};
use greylag::link::vehicle::Authority;
use greylag::logs::csv::{self, Tolerance};
use greylag_sitl::shim::{self, Personality};
use mavlink::dialects::ardupilotmega::*;
use shim_support::{Shim, error_deg, parameter};
use wire_support::Cable;

use Authority::{Attitude, Surfaces};
use Personality::{Ardupilot, Px4};

const BAUD: u32 = 921_600;
/// Of the easy box.
const TARGET: (f64, f64) = (30.0, 10.0);

/// A companion at a controller, with a client that addresses the onboard computer.
struct Wired {
    cable: Cable,
    companion: Companion,
    shim: Shim,
    client: Client,
    folder: tempfile::TempDir,
}

impl Wired {
    fn start(personality: Personality, authority: Authority) -> Self {
        let cable = Cable::new(BAUD);
        let folder = tempfile::tempdir().unwrap();
        let companion = Companion::start(&Options {
            vehicle: cable.companion().parse().unwrap(),
            record: Some(Place::Exactly(folder.path().join("flight"))),
            controller: Some(profile(personality, authority)),
            ..options(Pace::RealTime)
        });
        let shim = Shim::start(&cable.controller(), shim::Pace::RealTime, 600.0, |options| {
            options.personality = Some(personality);
        });
        let mut client = Client::new(companion.client(0));
        client.component = 191;
        Wired { cable, companion, shim, client, folder }
    }

    /// Arms the companion as soon as it lets itself be armed, and enters OFFBOARD.
    fn engage(&mut self) {
        let end = Instant::now() + Duration::from_secs(20);
        while self.client.arm() != MavResult::MAV_RESULT_ACCEPTED {
            assert!(Instant::now() < end, "{:?}", self.client.texts());
            std::thread::sleep(Duration::from_millis(300));
        }
        // What is measured is the wire, not how long a busy machine keeps this test from running.
        let mut patience = parameter("GL_OFFB_LOSS_S", 10.0);
        if let MavMessage::PARAM_SET(m) = &mut patience {
            m.target_component = 191;
        }
        self.client.send(&patience);
        self.client.setpoint(TARGET.0, TARGET.1);
        assert_eq!(self.client.mode(OFFBOARD), MavResult::MAV_RESULT_ACCEPTED);
    }
}

/// The settled error over the wire, degrees. A machine that stands still for 0.3 s has the aircraft
/// handed back, as it should: that says nothing of the wire, and is flown once more.
fn settled(personality: Personality, authority: Authority) -> f64 {
    (0..3).find_map(|_| flown(personality, authority)).expect("a machine that lets it fly")
}

/// The settled error of one flight; `None` if the machine stood still.
fn flown(personality: Personality, authority: Authority) -> Option<f64> {
    let mut wired = Wired::start(personality, authority);
    wired.engage();
    wired.client.steer(TARGET.0, TARGET.1, 12.0);
    wired.client.catch_up();
    let texts = wired.client.texts().concat();
    println!("{texts}");
    println!("{}", wired.shim.end());
    println!("{}", wired.companion.end());
    if texts.contains("no state of the vehicle for 0.3 s") {
        return None;
    }
    let file = wired.folder.path().join("flight/flight.csv");
    let samples = csv::load(&file, Tolerance::Strict).unwrap().flight.samples;
    let settled = error_deg(&samples[samples.len() - 200..], TARGET);
    println!("{personality} {authority:?} over {BAUD} baud: settled error {settled:.4} deg");
    Some(settled)
}

// The bounds are those of issue 8.

#[test]
fn surfaces_through_px4() {
    assert!(settled(Px4, Surfaces) < 0.3);
}

#[test]
fn surfaces_through_ardupilot() {
    assert!(settled(Ardupilot, Surfaces) < 0.6);
}

#[test]
fn attitude_through_px4() {
    assert!(settled(Px4, Attitude) < 0.1);
}

#[test]
fn attitude_through_ardupilot() {
    assert!(settled(Ardupilot, Attitude) < 0.1);
}

#[test]
fn a_plug_that_is_pulled_hands_the_aircraft_back_and_nothing_is_taken_again() {
    let mut wired = Wired::start(Px4, Surfaces);
    wired.engage();
    wired.client.steer(TARGET.0, TARGET.1, 3.0);
    wired.cable.pull();
    wired.client.steer(TARGET.0, TARGET.1, 2.0);
    wired.cable.plug();
    wired.client.steer(TARGET.0, TARGET.1, 3.0);
    wired.client.catch_up();
    let said = wired.client.texts().concat();
    for words in ["has gone", "handed back to the controller", "is back"] {
        assert!(said.contains(words), "{words} in {said}");
    }
    let custom = |m: &MavMessage| match m {
        // PX4's heartbeat, passed on by the companion.
        MavMessage::HEARTBEAT(h) if h.autopilot == MavAutopilot::MAV_AUTOPILOT_PX4 => {
            Some(h.custom_mode)
        }
        _ => None,
    };
    let modes: Vec<u32> = wired.client.log.iter().filter_map(custom).collect();
    assert!(modes.contains(&(1 << 16)), "never in MANUAL: {modes:x?}");
    assert_eq!(modes.last(), Some(&0x0304_0000), "{modes:x?}");
    wired.shim.end();
    wired.companion.end();
}
