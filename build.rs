//! Gives the program the commit that it is built from, which its version and its records name.

use std::path::Path;
use std::process::Command;

/// The output of git, or `None` where there is no git or no repository.
fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

fn main() {
    // an edit makes the tree differ from its commit, and a commit makes them equal again
    let log = git(&["rev-parse", "--git-path", "logs/HEAD"]).unwrap_or_default();
    for path in ["build.rs", "src", "sitl/src", "Cargo.toml", "Cargo.lock", &log] {
        if Path::new(path).exists() {
            println!("cargo:rerun-if-changed={path}");
        }
    }
    println!("cargo:rerun-if-env-changed=GREYLAG_COMMIT");
    let given = std::env::var("GREYLAG_COMMIT").ok();
    // only this repository's: sources unpacked inside another one have no commit of their own
    let here = || git(&["ls-files", "--error-unmatch", "build.rs"]);
    let described = || git(&["describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"]);
    if let Some(commit) = given.or_else(|| here().and_then(|_| described())) {
        println!("cargo:rustc-env=GREYLAG_COMMIT={commit}");
    }
}
