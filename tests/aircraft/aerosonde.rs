//! The Aerosonde, an aircraft with rudder and propeller: flown, compared and diagnosed as the X8 is.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use greylag::control::{self, Controller, ControllerKind, Target};
use greylag::logs::{Flight, Sample};
use greylag::model::{GreyBox, STEP, Trim};
use greylag::num::stream::{Stream, stream};
use greylag::physics::Command;
use greylag::sim::one_step::{Flight as Excited, errors};
use greylag::sim::{Environment, Simulator};
use greylag::sysid::diagnose::{Diagnosis, Options, Verdict, diagnose};
use greylag::sysid::flight_path::reconstruction::Reconstruction;
use greylag::sysid::flight_path::{self, ActuatorClock, reconstruct};
use greylag_sitl::plant::{PlantOptions, Start};
use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("params/aerosonde")
}

fn model() -> GreyBox {
    GreyBox::load(&folder().join("jsbsim.toml")).unwrap()
}

/// The model with one part of its file replaced.
fn changed(change: impl FnOnce(String) -> String) -> GreyBox {
    let copy = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(folder().join("jsbsim.toml")).unwrap();
    std::fs::copy(folder().join("airframe.toml"), copy.path().join("airframe.toml")).unwrap();
    std::fs::write(copy.path().join("model.toml"), change(text)).unwrap();
    GreyBox::load(&copy.path().join("model.toml")).unwrap()
}

/// `text` without the section of an effect.
fn without(text: &str, effect: &str) -> String {
    let start = text.find(&format!("[effects.{effect}]")).unwrap();
    let length = text[start + 1..].find("\n[").map_or(text.len() - start, |n| n + 2);
    [&text[..start], &text[start + length..]].concat()
}

fn simulator() -> Simulator {
    let start = Start { airspeed_mps: 25.0, ..Start::NEUTRAL };
    let aircraft = "aerosonde".to_owned();
    Simulator::new(&PlantOptions { aircraft, start, ..PlantOptions::default() }).unwrap()
}

/// A part of a schedule: what is wanted, with what on top.
fn leg(random: &mut Stream) -> (Target, Command) {
    let target = Target {
        roll: random.random_range(-0.6..0.6),
        pitch: random.random_range(-0.12..0.15),
        airspeed: random.random_range(20.0..28.0),
    };
    let mut part = |most: f64| random.random_range(-most..most);
    let aileron = part(0.15);
    let on_top = Command { aileron, elevator: part(0.12), throttle: part(0.3), rudder: part(0.4) };
    (target, on_top)
}

/// Flies `seconds` of the LQI with random steps on all four controls, through noisy sensors.
fn flown(seed: u64, seconds: f64) -> Flight {
    let mut simulator = simulator();
    let mut lqi = control::build(ControllerKind::Lqi, &model()).unwrap();
    let mut random = stream(seed, &[3]);
    let mut seen = simulator.reset().unwrap();
    lqi.reset(seed);
    let mut flight = Flight::default();
    let (mut target, mut on_top) =
        (Target { roll: 0.0, pitch: 0.05, airspeed: 25.0 }, Command::IDLE);
    for step in 0..(seconds / STEP) as usize {
        if step % 40 == 39 && step > 300 {
            let (wanted, steps) = leg(&mut random);
            on_top = steps;
            target = if step % 400 > 360 { wanted } else { target };
        }
        let own = lqi.command(&seen, &target);
        let command = Command {
            aileron: own.aileron + on_top.aileron,
            elevator: own.elevator + on_top.elevator,
            throttle: own.throttle + on_top.throttle,
            rudder: own.rudder + on_top.rudder,
        }
        .clamped();
        let truth = simulator.truth();
        let mut sensed = |x: f64, sd: f64| -> f64 {
            let unit: f64 = StandardNormal.sample(&mut random);
            x + sd * unit
        };
        flight.samples.push(Sample {
            time_s: truth.time_s,
            attitude_rad: [truth.roll_rad, truth.pitch_rad, truth.yaw_rad]
                .map(|x| sensed(x, 0.002)),
            rates_radps: [truth.p_radps, truth.q_radps, truth.r_radps].map(|x| sensed(x, 0.002)),
            airspeed_mps: sensed(truth.airspeed_mps, 0.1),
            alpha_rad: sensed(truth.alpha_rad, 0.002),
            beta_rad: sensed(truth.beta_rad, 0.002),
            specific_force_mps2: truth.specific_force_mps2.map(|x| sensed(x, 0.05)),
            altitude_m: truth.altitude_m,
            aileron_rad: truth.aileron_rad,
            elevator_rad: truth.elevator_rad,
            throttle: truth.throttle,
            rudder_rad: truth.rudder_rad,
            rudder_cmd: command.rudder,
            rate_hold_s: STEP,
            ..Sample::default()
        });
        seen = simulator.step(command).unwrap();
    }
    flight
}

fn rebuilt(log: &Flight) -> Reconstruction {
    let options = flight_path::Options {
        gravity: 9.806,
        actuators_clock: ActuatorClock::AsRecorded,
        ..flight_path::Options::new("aerosonde", model().airframe.actuators)
    };
    reconstruct(log, &options).unwrap()
}

/// Two flights, flown once for all tests.
static FLIGHTS: LazyLock<[Reconstruction; 2]> =
    LazyLock::new(|| [1, 2].map(|seed| rebuilt(&flown(seed, 60.0))));

