//! `greylag aircraft import`: imports an aircraft of another program as airframe and model.

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
    /// From stability derivatives of AVL, XFLR5, OptVL or AeroSandbox, with textbook estimates for the rest.
    #[command(visible_alias = "avl")]
    Derivatives(super::import_derivatives::Derivatives),
    /// From a JSBSim aircraft, by central differences of its loads.
    #[cfg(feature = "demo")]
    Jsbsim(super::import_jsbsim::Jsbsim),
}

/// Imports an aircraft, writes its files and lists the effects that the files do not represent.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    match &arguments.from {
        From::Derivatives(file) => super::import_derivatives::run(file),
        #[cfg(feature = "demo")]
        From::Jsbsim(jsbsim) => super::import_jsbsim::run(jsbsim),
    }
}
