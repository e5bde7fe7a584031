//! An aircraft that is not the X8 through shim and companion: what is recorded is what was flown.

use std::fs;
use std::path::Path;
use std::time::Duration;

use crate::flight_support::*;
use crate::real_time;
use crate::shim_support::{Shim, parameter};
use greylag::commands::fly::companion_with;
use greylag::control::ControllerKind;
use greylag::flight::recorder::Place;
use greylag::flight::runtime::Pace;
use greylag::logs::csv::{self, Tolerance};
use greylag::logs::{Options, Sample, load};
use greylag::model::GreyBox;
use greylag::physics::servos::Travel;
use greylag_sitl::plant::{PlantOptions, Start};
use greylag_sitl::shim::{self, Existing, TruthFile};
use mavlink::dialects::ardupilotmega::*;

/// 25° of travel, as small aircraft with a tail have it, in place of the X8's 0.5235 rad.
const TRAVEL_RAD: f64 = 0.4363;

/// The X8 with other stops under the name `other`.
fn other_aircraft() -> (tempfile::TempDir, PlantOptions) {
    let folder = tempfile::tempdir().unwrap();
    let (from, to) = (Path::new("sitl/aircraft/x8"), folder.path().join("other"));
    fs::create_dir_all(to.join("Engines")).unwrap();
    for engine in ["Engines/x8_motor.xml", "Engines/x8_direct.xml"] {
        fs::copy(from.join(engine), to.join(engine)).unwrap();
    }
    let document = fs::read_to_string(from.join("x8.xml")).unwrap();
    let flight_control = document.find("<flight_control").unwrap();
    let (before, after) = document.split_at(flight_control);
    let end = after.find("</flight_control>").unwrap();
    let stops = after[..end].replace("0.5235", &TRAVEL_RAD.to_string());
    fs::write(to.join("other.xml"), [before, &stops, &after[end..]].concat()).unwrap();
    let plant = PlantOptions {
        aircraft_dir: Some(folder.path().to_owned()),
        aircraft: "other".into(),
        ..PlantOptions::default()
    };
    (folder, plant)
}

fn recorded_deflections_are_those_flown_at_another_travel() {
    let (folder, plant) = other_aircraft();
    let mut model = x8().clone();
    for surface in [&mut model.airframe.actuators.aileron, &mut model.airframe.actuators.elevator] {
        surface.travel = Travel::symmetric(TRAVEL_RAD);
    }
    let logs = flown(folder.path(), &model, plant, Start::NEUTRAL);
    check_deflections(&logs, SURFACES);
}

/// The Aerosonde's rudder moves in turns, and every log of the flight shows it.
fn the_rudder_of_an_aircraft_that_has_one_is_flown_and_recorded() {
    let folder = tempfile::tempdir().unwrap();
    let model = GreyBox::load(Path::new("params/aerosonde/jsbsim.toml")).unwrap();
    let start = Start { airspeed_mps: 25.0, ..Start::NEUTRAL };
    let plant = PlantOptions { aircraft: "aerosonde".into(), start, ..PlantOptions::default() };
    let logs = flown(folder.path(), &model, plant, start);
    check_deflections(&logs, &[SURFACES[0], SURFACES[1], |row| row.rudder_rad]);
    let rudder = logs.truth.iter().map(|row| row.rudder_rad.abs()).fold(0.0, f64::max);
    // the turn to 30 degrees of bank takes 3 degrees of it
    assert!(rudder > 0.02, "the rudder moved by {rudder} rad");
}

/// What the companion recorded of a flight, by its table and by its telemetry, beside the truth.
struct Logs {
    table: Vec<Sample>,
    telemetry: Vec<Sample>,
    truth: Vec<Sample>,
}

