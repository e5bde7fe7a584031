//! `greylag aircraft new`: estimates an airframe and an initial model from mass and dimensions.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use clap::ValueEnum;

use crate::commands::files::{self, Overwrite};
use crate::control::aircraft_check;
use crate::logs::quoted;
use crate::model::GreyBox;
use crate::model::plausible::Size;
use crate::model::textbook::{Measures, Tail};
use crate::physics::atmosphere::STANDARD_GRAVITY;

/// The upper airspeed limit is reduced only if it stays above this multiple of the cruise airspeed.
const LEAST_ABOVE_CRUISE: f64 = 1.1;
/// Default static thrust, as a fraction of the weight.
const THRUST: f64 = 0.5;
/// Default pitch speed of the propeller, as a multiple of the airspeed of level flight at a lift coefficient of 0.6.
const PITCH_SPEED: f64 = 2.0;

/// Tail configuration of the aircraft.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum TailName {
    /// A tailplane and a fin.
    Conventional,
    /// Elevons on a wing without a tail.
    FlyingWing,
}

/// Options of `greylag aircraft new`.
#[derive(clap::Args)]
pub struct Arguments {
    /// Folder for airframe.toml and model.toml; created if it does not exist.
    folder: PathBuf,
    /// Wing span.
    #[arg(long, value_name = "M")]
    span_m: f64,
    /// Wing area, the reference area of the coefficients.
    #[arg(long, value_name = "M2")]
    area_m2: f64,
    #[command(flatten)]
    common: Common,
}

/// Options that all commands which write a new aircraft have in common.
#[derive(clap::Args)]
pub struct Common {
    /// The aircraft's name [default: the folder's].
    #[arg(long)]
    name: Option<String>,
    /// Mass of the aircraft as flown.
    #[arg(long, value_name = "KG")]
    mass_kg: f64,
    /// Tail configuration of the aircraft.
    #[arg(long, value_enum, default_value = "conventional")]
    tail: TailName,
    /// The aircraft has no rudder; a flying wing has none anyway.
    #[arg(long)]
    no_rudder: bool,
    /// Deflection of the surfaces at full command, to both sides.
    #[arg(long, value_name = "DEG", default_value_t = 25.0)]
    travel_deg: f64,
    /// Static thrust at full throttle [default: half the weight].
    #[arg(long, value_name = "N")]
    static_thrust_n: Option<f64>,
    /// Airspeed at which full throttle gives no thrust: the propeller's pitch times its speed
    /// [default: twice the airspeed of level flight at a lift coefficient of 0.6].
    #[arg(long, value_name = "MPS")]
    pitch_speed_mps: Option<f64>,
}

/// Writes airframe and model file, then prints the flight characteristics that the model predicts.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    let measures =
        measures(&arguments.common, &arguments.folder, arguments.span_m, arguments.area_m2)?;
    write(&arguments.folder, &measures.airframe(), &measures.model())
}

/// Writes the texts of airframe and model file into `folder`, then prints the flight characteristics that the model
/// predicts. The exit status is 3 if something needs correction.
pub fn write(folder: &Path, airframe: &str, model_text: &str) -> Result<ExitCode> {
    let model = files(folder, airframe, model_text)?;
    println!("wrote {} and airframe.toml beside it", model.display());
    let found = aircraft_check::check(&GreyBox::load(&model)?)?;
    super::check::print(&found);
    println!(
        "next: fly it and fit {} to the logs of its flights, by `greylag amend` with --tune-only and a new folder",
        quoted(&model)
    );
    Ok(super::check::status(&found))
}

/// Returns the text of the airframe file. Its upper airspeed limit is reduced to the fastest level flight of the model.
/// The limit is kept if the reduced one would be at most 1.1 times the cruise airspeed.
fn flown_level(airframe: &str, model_text: &str) -> Result<String> {
    let scratch = tempfile::tempdir().context("cannot make a temporary folder")?;
    let path = scratch.path().join("model.toml");
    std::fs::write(scratch.path().join("airframe.toml"), airframe)?;
    std::fs::write(&path, model_text)?;
    let model = GreyBox::load(&path)?;
    let envelope = model.airframe.envelope;
    let Some(fastest) = aircraft_check::fastest_level(&model) else { return Ok(airframe.into()) };
    let end = (10.0 * fastest).floor() / 10.0;
    let leaves_room = end > LEAST_ABOVE_CRUISE * envelope.airspeed_cruise_mps;
    let line = |v: f64| format!("airspeed_max_mps = {v:.1}\n");
    Ok(if leaves_room {
        airframe.replace(&line(envelope.airspeed_max_mps), &line(end))
    } else {
        airframe.into()
    })
}

