//! Prints for each aircraft of a JSBSim tree whether it loads and flies for 1 s, or the error that prevents it.
//!
//! `cargo run --release --example aircraft_that_load -p greylag-sitl -- TREE/aircraft`

use std::path::{Path, PathBuf};

use greylag_sitl::plant::{Inputs, Plant, PlantError, PlantOptions, Start};

/// A start that most powered aircraft can fly from: 60 m/s at 1000 m.
const START: Start = Start { airspeed_mps: 60.0, altitude_m: 1000.0, ..Start::NEUTRAL };

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).ok_or("give the folder of the aircraft")?);
    let mut names: Vec<String> = std::fs::read_dir(&folder)?
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter(|name| folder.join(name).join(format!("{name}.xml")).is_file())
        .collect();
    names.sort();
    let mut flying = 0;
    for name in &names {
        match fly(&folder, name) {
            Ok(line) => {
                flying += 1;
                println!("{name:20} {line}");
            }
            Err(error) => println!("{name:20} no: {error}"),
        }
    }
    println!("{flying} of {} aircraft load and fly", names.len());
    Ok(())
}

fn fly(folder: &Path, name: &str) -> Result<String, PlantError> {
    let mut plant = Plant::new(&PlantOptions {
        aircraft_dir: Some(folder.to_owned()),
        aircraft: name.to_owned(),
        ..PlantOptions::default()
    })?;
    let travel = plant.travel();
    plant.reset(&START)?;
    for _ in 0..100 {
        plant.step(Inputs { throttle: 0.7, ..Inputs::default() })?;
    }
    let travel = match travel {
        Ok(t) => {
            format!("travel {:.4}, {:.4} rad", t.aileron.largest_rad(), t.elevator.largest_rad())
        }
        Err(_) => "travel unknown".to_owned(),
    };
    let notes = plant.notes().join("; ");
    Ok(format!("thrust {:9.1} N after 1 s, {travel} {notes}", plant.truth().thrust_n))
}
