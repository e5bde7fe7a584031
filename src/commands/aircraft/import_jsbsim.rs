//! `greylag aircraft import jsbsim`: makes an airframe file and a model file from a JSBSim aircraft.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use clap::Args;
use greylag_sitl::plant::discovery::steered;
use greylag_sitl::plant::{PlantOptions, Start};
use greylag_sitl::plant_arguments::{held, property};

use crate::commands::files::{self, Overwrite};
use crate::control::aircraft_check;
use crate::model::GreyBox;
use crate::sim::import::{Imported, import};

/// Cruise airspeeds from this value on are refused, m/s.
const FASTEST_MPS: f64 = 1000.0;

/// The arguments of `greylag aircraft import jsbsim`.
#[derive(Args)]
pub struct Jsbsim {
    /// Folder that holds NAME/NAME.xml.
    dir: PathBuf,
    /// Name of the aircraft; its file must be NAME/NAME.xml.
    name: String,
    /// Folder to make, with airframe.toml and model.toml.
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
    /// True airspeed at which the stability and control derivatives are computed.
    #[arg(long, value_name = "MPS")]
    cruise_mps: f64,
    /// Altitude above mean sea level at which the stability and control derivatives are computed.
    #[arg(long, value_name = "M", default_value_t = 600.0)]
    altitude_m: f64,
    /// JSBSim property NAME that takes the command KEY or gives the deflection KEY (may be repeated), as for
    /// `greylag evaluate`. Without this option, properties with unusual names are found by trial. NAME may be
    /// -NAME*SCALE,NAME,….
    #[arg(long, value_name = "KEY=NAME", value_parser = property)]
    property: Vec<(String, String)>,
    /// Hold a property at a value (may be repeated), for example flaps. The value is stored in the airframe file.
    #[arg(long, value_name = "NAME=VALUE", value_parser = held)]
    set: Vec<(String, f64)>,
}

/// Imports the aircraft, writes its files, and lists what the files do not represent. Then prints trim, modes, control
/// authority and stability margins of the imported aircraft.
pub fn run(jsbsim: &Jsbsim) -> Result<ExitCode> {
    let (cruise, altitude) = (jsbsim.cruise_mps, jsbsim.altitude_m);
    if !(cruise > 0.0 && cruise < FASTEST_MPS && altitude.is_finite()) {
        bail!(
            "--cruise-mps {cruise} and --altitude-m {altitude}: give an airspeed above 0 and below {FASTEST_MPS} m/s, \
             and a finite altitude"
        );
    }
    let mut options = PlantOptions {
        aircraft_dir: Some(jsbsim.dir.clone()),
        aircraft: jsbsim.name.clone(),
        held: jsbsim.set.clone(),
        start: Start { airspeed_mps: cruise, ..Start::NEUTRAL },
        ..PlantOptions::default()
    };
    for (key, name) in &jsbsim.property {
        if let Some(place) = options.properties.name_mut(key) {
            place.clone_from(name);
        }
    }
    let out = &jsbsim.out;
    let model = out.join("model.toml");
    if model.exists() {
        bail!("{} exists; name another folder with --out", model.display());
    }
    let (mut plant, steering) = steered(&options)?;
    if let Some(steering) = &steering {
        println!("found by trying: {}", steering.arguments().join(" "));
        println!("give these to `greylag evaluate` and `greylag-sitl`, which fly it");
        steering.notes.iter().for_each(|note| println!("note: {note}"));
    }
    let mut found = import(&mut plant, &jsbsim.name, cruise, altitude)?;
    found.hold(&jsbsim.set);
    let read = read_back(&found)?;
    std::fs::create_dir_all(out)
        .with_context(|| format!("cannot make the folder {}", out.display()))?;
    files::write(&out.join("airframe.toml"), &found.airframe, Overwrite::New)?;
    files::write(&model, &found.model, Overwrite::New)?;
    println!("wrote {} and airframe.toml beside it", model.display());
    found.left_out.iter().for_each(|what| println!("left out: {what}"));
    super::check::print(&aircraft_check::check(&read)?);
    Ok(ExitCode::SUCCESS)
}

/// Writes the imported files to a temporary folder and reads the model from there. An import that Greylag cannot read thus
/// fails before anything is written to the user's folder.
fn read_back(found: &Imported) -> Result<GreyBox> {
    let folder = tempfile::tempdir().context("cannot make a temporary folder")?;
    let model = folder.path().join("model.toml");
    std::fs::write(folder.path().join("airframe.toml"), &found.airframe)?;
    std::fs::write(&model, &found.model)?;
    GreyBox::load(&model).context("what was imported is no model that Greylag can read")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cruise_airspeed_is_a_positive_number() {
        for cruise_mps in [f64::NAN, f64::INFINITY, 0.0, -20.0] {
            let jsbsim = Jsbsim {
                dir: "missing".into(),
                name: "x8".into(),
                out: "missing/out".into(),
                cruise_mps,
                altitude_m: 600.0,
                property: Vec::new(),
                set: Vec::new(),
            };
            let error = run(&jsbsim).unwrap_err().to_string();
            assert!(error.contains("--cruise-mps"), "{error}");
        }
    }
}