/// Flies 10 s by the LQI on `model` to 30 degrees of bank, recorded in `folder`.
fn flown(folder: &Path, model: &GreyBox, plant: PlantOptions, start: Start) -> Logs {
    let mut options = options(Pace::Lockstep);
    options.travels = model.airframe.actuators.travels();
    options.record = Some(Place::Exactly(folder.join("flight")));
    let companion = Companion::with(
        &options,
        companion_with(ControllerKind::Lqi, model, Path::new("")).unwrap(),
    );
    let truth = folder.join("truth.csv");
    let link = format!("udpout:{}", companion.vehicle());
    let shim = Shim::start(&link, shim::Pace::Lockstep, 10.0, |shim| {
        shim.plant = plant;
        shim.start = start;
        shim.truth = Some(TruthFile { path: truth.clone(), existing: Existing::Keep });
    });
    let mut client = Client::new(companion.client(0));
    client.send(&parameter("GL_OFFB_LOSS_S", 60.0));
    client.wait("echo", |m| matches!(m, MavMessage::PARAM_VALUE(p) if p.param_value == 60.0));
    client.engage(30.0, 10.0);
    while shim.is_flying() {
        client.setpoint(30.0, 10.0);
        std::thread::sleep(Duration::from_millis(10));
    }
    shim.end();
    companion.end();
    let samples = |path: &Path| csv::load(path, Tolerance::Strict).unwrap().flight.samples;
    let telemetry = load(&folder.join("flight/flight.tlog"), &Options::default()).unwrap();
    Logs {
        table: samples(&folder.join("flight/flight.csv")),
        telemetry: telemetry.flight.samples,
        truth: samples(&truth),
    }
}

/// A deflection of a sample, rad.
type Deflection = fn(&Sample) -> f64;

const SURFACES: &[Deflection] = &[|row| row.aileron_rad, |row| row.elevator_rad];

/// Both logs show the true deflections.
fn check_deflections(logs: &Logs, surfaces: &[Deflection]) {
    for recorded in [&logs.table, &logs.telemetry] {
        check_rows(recorded, &logs.truth, surfaces);
    }
}

/// Every row that shows a time of the truth shows its deflections.
fn check_rows(recorded: &[Sample], truth: &[Sample], surfaces: &[Deflection]) {
    let (mut rows, mut largest) = (0, 0.0_f64);
    for row in recorded {
        let Some(flown) = truth.iter().find(|t| (t.time_s - row.time_s).abs() < 1e-4) else {
            continue;
        };
        for (got, want) in surfaces.iter().map(|of| (of(row), of(flown))) {
            // Floats on the wire: 24 bits of 0.44 rad.
            assert!((got - want).abs() < 1e-6, "{got} for {want} at {} s", row.time_s);
        }
        largest = largest.max(flown.elevator_rad.abs());
        rows += 1;
    }
    // The elevator did move: 1e-6 of nothing would be no proof.
    assert!(rows > 500 && largest > 0.05, "{rows} rows, {largest} rad");
}

fn an_aircraft_of_another_travel_than_the_airframe_is_refused() {
    let (_folder, plant) = other_aircraft();
    let companion = Companion::start(&options(Pace::Lockstep));
    // connected before the vehicle: the refusal is sent once, to the clients of that moment
    let mut client = Client::new(companion.client(0));
    let link = format!("udpout:{}", companion.vehicle());
    let shim = Shim::start(&link, shim::Pace::Lockstep, 10.0, |shim| shim.plant = plant);
    client.wait_for_text("travel is 0.4363");
    assert_ne!(client.arm(), MavResult::MAV_RESULT_ACCEPTED);
    client.wait_for_text("arming refused");
    shim.end();
    companion.end();
}

// in lockstep, but on a machine that stands still the waits on sockets and threads run out
real_time::tests!(
    recorded_deflections_are_those_flown_at_another_travel,
    the_rudder_of_an_aircraft_that_has_one_is_flown_and_recorded,
    an_aircraft_of_another_travel_than_the_airframe_is_refused,
);
