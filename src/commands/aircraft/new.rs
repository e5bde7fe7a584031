//! `greylag aircraft new`: an airframe and a prior from a few measures.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use clap::ValueEnum;

use crate::commands::files::{self, Overwrite};
use crate::control::aircraft_check;
use crate::model::GreyBox;
use crate::model::textbook::{Measures, Tail};
use crate::physics::atmosphere::STANDARD_GRAVITY;

/// Static thrust by default, as a share of the weight.
const THRUST: f64 = 0.5;
/// Pitch speed by default, as a multiple of the airspeed of level flight at a lift coefficient of 0.6.
const PITCH_SPEED: f64 = 2.0;

/// What balances the aircraft.
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
    /// Folder to make, with airframe.toml and model.toml.
    folder: PathBuf,
    /// Span.
    #[arg(long, value_name = "M")]
    span_m: f64,
    /// Wing area.
    #[arg(long, value_name = "M2")]
    area_m2: f64,
    #[command(flatten)]
    common: Common,
}

/// What is asked of any aircraft that is not measured.
#[derive(clap::Args)]
pub struct Common {
    /// The aircraft's name [default: the folder's].
    #[arg(long)]
    name: Option<String>,
    /// Mass as flown.
    #[arg(long, value_name = "KG")]
    mass_kg: f64,
    /// What balances it.
    #[arg(long, value_enum, default_value = "conventional")]
    tail: TailName,
    /// The aircraft has no rudder; a flying wing has none anyway.
    #[arg(long)]
    no_rudder: bool,
    /// Deflection of the surfaces at full command, to both sides.
    #[arg(long, value_name = "DEG", default_value_t = 25.0)]
    travel_deg: f64,
    /// Thrust at rest at full throttle [default: half the weight].
    #[arg(long, value_name = "N")]
    static_thrust_n: Option<f64>,
    /// Airspeed at which full throttle gives no thrust: the propeller's pitch times its speed
    /// [default: twice the airspeed of level flight at a lift coefficient of 0.6].
    #[arg(long, value_name = "MPS")]
    pitch_speed_mps: Option<f64>,
}

/// Writes the files, then says what they make of the aircraft.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    let measures =
        measures(&arguments.common, &arguments.folder, arguments.span_m, arguments.area_m2)?;
    write(&arguments.folder, &measures.airframe(), &measures.model())
}

/// Writes both files into `folder`, then says what they make of the aircraft.
pub fn write(folder: &Path, airframe: &str, model_text: &str) -> Result<ExitCode> {
    std::fs::create_dir_all(folder)
        .with_context(|| format!("cannot make the folder {}", folder.display()))?;
    let model = folder.join("model.toml");
    files::writable(&model, Overwrite::Never)?;
    files::write(&folder.join("airframe.toml"), airframe, Overwrite::Never)?;
    files::write(&model, model_text, Overwrite::Never)?;
    println!("wrote {} and airframe.toml beside it", model.display());
    let found = aircraft_check::check(&GreyBox::load(&model)?)?;
    super::check::print(&found);
    println!(
        "fly it, then fit it: greylag amend --model {} --log FLIGHTS --tune-only --out FOLDER",
        model.display()
    );
    Ok(ExitCode::SUCCESS)
}

/// The measures, each checked.
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
    let aspect = span_m * span_m / area_m2;
    if !(2.0..=40.0).contains(&aspect) {
        bail!(
            "the aspect ratio span²/area is {aspect:.1}, that of aircraft with a straight wing 2 to 40: \
             check --span-m and --area-m2"
        );
    }
    let own = folder.file_name().map(|name| name.to_string_lossy().into_owned());
    let Some(name) = arguments.name.clone().or(own) else {
        bail!("{} names no folder: give --name", folder.display());
    };
    let weight = mass_kg * STANDARD_GRAVITY;
    let travel = travel_deg.to_radians();
    let wing = arguments.tail == TailName::FlyingWing;
    let level = (2.0 * weight / (1.225 * area_m2 * 0.6)).sqrt();
    Ok(Measures {
        name,
        mass: mass_kg,
        span: span_m,
        area: area_m2,
        tail: if wing { Tail::FlyingWing } else { Tail::Conventional },
        rudder: (!wing && !arguments.no_rudder).then_some(travel),
        travel,
        static_thrust: arguments.static_thrust_n.unwrap_or(THRUST * weight),
        pitch_speed: arguments.pitch_speed_mps.unwrap_or(PITCH_SPEED * level),
    })
}
