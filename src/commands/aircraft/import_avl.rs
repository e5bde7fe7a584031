//! `greylag aircraft import avl`: stability derivatives of a vortex lattice as airframe and model.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use clap::{Args, ValueEnum};

use super::new::{self, Common};
use crate::model::avl::{self, Beside};

/// The unit of the control derivatives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Angle {
    /// A degree, as AVL has it for a control of gain one.
    Deg,
    /// A radian.
    Rad,
}

/// The arguments of `greylag aircraft import avl`.
#[derive(Args)]
pub struct Avl {
    /// Text that AVL's command ST or SB writes; OptVL, AeroSandbox and XFLR5 write the same names.
    file: PathBuf,
    /// Folder to make, with airframe.toml and model.toml.
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
    #[command(flatten)]
    common: Common,
    /// Metres in the file's unit of length: 0.3048 for feet.
    #[arg(long, value_name = "M", default_value_t = 1.0)]
    unit_m: f64,
    /// Unit of the control derivatives.
    #[arg(long, value_enum, default_value = "deg")]
    control_unit: Angle,
}

/// Reads, writes, says what is not of the file.
pub fn run(arguments: &Avl) -> Result<ExitCode> {
    let Avl { file, out, common, unit_m, control_unit } = arguments;
    if !(*unit_m > 0.0 && *unit_m < 1e3) {
        bail!("--unit-m {unit_m} is not physical: give the metres in a unit of length");
    }
    let bytes = std::fs::read(file).with_context(|| format!("cannot read {}", file.display()))?;
    let text = String::from_utf8_lossy(&bytes);
    let [area, _, span] = avl::reference(&text).with_context(|| format!("{}", file.display()))?;
    let beside = Beside {
        measures: new::measures(common, out, span * unit_m, area * unit_m * unit_m)?,
        metres: *unit_m,
        radians: if *control_unit == Angle::Deg { 1f64.to_radians() } else { 1.0 },
    };
    let read = avl::read(&text, &beside).with_context(|| format!("{}", file.display()))?;
    read.notes.iter().for_each(|note| println!("note: {note}"));
    new::write(out, &read.airframe, &read.model)
}
