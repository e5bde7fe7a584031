//! `greylag aircraft import derivatives`: makes an airframe file and a model file from the stability derivatives that an
//! aerodynamic tool computed.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use clap::{Args, ValueEnum};

use super::new::{self, Common};
use crate::commands::status;
use crate::model::derivatives::{self, Beside};

/// Unit of deflection of the control derivatives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Angle {
    /// One degree of deflection, as in AVL for a control with a gain of one.
    Deg,
    /// One radian of deflection.
    Rad,
}

/// The arguments of `greylag aircraft import derivatives`.
#[derive(Args)]
pub struct Derivatives {
    /// Output of the AVL command ST or SB; or an XFLR5 log with Sref, Cref and Bref added; or JSON with the values that
    /// OptVL or AeroSandbox return in Python.
    file: PathBuf,
    /// Folder for the new airframe.toml and model.toml.
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
    #[command(flatten)]
    common: Common,
    /// Unit of length of the file, in metres: 0.3048 for feet.
    #[arg(long, value_name = "M", default_value_t = 1.0)]
    unit_m: f64,
    /// Unit of deflection of the control derivatives. Those of XFLR5 are always per radian.
    #[arg(long, value_enum, default_value = "deg")]
    control_unit: Angle,
}

/// Imports the derivatives and lists missing and implausible values. The exit status is 3 if a value is implausible.
pub fn run(arguments: &Derivatives) -> Result<ExitCode> {
    let Derivatives { file, out, common, unit_m, control_unit } = arguments;
    if !(*unit_m > 0.0 && *unit_m < 1e3) {
        bail!("--unit-m {unit_m} is not physical: give the metres in a unit of length");
    }
    let bytes = std::fs::read(file).with_context(|| format!("cannot read {}", file.display()))?;
    let text = String::from_utf8_lossy(&bytes);
    let reference = derivatives::reference(&text);
    let [area, _, span] = reference.with_context(|| format!("{}", file.display()))?;
    let beside = Beside {
        measures: new::measures(common, out, span * unit_m, area * unit_m * unit_m)?,
        metres: *unit_m,
        radians: if *control_unit == Angle::Deg { 1f64.to_radians() } else { 1.0 },
    };
    let read = derivatives::read(&text, &beside).with_context(|| format!("{}", file.display()))?;
    println!("read as {}", read.tool);
    read.notes.iter().for_each(|note| println!("note: {note}"));
    read.warnings.iter().for_each(|warning| println!("warning: {warning}"));
    let written = new::write(out, &read.airframe, &read.model)?;
    Ok(if read.warnings.is_empty() { written } else { ExitCode::from(status::IN_DOUBT) })
}
