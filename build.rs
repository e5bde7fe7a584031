//! Build script: passes the git commit of the sources to the compiler, for the program's version and its records.

use std::path::Path;
use std::process::Command;

/// Output of `git`; `None` if git cannot be run or reports an error.
fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

fn main() {
    // an edit makes the working tree dirty, a commit makes it clean: run the script again after either
    let log = git(&["rev-parse", "--git-path", "logs/HEAD"]).unwrap_or_default();
    for path in ["build.rs", "src", "sitl/src", "Cargo.toml", "Cargo.lock", &log] {
        if Path::new(path).exists() {
            println!("cargo:rerun-if-changed={path}");
        }
    }
    println!("cargo:rerun-if-env-changed=GREYLAG_COMMIT");
    let given = std::env::var("GREYLAG_COMMIT").ok();
    // sources unpacked inside another repository must not take that repository's commit
    let here = || git(&["ls-files", "--error-unmatch", "build.rs"]);
    let described = || git(&["describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"]);
    if let Some(commit) = given.or_else(|| here().and_then(|_| described())) {
        println!("cargo:rustc-env=GREYLAG_COMMIT={commit}");
    }
}
