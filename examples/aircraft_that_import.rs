//! Imports the aircraft of a JSBSim folder and flies each with an LQI designed from its imported model. Prints which aircraft
//! can be imported and flown, and the reason for each that cannot.
//!
//! ```text
//! cargo run --release --ignore-rust-version --no-default-features --features sitl \
//!     --example aircraft_that_import -- TREE/aircraft [--no-flights] [NAME…]
//! ```
//!
//! Each aircraft is imported at an altitude of 1000 m and at the airspeed of level flight with a lift coefficient of 0.4. It is
//! then flown in JSBSim for 20 s: first straight, then with a bank of 20°. Sines of a tenth of full command are added for the
//! first 15 s. The program prints the attitude error at the end. It also prints the state whose rate the model predicts
//! worst, with the rms error of this rate as a percentage of the state's scale x_c per second.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use greylag::control::Target;
use greylag::model::{GreyBox, Trim};
use greylag::physics::atmosphere::{STANDARD_GRAVITY, standard_density};
use greylag::physics::{Command, State};
use greylag::sim::Simulator;
use greylag::sim::import::import;
use greylag::sim::one_step::{Flight, errors};
use greylag_sitl::plant::discovery::steered;
use greylag_sitl::plant::{PlantOptions, Start};

/// Altitude at which the aircraft are imported and flown, m.
const ALTITUDE_M: f64 = 1000.0;
/// Lift coefficient in the flight.
const LIFT: f64 = 0.4;
/// A flight of 20 s. Sines are added to the commands for the first 15 s, and the attitude error is taken at the end.
const FLIGHT: Flight = Flight {
    steps: 2000,
    moved: 1500,
    amplitude: Command { aileron: 0.1, elevator: 0.1, throttle: 0.1, rudder: 0.1 },
};
/// Names of the states.
const STATES: [&str; 8] = ["roll", "pitch", "airspeed", "p", "q", "r", "alpha", "beta"];
/// An aircraft counts as flown if its attitude error at the end is below this value, degrees.
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

/// Imports an aircraft. Returns the model, the options of its simulator, and the effects that the model does not represent.
fn taken(folder: &Path, name: &str) -> Result<(GreyBox, PlantOptions, Vec<String>)> {
    let mut options = PlantOptions {
        aircraft_dir: Some(folder.to_owned()),
        aircraft: name.to_owned(),
        ..PlantOptions::default()
    };
    let (mut plant, found) = steered(&options)?;
    if let Some(found) = found {
        options.properties = found.properties;
    }
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

/// Flies straight, then with a bank of 20°. Returns the attitude error and the worst rate error as text.
///
/// # Errors
/// If the aircraft cannot be trimmed or simulated, or if the attitude error at the end is too large.
fn fly(model: &GreyBox, plant: &PlantOptions) -> Result<String> {
    let airspeed = plant.start.airspeed_mps;
    let trim = Trim::straight(model, airspeed, ALTITUDE_M)?;
    let State { alpha, pitch, .. } = trim.state;
    let start = Start { alpha_rad: alpha, pitch_rad: pitch, ..plant.start };
    let mut simulator = Simulator::new(&PlantOptions { start, ..plant.clone() })?;
    let bank = 20f64.to_radians();
    let target = |step| {
        let roll = if step < FLIGHT.steps / 2 { 0.0 } else { bank };
        Target { roll, pitch, airspeed }
    };
    let found = errors(model, &mut simulator, &FLIGHT, target)?;
    let last = found.last.state;
    let error = (last.roll - bank).abs().max((last.pitch - pitch).abs());
    let degrees = error.to_degrees();
    let (worst, rms) = found.worst();
    let rates = format!("rates {:.2} % of x_c a second ({})", 100.0 * rms, STATES[worst]);
    if degrees.is_nan() || degrees >= ENOUGH_DEG {
        bail!("{degrees:.1} deg from its target after 20 s; {rates}");
    }
    Ok(format!("{degrees:.3} deg from 20 deg of bank after 20 s; {rates}"))
}
