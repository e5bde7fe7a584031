//! The X8 with its elevons described one by one: flown, recorded, read from a log and diagnosed as any aircraft is.

use std::path::{Path, PathBuf};

use crate::study_support::{Aircraft, shipped_as_exported};
use greylag::control::{self, ControllerKind, Target};
use greylag::logs::mapping::Mapping;
use greylag::logs::{Options, load};
use greylag::model::GreyBox;
use greylag::model::jsbsim::export;
use greylag::physics::Command;
use greylag::sim::described::describe;
use greylag::sim::{Environment, Simulator};
use greylag_sitl::plant::{FULL_DEFLECTION_RAD as TRAVEL, Plant, PlantOptions};

const X8: Aircraft = Aircraft { name: "x8-elevons", folder: "x8-elevons", airspeed_mps: 18.0 };

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn model() -> GreyBox {
    GreyBox::load(&root().join("params/x8-elevons/jsbsim.toml")).unwrap()
}

fn plant() -> PlantOptions {
    let mut plant = PlantOptions { aircraft: "x8-elevons".into(), ..PlantOptions::default() };
    describe(&mut plant, &model().airframe).unwrap();
    plant
}

/// The simulator's aircraft is what `aircraft export jsbsim` makes of the model.
#[test]
fn the_simulators_aircraft_is_the_models_export() {
    let exported = export(&model(), "x8-elevons");
    shipped_as_exported(&exported, "x8-elevons");
}

#[test]
fn the_controls_travel_is_that_of_the_elevons() {
    let travel = Plant::new(&plant()).unwrap().travel().unwrap();
    for stops in [travel.aileron, travel.elevator] {
        assert!((stops.most_rad - TRAVEL).abs() < 1e-6, "{travel:?}");
        assert!((stops.least_rad + TRAVEL).abs() < 1e-6, "{travel:?}");
    }
    assert!(travel.rudder.is_none());
}

/// Within the elevons' stops the aircraft is the X8; beyond, it does what its elevons can.
#[test]
fn elevons_fly_as_the_x8_until_they_stop() {
    let mut both =
        [Simulator::new(&plant()).unwrap(), Simulator::new(&PlantOptions::default()).unwrap()];
    let command = |k: usize, size: f64| Command {
        aileron: size * (0.07 * k as f64).sin(),
        elevator: size * (0.05 * k as f64).cos() - 0.05,
        throttle: 0.3,
        rudder: 0.0,
    };
    for simulator in &mut both {
        simulator.reset().unwrap();
    }
    for k in 0..300 {
        let [a, b] = both.each_mut().map(|s| s.step(command(k, 0.2)).unwrap());
        let apart = (a.state.roll - b.state.roll).abs().max((a.state.pitch - b.state.pitch).abs());
        // two aircraft files of one aircraft: rounding of units
        assert!(apart < 1e-4, "{apart} rad after {k} steps");
        assert!((a.actuators.elevator - b.actuators.elevator).abs() < 1e-6);
    }
    let full = Command { aileron: 1.0, elevator: -1.0, throttle: 0.3, rudder: 0.0 };
    let seen = (0..30).map(|_| both[0].step(full).unwrap()).last().unwrap();
    // left 1 − 1 = 0, right −1 − 1 stops at −1: half of each
    assert!((seen.actuators.aileron - 0.5 * TRAVEL).abs() < 1e-3, "{:?}", seen.actuators);
    assert!((seen.actuators.elevator + 0.5 * TRAVEL).abs() < 1e-3, "{:?}", seen.actuators);
}

#[test]
fn the_lqi_reaches_its_targets_by_the_elevons() {
    let mut simulator = Simulator::new(&plant()).unwrap();
    let mut lqi = control::build(ControllerKind::Lqi, &model()).unwrap();
    for (roll, pitch) in [(40.0_f64, 0.0_f64), (-30.0, 10.0)] {
        let target = Target { roll: roll.to_radians(), pitch: pitch.to_radians(), airspeed: 16.67 };
        let mut seen = simulator.reset().unwrap();
        lqi.reset(1);
        for _ in 0..1000 {
            seen = simulator.step(lqi.command(&seen, &target)).unwrap();
        }
        let error =
            (seen.state.roll - target.roll).abs().max((seen.state.pitch - target.pitch).abs());
        assert!(error.to_degrees() < 0.05, "{error} rad at {roll} {pitch}");
    }
}

/// A log of the elevons alone, by position and by command, is a log of aileron and elevator.
#[test]
fn a_log_of_elevons_is_one_of_the_controls() {
    let folder = tempfile::tempdir().unwrap();
    let mixer = model().airframe.mixer.clone().unwrap();
    let mut text = "time_s,roll_rad,pitch_rad,p_radps,q_radps,r_radps,airspeed_mps,left_elevon_rad,right_elevon_rad,\
                    motor_throttle,left_elevon_cmd,right_elevon_cmd,motor_cmd\n"
        .to_owned();
    let asked = |k: usize| Command {
        aileron: 0.1 * (0.05 * k as f64).sin(),
        elevator: 0.2 * (0.03 * k as f64).cos(),
        throttle: 0.4,
        rudder: 0.0,
    };
    for k in 0..800 {
        let given = mixer.mix(&asked(k));
        let (left, right) = (given[0], given[1]);
        let (t, v) = (0.01 * k as f64, 16.0 + 0.3 * (0.02 * k as f64).sin());
        let (phi, theta) = (0.1 * (0.01 * k as f64).sin(), 0.05);
        text += &format!(
            "{t:.3},{phi},{theta},{},0.0,0.0,{v},{},{},0.4,{left},{right},0.4\n",
            0.1 * (0.01 * k as f64).cos(),
            TRAVEL * left,
            TRAVEL * right
        );
    }
    let path: PathBuf = folder.path().join("log.csv");
    std::fs::write(&path, text).unwrap();
    let bare = load(&path, &Options::default());
    assert!(bare.is_err(), "without the airframe the file has no aileron");
    let mapping = Mapping::default().with_mixer(Some(mixer));
    let log = load(&path, &Options { mapping, ..Options::default() }).unwrap();
    for (k, row) in log.flight.samples.iter().enumerate() {
        let wanted = asked(k);
        assert!((row.aileron_rad - TRAVEL * wanted.aileron).abs() < 1e-9, "{row:?}");
        assert!((row.elevator_rad - TRAVEL * wanted.elevator).abs() < 1e-9);
        assert!((row.aileron_cmd - wanted.aileron).abs() < 1e-9 && row.throttle == 0.4);
    }
}

#[test]
fn the_demonstration_and_the_evaluation_fly_it() {
    X8.is_flown_by_demo([25.0, 4.0]);
    let error = X8.settled_error_deg("jsbsim.toml", "easy,30,10\nhard_corners,-55,-27\n");
    assert!(error < 0.05, "{error} deg");
}

#[test]
fn a_hidden_effect_is_found_and_added() {
    X8.effect_is_found_and_added("pitch_break", "41");
}
