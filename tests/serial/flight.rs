//! The companion with the shim over a serial wire: a pair of pseudo-terminals at 921600 baud.

use std::time::{Duration, Instant};

use crate::flight_support::*;
use crate::real_time;
use crate::shim_support::{Shim, error_deg, parameter};
use crate::wire_support::Cable;
use greylag::flight::recorder::Place;
use greylag::flight::runtime::{Event, FlightOptions, Pace};
use greylag::logs::Sample;
use greylag::logs::csv::{self, Tolerance};
use greylag_sitl::shim;

const BAUD: u32 = 921_600;

/// A flight over the wire: everything that takes part.
struct Wired {
    cable: Cable,
    companion: Companion,
    shim: Shim,
    client: Client,
    folder: tempfile::TempDir,
}

impl Wired {
    fn start() -> Self {
        let cable = Cable::new(BAUD);
        let folder = tempfile::tempdir().unwrap();
        let record = Some(Place::Exactly(folder.path().join("flight")));
        let vehicle = cable.companion().parse().unwrap();
        let companion =
            Companion::start(&FlightOptions { vehicle, record, ..options(Pace::RealTime) });
        let shim = Shim::start(&cable.controller(), shim::Pace::RealTime, 600.0, |_| {});
        let client = Client::new(companion.client(0));
        Wired { cable, companion, shim, client, folder }
    }

    /// Ends the flight, and gives what was recorded.
    fn end(self) -> Vec<Sample> {
        println!("{}", self.shim.end());
        println!("{}", self.companion.end());
        let file = self.folder.path().join("flight/flight.csv");
        csv::load(&file, Tolerance::Strict).unwrap().flight.samples
    }
}

fn an_attitude_is_flown_over_the_wire() {
    let mut wired = Wired::start();
    // What is measured is the wire, not how long a busy machine keeps this test from running.
    wired.client.send(&parameter("GL_OFFB_LOSS_S", 10.0));
    wired.client.engage(30.0, 10.0);
    let begun = (wired.cable.carried(), Instant::now());
    wired.client.steer(30.0, 10.0, 9.0);
    let carried = wired.cable.carried();
    let seconds = begun.1.elapsed().as_secs_f64();
    for (i, towards) in ["companion", "controller"].iter().enumerate() {
        let bits = (carried[i] - begun.0[i]) as f64 * 10.0 / seconds;
        println!("towards the {towards}: {:.0} kbit/s of {:.0}", bits * 1e-3, BAUD as f64 * 1e-3);
    }
    let samples = wired.end();
    let settled = error_deg(&samples[samples.len() - 200..], (30.0, 10.0));
    println!("settled error over 921600 baud: {settled:.4} deg");
    // In process it is 0.0002°; a state frame is 4 ms old when it has come over the wire, and a
    // loaded machine adds to that.
    assert!(settled < 0.1, "{settled}");
}

fn a_plug_that_is_pulled_in_a_turn_levels_the_aircraft_and_comes_back() {
    let mut wired = Wired::start();
    wired.client.engage(40.0, 5.0);
    wired.client.steer(40.0, 5.0, 3.0);
    wired.cable.pull();
    wired.client.steer(40.0, 5.0, 1.5);
    wired.cable.plug();
    wired.client.steer(40.0, 5.0, 5.0);
    wired.client.catch_up();
    let said = wired.client.texts().concat();
    for words in
        ["has gone", "vehicle link lost: level, HOLD", "is back", "link back: flying in HOLD"]
    {
        assert!(said.contains(words), "{words} in {said}");
    }
    let samples = wired.end();
    let gap = samples.windows(2).map(|w| w[1].time_s - w[0].time_s).fold(0.0, f64::max);
    println!("longest gap in the state: {gap:.2} s");
    assert!((1.0..3.0).contains(&gap), "{gap}");
    // The aircraft rolled on with the surfaces where they stood; five seconds later it is level.
    let last = samples.last().unwrap().attitude_rad;
    assert!(last[0].to_degrees().abs() < 2.0, "{last:?}");
}

fn a_wrong_baud_rate_is_recognised_and_said() {
    let cable = Cable::new(BAUD);
    let vehicle = cable.companion_at(115_200).parse().unwrap();
    let companion = Companion::start(&FlightOptions { vehicle, ..options(Pace::RealTime) });
    let shim = Shim::start(&cable.controller(), shim::Pace::RealTime, 600.0, |_| {});
    let events = &companion.flight.as_ref().unwrap().events;
    let end = Instant::now() + Duration::from_secs(6);
    let mut heard = Vec::new();
    while let Ok(event) = events.recv_deadline(end) {
        if let Event::Text(text) = event {
            heard.push(text.words);
        }
        if heard.iter().any(|words| words.contains("baud")) {
            break;
        }
    }
    let said = heard.concat();
    assert!(said.contains("115200 is probably not the baud rate"), "{said}");
    assert!(said.contains("SER_TEL2_BAUD") && said.contains("--vehicle"), "{said}");
    shim.end();
    companion.end();
}

real_time::tests!(
    an_attitude_is_flown_over_the_wire,
    a_plug_that_is_pulled_in_a_turn_levels_the_aircraft_and_comes_back,
    a_wrong_baud_rate_is_recognised_and_said,
);
