//! `greylag aircraft import`: imports an aircraft from another program and writes its airframe file and model file.

use std::process::ExitCode;

use anyhow::Result;
use clap::{Args, Subcommand};

/// The arguments of `greylag aircraft import`.
#[derive(Args)]
pub struct Arguments {
    #[command(subcommand)]
    from: From,
}

#[derive(Subcommand)]
enum From {
    /// From stability derivatives of AVL, XFLR5, OptVL or AeroSandbox; textbook formulas estimate the rest of the model.
    #[command(visible_alias = "avl")]
    Derivatives(super::import_derivatives::Derivatives),
    /// From a JSBSim aircraft, by central differences of its forces and moments.
    #[cfg(feature = "demo")]
    Jsbsim(super::import_jsbsim::Jsbsim),
}

/// Imports an aircraft, writes its files and prints what the import leaves out or finds implausible.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    match &arguments.from {
        From::Derivatives(file) => super::import_derivatives::run(file),
        #[cfg(feature = "demo")]
        From::Jsbsim(jsbsim) => super::import_jsbsim::run(jsbsim),
    }
}
