//! `greylag aircraft import`: an aircraft of another program as airframe and model.

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
    /// From stability derivatives as AVL writes them (ST, SB), with textbook estimates for the rest.
    Avl(super::import_avl::Avl),
    /// From a JSBSim aircraft, by central differences of its loads.
    #[cfg(feature = "demo")]
    Jsbsim(super::import_jsbsim::Jsbsim),
}

/// Imports, writes, says what is left out.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    match &arguments.from {
        From::Avl(avl) => super::import_avl::run(avl),
        #[cfg(feature = "demo")]
        From::Jsbsim(jsbsim) => super::import_jsbsim::run(jsbsim),
    }
}