fn asked(model: &GreyBox) -> Diagnosis {
    let (options, ignore_progress) =
        (Options::default(), &greylag::sysid::progress::ignore_progress);
    let found = diagnose(model, &*FLIGHTS, &options, ignore_progress).unwrap();
    println!("{:?} {:#?}", found.verdict, found.sentences);
    found
}

#[test]
fn validate_a_step_of_the_model_with_rudder_and_propeller() {
    let target = Target { roll: 0.3, pitch: 0.05, airspeed: 25.0 };
    let amplitude = Command { aileron: 0.15, elevator: 0.15, throttle: 0.15, rudder: 0.3 };
    let flight = Excited { steps: 2000, moved: 2000, amplitude };
    let rms = errors(&model(), &mut simulator(), &flight, |_| target).unwrap().rms;
    println!("{rms:?}");
    // 1 % of x_c a second is asked for; what is left is the simulator's way of turning the path
    assert!(rms.iter().all(|x| *x < 3e-4), "{rms:?}");
}

/// The planner searches around the LQI's plan: there is no policy of this aircraft. It leaves the rudder to the LQI, and
/// a plan that slips meanwhile is worth less.
#[test]
fn turns_are_coordinated_by_the_rudder() {
    for kind in [ControllerKind::Lqi, ControllerKind::HybridLqi] {
        let mut simulator = simulator();
        let mut controller = control::build(kind, &model()).unwrap();
        for (roll, pitch) in [(40.0_f64, 0.0_f64), (-40.0, 3.0), (20.0, 8.0), (-30.0, -8.0)] {
            let target =
                Target { roll: roll.to_radians(), pitch: pitch.to_radians(), airspeed: 25.0 };
            let [error, sideslip, steady] = settled(&mut simulator, controller.as_mut(), &target);
            println!(
                "{kind} {roll} {pitch}: sideslip up to {sideslip:.3} deg, {steady:.4} in the turn, settled within \
                 {error:.4} deg"
            );
            assert!(error < 0.05 && sideslip < 0.5 && steady < 0.05);
        }
    }
}

/// Largest error of the attitude in the last 2 s of 10 s, largest sideslip of all and of these 2 s, degrees.
fn settled(
    simulator: &mut Simulator,
    controller: &mut dyn Controller,
    target: &Target,
) -> [f64; 3] {
    let mut seen = simulator.reset().unwrap();
    controller.reset(1);
    let (mut sideslip, mut steady, mut error) = (0.0_f64, 0.0_f64, 0.0_f64);
    for step in 0..1000 {
        seen = simulator.step(controller.command(&seen, target)).unwrap();
        let s = seen.state;
        sideslip = sideslip.max(s.beta.abs().to_degrees());
        if step >= 800 {
            error = error.max((s.roll - target.roll).abs().to_degrees());
            error = error.max((s.pitch - target.pitch).abs().to_degrees());
            steady = steady.max(s.beta.abs().to_degrees());
        }
    }
    [error, sideslip, steady]
}

#[test]
fn a_turn_is_trimmed_without_sideslip_where_there_is_a_rudder() {
    let with = Trim::attitude(&model(), 0.7, 0.05, 25.0, 600.0).unwrap();
    assert!(with.state.beta.abs() < 1e-12 && with.controls.rudder.abs() > 1e-3, "{with:?}");
    let bare = changed(|text| without(&text, "rudder_linear"));
    let slipping = Trim::attitude(&bare, 0.7, 0.05, 25.0, 600.0).unwrap();
    assert!(slipping.state.beta.abs() > 1e-3 && slipping.controls.rudder == 0.0, "{slipping:?}");
}

#[test]
fn a_reconstructed_flight_keeps_its_rudder() {
    let rebuilt = &FLIGHTS[0];
    let instants = rebuilt.segments.iter().flat_map(|s| &s.instants);
    let written: Vec<f64> = rebuilt.to_flight().samples.iter().map(|s| s.rudder_rad).collect();
    assert_eq!(written, instants.map(|i| i.controls.rudder).collect::<Vec<_>>());
    assert!(written.iter().any(|deflection| deflection.abs() > 0.02));
}

#[test]
fn a_missing_rudder_is_said_first_and_named() {
    let found = asked(&changed(|text| without(&text, "rudder_linear")));
    assert!(found.sentences[0].starts_with("The rudder moves"), "{:?}", found.sentences[0]);
    assert_eq!(found.verdict, Verdict::Effect);
    let first = &found.effects[0];
    assert!(first.asserted && first.id == "rudder_linear", "{} {:?}", first.id, first.refused);
    let yaw = first.parameters.iter().find(|p| p.name.ends_with("Cndr")).unwrap();
    // 10 % is a few of its standard deviations
    assert!((yaw.value / -0.069 - 1.0).abs() < 0.1, "{}", yaw.value);
}

#[test]
fn a_propeller_in_place_of_a_linear_thrust_is_named() {
    let found = asked(&changed(|text| {
        let linear =
            "\n[effects.thrust_linear]\nCp_n = { value = 30.0, source = \"half throttle\" }\n";
        without(&without(&text, "thrust_table"), "thrust_table.T_n") + linear
    }));
    assert_eq!(found.verdict, Verdict::Effect);
    let first = &found.effects[0];
    let of_thrust = ["thrust_decay", "throttle_curve"].contains(&first.id.as_str());
    assert!(first.asserted && of_thrust, "{} {:?}", first.id, first.refused);
}
