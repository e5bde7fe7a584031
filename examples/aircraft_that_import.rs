//! Prints which aircraft of a JSBSim tree import, fly level and are flown by the LQI, with the reason for each that does not.
//!
//! ```text
//! cargo run --release --ignore-rust-version --no-default-features --features sitl \
//!     --example aircraft_that_import -- TREE/aircraft [--no-flights] [NAME…]
//! ```
//!
//! Each is imported at 1000 m, at the airspeed of level flight at a lift coefficient of 0.4, and flown for 20 s from there
//! in its own simulator: straight, then in a bank of 20°, the surfaces moving by a tenth of their travel for 15 s. Beside the error at the end
//! stands the state whose rate the model misses most: rms over the flight in parts of the state's scale x_c a second.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use greylag::control::{ControllerKind, Target, build};
use greylag::model::{GreyBox, Memory, STEP, Trim};
use greylag::physics::atmosphere::{STANDARD_GRAVITY, standard_density};
use greylag::physics::{Command, State};
use greylag::sim::import::import;
use greylag::sim::{Environment, Simulator};
use greylag_sitl::plant::{Plant, PlantOptions, Start};

/// Where the aircraft are imported and flown, m.
const ALTITUDE_M: f64 = 1000.0;
/// Lift coefficient there.
const LIFT: f64 = 0.4;
/// Length of a flight, steps of 0.01 s.
const STEPS: usize = 2000;
/// Steps with moving surfaces.
const MOVED: usize = 1500;
/// Names of the states.
const STATES: [&str; 8] = ["roll", "pitch", "airspeed", "p", "q", "r", "alpha", "beta"];
/// Attitude error at its end that counts as flown, degrees.
const ENOUGH_DEG: f64 = 2.0;

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let folder = PathBuf::from(arguments.next().context("give the folder of the aircraft")?);
    let (options, mut names): (Vec<String>, Vec<String>) =
        arguments.partition(|argument| argument.starts_with("--"));
    let flights = match options.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [] => true,
        ["--no-flights"] => false,
        _ => bail!("the only option is --no-flights"),
    };
    if names.is_empty() {
        names = std::fs::read_dir(&folder)?
            .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
            .filter(|name| folder.join(name).join(format!("{name}.xml")).is_file())
            .collect();
        names.sort();
    }
    let (mut imported, mut flown) = (0, 0);
    for name in &names {
        match taken(&folder, name) {
            Ok((model, plant, left_out)) => {
                imported += 1;
                let flight =
                    if flights { fly(&model, &plant) } else { Ok("not asked to fly".into()) };
                flown += usize::from(flights && flight.is_ok());
                let flight = flight.unwrap_or_else(|why| format!("not flown: {why}"));
                println!("{name:18} imported at {:.0} m/s; {flight}", plant.start.airspeed_mps);
                left_out.iter().for_each(|what| println!("{:18}   left out: {what}", ""));
            }
            Err(why) => println!("{name:18} no: {why}"),
        }
    }
    println!("{imported} of {} import, {flown} are flown by the LQI", names.len());
    Ok(())
}

/// The imported model, its aircraft, and what the model does not hold.
fn taken(folder: &Path, name: &str) -> Result<(GreyBox, PlantOptions, Vec<String>)> {
    let mut options = PlantOptions {
        aircraft_dir: Some(folder.to_owned()),
        aircraft: name.to_owned(),
        ..PlantOptions::default()
    };
    let mut plant = Plant::new(&options)?;
    let mass = plant.mass_properties()?.mass_kg;
    let area = plant.property("metrics/Sw-sqft")? * 0.3048 * 0.3048;
    let pressure = mass * STANDARD_GRAVITY / (LIFT * area);
    let airspeed_mps = (2.0 * pressure / standard_density(ALTITUDE_M)).sqrt();
    options.start = Start { airspeed_mps, altitude_m: ALTITUDE_M, ..Start::NEUTRAL };
    let found = import(&mut plant, name, airspeed_mps, ALTITUDE_M)?;
    let copy = tempfile::tempdir()?;
    std::fs::write(copy.path().join("airframe.toml"), &found.airframe)?;
    std::fs::write(copy.path().join("model.toml"), &found.model)?;
    let model = GreyBox::load(&copy.path().join("model.toml"))?;
    Ok((model, options, found.left_out))
}

/// Flies straight, then banked by 20° while the surfaces are moved; what happened in words.
fn fly(model: &GreyBox, plant: &PlantOptions) -> Result<String> {
    let airspeed = plant.start.airspeed_mps;
    let trim = Trim::straight(model, airspeed, ALTITUDE_M)?;
    let mut lqi = build(ControllerKind::Lqi, model)?;
    let State { alpha, pitch, .. } = trim.state;
    let start = Start { alpha_rad: alpha, pitch_rad: pitch, ..plant.start };
    let mut simulator = Simulator::new(&PlantOptions { start, ..plant.clone() })?;
    let mut seen = simulator.reset()?;
    lqi.reset(1);
    let mut target = Target { roll: 0.0, pitch, airspeed };
    let (mut memory, mut apart) = (Memory::default(), [0.0; 8]);
    let mut inputs = model.at_rest(&seen.actuators.controls());
    for step in 0..STEPS {
        target.roll = if step < STEPS / 2 { 0.0 } else { 20f64.to_radians() };
        let own = lqi.command(&seen, &target);
        // the surfaces move for as long as the attitude is not judged
        let size = if step < MOVED { 0.1 } else { 0.0 };
        let wave = |frequency: f64| size * (frequency * step as f64).sin();
        let command = Command {
            aileron: own.aileron + wave(0.11),
            elevator: own.elevator + wave(0.13),
            throttle: own.throttle + wave(0.05),
            rudder: own.rudder + wave(0.07),
        };
        let controls = seen.actuators.controls();
        let acting = model.act(&controls, &mut inputs);
        let expected = model.step(&seen.state, &acting, seen.altitude, &mut memory);
        seen = simulator.step(command.clamped())?;
        let pairs = seen.state.to_array().into_iter().zip(expected.to_array());
        for ((sum, (flown, own)), scale) in apart.iter_mut().zip(pairs).zip(model.scale()) {
            *sum += ((flown - own) / STEP / scale).powi(2) / STEPS as f64;
        }
    }
    let error = (seen.state.roll - target.roll).abs().max((seen.state.pitch - target.pitch).abs());
    let degrees = error.to_degrees();
    let rms = apart.map(f64::sqrt);
    let worst = (0..8).max_by(|a, b| rms[*a].total_cmp(&rms[*b])).unwrap_or(0);
    let rates = format!("rates {:.2} % of x_c a second ({})", 100.0 * rms[worst], STATES[worst]);
    if degrees.is_nan() || degrees >= ENOUGH_DEG {
        bail!("{degrees:.1} deg from its target after 20 s; {rates}");
    }
    Ok(format!("{degrees:.3} deg from 20 deg of bank after 20 s; {rates}"))
}
