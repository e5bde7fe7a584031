//! Flights of a JSBSim that hides an effect, through spoilt sensors and the reconstruction.
#![allow(dead_code)] // each test file uses its part

pub(crate) use crate::reconstruct_support as sensors;

use greylag::control::{self, ControllerKind, Target};
use greylag::logs::Flight;
use greylag::model::GreyBox;
use greylag::num::stream::stream;
use greylag::sim::{Environment, Simulator};
use greylag::sysid::flight_path::reconstruction::Reconstruction;
use greylag::sysid::flight_path::{ActuatorClock, Options, reconstruct};
use greylag_sitl::hidden::Hidden;
use greylag_sitl::plant::PlantOptions;
use rand::RngExt;
use sensors::{Errors, Flown, STEP};

/// What the flights are flown for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Manoeuvres {
    /// Turns, climbs and speeds with multisines and 3-2-1-1 on every control.
    Usual,
    /// The same, pulled up to the stall now and then.
    Stalls,
}

/// Flies `seconds` with `hidden` (`id=amplitude`) in the aircraft.
pub fn fly(hidden: &str, seconds: f64, manoeuvres: Manoeuvres, seed: u64) -> Flown {
    let hide = if hidden.is_empty() { Vec::new() } else { vec![hidden.parse().unwrap()] };
    fly_hiding(hide, seconds, manoeuvres, seed)
}

/// The same with `hide` in the aircraft.
pub fn fly_hiding(hide: Vec<Hidden>, seconds: f64, manoeuvres: Manoeuvres, seed: u64) -> Flown {
    let options = PlantOptions { hidden: hide, seed: seed as u32 + 1, ..Default::default() };
    let mut simulator = Simulator::new(&options).unwrap();
    let mut lqi = control::build(ControllerKind::Lqi, &sensors::model()).unwrap();
    let mut random = stream(seed, &[21]);
    let phases: [f64; 8] = std::array::from_fn(|_| random.random::<f64>() * std::f64::consts::TAU);
    let mut seen = simulator.reset().unwrap();
    lqi.reset(seed);
    let mut target = Target { roll: 0.0, pitch: 0.05, airspeed: 18.0 };
    let (mut truth, mut commands) = (Vec::new(), Vec::new());
    for k in 0..(seconds / STEP) as usize {
        let mut within = |a: f64, b: f64| a + (b - a) * random.random::<f64>();
        if k % 400 == 399 {
            target = Target {
                roll: within(-0.8, 0.8),
                pitch: within(-0.2, 0.25),
                airspeed: within(14.0, 25.0),
            };
        }
        let mut command = lqi.command(&seen, &target);
        let t = k as f64 * STEP;
        let [aileron, elevator, throttle] = excitation(t, &phases);
        command.aileron += aileron;
        command.elevator += elevator;
        command.throttle += throttle;
        // nearly full elevator for a second every eight, on top of which nothing flies: 0.9 of it moves
        // the trim by 13° of incidence, past the stall at 12°
        if manoeuvres == Manoeuvres::Stalls && t % 8.0 > 6.2 && t % 8.0 < 7.2 {
            command.elevator = -0.9;
        }
        truth.push(simulator.truth());
        commands.push(command.clamped());
        seen = simulator.step(command).unwrap();
    }
    Flown { truth, commands }
}

/// A multisine on every control, with a 3-2-1-1 on aileron and elevator in turn every 5 s.
fn excitation(t: f64, phases: &[f64; 8]) -> [f64; 3] {
    let sine = |i: usize, frequency: f64| (std::f64::consts::TAU * frequency * t + phases[i]).sin();
    let multisine = |i: usize, f: f64| sine(i, f) + sine(i + 1, 1.7 * f) + sine(i + 2, 3.1 * f);
    let into = t % 5.0 - 2.0;
    let level = match into / 0.25 {
        x if !(0.0..7.0).contains(&x) => 0.0,
        x if x < 3.0 || (5.0..6.0).contains(&x) => 0.2,
        _ => -0.2,
    };
    let (a, e) = if ((t / 5.0) as u64).is_multiple_of(2) { (level, 0.0) } else { (0.0, level) };
    [0.05 * multisine(0, 0.4) + a, 0.04 * multisine(3, 0.5) + e, 0.15 * multisine(5, 0.15)]
}

/// Sensors as a small autopilot has them, biases and delays drawn by `seed`.
pub fn errors(seed: u64) -> Errors {
    let mut random = stream(seed, &[22]);
    let mut about = |sd: f64| sd * (2.0 * random.random::<f64>() - 1.0) * 1.7;
    let mut e = Errors {
        gyro_bias: std::array::from_fn(|_| about(0.01)),
        force_bias: std::array::from_fn(|_| about(0.1)),
        airspeed_scale: 1.0 + about(0.01),
        alpha_bias: about(0.01),
        beta_bias: about(0.01),
        skew: [0.0; 7],
        noise: Errors::NOISE,
    };
    e.skew = std::array::from_fn(|_| 0.01 * random.random::<f64>());
    e
}

/// A flight as its log gives it after the reconstruction, deflections as recorded.
pub fn flight(hidden: &str, seconds: f64, manoeuvres: Manoeuvres, seed: u64) -> Reconstruction {
    let flown = fly(hidden, seconds, manoeuvres, seed);
    rebuilt(&sensors::spoil(&flown, &errors(seed), seed), seed)
}

/// A log after the reconstruction, deflections as recorded.
pub fn rebuilt(log: &Flight, seed: u64) -> Reconstruction {
    let options = Options {
        gravity: 9.806,
        actuators_clock: ActuatorClock::AsRecorded,
        ..Options::new(format!("flight{seed}.csv"), sensors::model().airframe.actuators)
    };
    reconstruct(log, &options).unwrap()
}

/// The model that flies as JSBSim does, each coefficient wrong by 15 % one way or the other.
pub fn off(model: &GreyBox, seed: u64) -> GreyBox {
    let mut random = stream(seed, &[23]);
    let mut values: Vec<f64> = model.coefficients().iter().map(|c| c.value).collect();
    for value in &mut values {
        *value *= if random.random::<f64>() < 0.5 { 0.85 } else { 1.15 };
    }
    let mut wrong = model.clone();
    wrong.set_coefficients(&values);
    wrong
}

/// The model without a stall: the slope of the lift table about zero in place of the table.
pub fn without_stall() -> GreyBox {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8");
    let text = std::fs::read_to_string(folder.join("jsbsim.toml")).unwrap();
    let mut file: toml::Table = toml::from_str(&text).unwrap();
    let effects = file["effects"].as_table_mut().unwrap();
    effects.remove("lift_table");
    let linear = effects["lift_linear"].as_table_mut().unwrap();
    for (name, value) in [("CL0", 0.1119), ("CLalpha", 3.9)] {
        linear[name].as_table_mut().unwrap().insert("value".into(), value.into());
    }
    let folder_of = folder.to_str().unwrap();
    file.insert("airframe".into(), format!("{folder_of}/airframe.toml").into());
    let scratch = tempfile::tempdir().unwrap();
    let path = scratch.path().join("linear.toml");
    std::fs::write(&path, toml::to_string(&file).unwrap()).unwrap();
    GreyBox::load(&path).unwrap()
}
