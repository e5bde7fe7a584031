//! `greylag aircraft export`: writes a model as an aircraft of another simulator.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use clap::{Args, Subcommand};

use crate::commands::files::{self, Overwrite};
use crate::model::GreyBox;
use crate::model::jsbsim::export_in_conditions;

/// The arguments of `greylag aircraft export`.
#[derive(Args)]
pub struct Arguments {
    #[command(subcommand)]
    to: To,
}

#[derive(Subcommand)]
enum To {
    /// Write a JSBSim aircraft: NAME/NAME.xml and the files of its engine.
    Jsbsim(Jsbsim),
}

/// The arguments of `greylag aircraft export jsbsim`.
#[derive(Args)]
struct Jsbsim {
    /// The model file. Give several for one aircraft in several conditions, such as flap settings:
    /// the aircraft then interpolates between them over the property in which their airframes differ.
    #[arg(long, value_name = "FILE", required = true)]
    model: Vec<PathBuf>,
    /// Folder in which the folder NAME is made.
    dir: PathBuf,
    /// Name of the JSBSim aircraft: letters, digits, `_` and `-`.
    name: String,
}

/// Writes the aircraft's files and lists the properties of the model that the export omits.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    let To::Jsbsim(jsbsim) = &arguments.to;
    let Jsbsim { dir, name, .. } = jsbsim;
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if name.is_empty() || !name.chars().all(plain) {
        bail!("cannot name an aircraft '{name}': use letters, digits, _ and -");
    }
    let load = |path: &PathBuf| GreyBox::load(&files::shipped(path));
    let models = jsbsim.model.iter().map(load).collect::<Result<Vec<_>, _>>()?;
    let exported = export_in_conditions(&models, name)?;
    let folder = dir.join(name);
    let engines = folder.join("Engines");
    std::fs::create_dir_all(&engines)
        .with_context(|| format!("cannot make the folder {}", engines.display()))?;
    for (path, text) in &exported.files {
        files::write(&folder.join(path), text, Overwrite::New)?;
    }
    println!("wrote {}", folder.join(format!("{name}.xml")).display());
    exported.left_out.iter().for_each(|what| println!("left out: {what}"));
    println!("fly it: greylag-sitl --aircraft-dir {} --aircraft {name}", dir.display());
    Ok(ExitCode::SUCCESS)
}