/// Writes airframe and model file into `folder`. Returns the path of the model file.
pub fn files(folder: &Path, airframe: &str, model_text: &str) -> Result<PathBuf> {
    let airframe = flown_level(airframe, model_text)?;
    std::fs::create_dir_all(folder)
        .with_context(|| format!("cannot make the folder {}", folder.display()))?;
    let model = folder.join("model.toml");
    if model.exists() {
        bail!("{} exists; name another folder", model.display());
    }
    files::write(&folder.join("airframe.toml"), &airframe, Overwrite::New)?;
    files::write(&model, model_text, Overwrite::New)?;
    Ok(model)
}

/// As [`files`], but a file that already has the same content is no error: an interrupted run of the same command has left it.
pub fn files_again(folder: &Path, airframe: &str, model_text: &str) -> Result<PathBuf> {
    let airframe = flown_level(airframe, model_text)?;
    std::fs::create_dir_all(folder)
        .with_context(|| format!("cannot make the folder {}", folder.display()))?;
    for (name, text) in [("airframe.toml", airframe.as_str()), ("model.toml", model_text)] {
        let path = folder.join(name);
        match std::fs::read_to_string(&path) {
            Ok(there) if there == text => {}
            _ if path.exists() => {
                bail!("{} exists with other content; name another folder", path.display())
            }
            _ => files::write(&path, text, Overwrite::New)?,
        }
    }
    Ok(folder.join("model.toml"))
}

/// Checks the mass and dimensions that the user gives, and adds the defaults.
pub fn measures(arguments: &Common, folder: &Path, span_m: f64, area_m2: f64) -> Result<Measures> {
    let Common { mass_kg, travel_deg, .. } = *arguments;
    let thrust = arguments.static_thrust_n.map(|n| ("--static-thrust-n", n, 1e6));
    let pitch = arguments.pitch_speed_mps.map(|v| ("--pitch-speed-mps", v, 1000.0));
    let given = [
        ("--mass-kg", mass_kg, 1e5),
        ("--span-m", span_m, 100.0),
        ("--area-m2", area_m2, 1000.0),
        ("--travel-deg", travel_deg, 90.0),
    ];
    for (name, value, most) in given.into_iter().chain(thrust).chain(pitch) {
        if !(value > 0.0 && value <= most) {
            bail!("{name} = {value} is not physical: give a number above 0 and at most {most}");
        }
    }
    let size = Size { mass: mass_kg, span: span_m, area: area_m2 };
    if let Some(doubt) = size.doubt() {
        bail!("{doubt}");
    }
    let own = folder.file_name().map(|name| name.to_string_lossy().into_owned());
    let Some(name) = arguments.name.clone().or(own) else {
        bail!("{} names no folder: give --name", folder.display());
    };
    let weight = mass_kg * STANDARD_GRAVITY;
    let travel = travel_deg.to_radians();
    let wing = arguments.tail == TailName::FlyingWing;
    let static_thrust = arguments.static_thrust_n.unwrap_or(THRUST * weight);
    let pitch_speed = arguments.pitch_speed_mps.unwrap_or(PITCH_SPEED * size.level_mps());
    if let Some(doubt) = size.doubt_of_thrust(static_thrust, pitch_speed) {
        bail!("{doubt}");
    }
    Ok(Measures {
        name,
        mass: mass_kg,
        span: span_m,
        area: area_m2,
        tail: if wing { Tail::FlyingWing } else { Tail::Conventional },
        rudder: (!wing && !arguments.no_rudder).then_some(travel),
        travel,
        static_thrust,
        pitch_speed,
    })
}
