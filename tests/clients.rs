//! Flights with the clients that people have: pymavlink, MAVSDK, MAVProxy, each by a script.
//!
//! The scripts lie in `tests/clients/`. They run in a Python environment of their own below the
//! target folder, which the first test to need it makes. Without Python or PyPI the tests say so
//! and pass; with `GREYLAG_REQUIRE_CLIENTS=1` they fail instead.

#[path = "support/real_time.rs"]
mod real_time;

use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

/// The folder of the scripts.
const SCRIPTS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/clients");
const GREYLAG: &str = env!("CARGO_BIN_EXE_greylag");

/// The folder that holds the program, target/PROFILE.
fn profile_folder() -> &'static Path {
    Path::new(GREYLAG).parent().unwrap()
}

/// Runs a command; what it said if it fails or cannot be started.
fn done(command: &mut Command) -> Result<(), String> {
    let told = format!("{command:?}");
    match command.output() {
        Err(error) => Err(format!("{told}: {error}")),
        Ok(output) if output.status.success() => Ok(()),
        Ok(output) => Err(format!("{told}: {}", String::from_utf8_lossy(&output.stderr).trim())),
    }
}

/// A Python environment: its folder below target/, what is installed into it, its Python once it is there.
struct Environment {
    folder: &'static str,
    requirements: &'static str,
    python: OnceLock<Result<PathBuf, String>>,
}

static CLIENTS: Environment = Environment {
    folder: "clients-venv",
    requirements: "requirements.txt",
    python: OnceLock::new(),
};
/// MAVSDK 3 has the name of MAVSDK 4.
static MAVSDK_3: Environment = Environment {
    folder: "clients-mavsdk3-venv",
    requirements: "requirements-mavsdk3.txt",
    python: OnceLock::new(),
};

impl Environment {
    /// Its Python, or why there is none. Threads of this test wait for one another; another test
    /// program that makes the same environment is waited for at a file lock.
    fn python(&self) -> &Result<PathBuf, String> {
        self.python.get_or_init(|| {
            let folder = profile_folder().parent().unwrap().join(self.folder);
            let lock = File::create(folder.with_extension("lock")).map_err(|e| e.to_string())?;
            lock.lock().map_err(|e| e.to_string())?;
            environment(&folder, self.requirements)
        })
    }
}

/// Makes the environment unless it is there with the same requirements.
fn environment(folder: &Path, requirements: &str) -> Result<PathBuf, String> {
    let requirements = Path::new(SCRIPTS).join(requirements);
    let wanted = fs::read_to_string(&requirements).unwrap();
    // Written last, so that what was begun and not finished is begun again.
    let installed = folder.join("installed.txt");
    let python = folder.join("bin/python");
    if fs::read_to_string(&installed).is_ok_and(|found| found == wanted) {
        return Ok(python);
    }
    done(Command::new("python3").args(["-m", "venv", "--clear"]).arg(folder))?;
    let pip = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-deps"];
    let packages = done(Command::new(&python).args(pip).arg("--requirement").arg(requirements));
    if let Err(reason) = packages {
        // No network is a reason to skip; a list that cannot be installed is not.
        let reached = done(Command::new(&python).args(["-m", "pip", "index", "versions", "pip"]));
        assert!(reached.is_err(), "PyPI is there, but {reason}");
        return Err(reason);
    }
    fs::write(installed, wanted).unwrap();
    Ok(python)
}

/// The shim's program. `cargo test --workspace` builds it beside ours; a test of this package
/// alone does not, so it is asked for here: as a test of the whole workspace with the same
/// features, so that nothing is built anew.
fn shim() -> &'static Path {
    static SHIM: OnceLock<PathBuf> = OnceLock::new();
    SHIM.get_or_init(|| {
        let mut cargo = Command::new(env!("CARGO"));
        cargo
            .args(["test", "--no-run", "--quiet", "--ignore-rust-version", "--workspace"])
            .args(["--test", "shim", "--features", "greylag/sitl", "--target-dir"])
            .arg(profile_folder().parent().unwrap())
            .current_dir(env!("CARGO_MANIFEST_DIR"));
        if cfg!(feature = "learn") {
            cargo.args(["--features", "greylag/learn"]);
        }
        if !cfg!(feature = "default") {
            cargo.arg("--no-default-features");
        }
        // The profile of a folder is its name, but for `dev`.
        match profile_folder().file_name().and_then(|name| name.to_str()) {
            Some("debug") => {}
            Some(profile) => drop(cargo.args(["--profile", profile])),
            None => panic!("{GREYLAG} lies in no profile's folder"),
        }
        done(&mut cargo).unwrap();
        profile_folder().join(format!("greylag-sitl{}", std::env::consts::EXE_SUFFIX))
    })
}

/// Flies a script in the clients' environment.
fn fly(script: &str) {
    fly_in(&CLIENTS, script);
}

/// Flies a script.
fn fly_in(environment: &Environment, script: &str) {
    let python = match environment.python() {
        Ok(python) => python,
        Err(reason) if std::env::var_os("GREYLAG_REQUIRE_CLIENTS").is_some_and(|v| v == "1") => {
            panic!("{script} needs python3 with venv, and PyPI: {reason}")
        }
        Err(reason) => {
            // Written past the test harness, which hides what a passing test prints.
            let words =
                format!("\n*** SKIPPED {script}: no Python with its packages: {reason}\n\n");
            std::io::stderr().write_all(words.as_bytes()).unwrap();
            return;
        }
    };
    let shim = shim();
    real_time::in_real_time(script, || flown(python, script, shim));
}

/// Flies a script once, with the Python and the shim given.
fn flown(python: &Path, script: &str, shim: &Path) {
    let folder = tempfile::tempdir().unwrap();
    let Output { status, stdout, stderr } = Command::new(python)
        .arg(Path::new(SCRIPTS).join(script))
        .args(["--greylag", GREYLAG, "--sitl"])
        .arg(shim)
        // No __pycache__ among the sources.
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .current_dir(folder.path())
        .output()
        .unwrap();
    println!("{}", String::from_utf8_lossy(&stdout));
    eprintln!("{}", String::from_utf8_lossy(&stderr));
    assert!(status.success(), "{script} failed: its lines are above");
}

#[test]
fn pymavlink_flies_an_attitude() {
    fly("pymavlink_flight.py");
}

#[test]
fn mavsdk_flies_an_attitude() {
    fly("mavsdk_flight.py");
}

#[test]
fn mavproxy_flies_an_attitude_from_its_command_line() {
    fly("mavproxy_flight.py");
}

#[test]
fn qgroundcontrol_connects_to_companion_and_controllers() {
    fly("qgroundcontrol_connect.py");
}

#[test]
fn pymavlink_flies_both_controllers_through_the_companion_beside_them() {
    fly("pymavlink_router.py");
}

#[test]
fn mavsdk_flies_a_controller_and_the_companion_beside_it() {
    fly("mavsdk_router.py");
}

#[test]
fn mavsdk_3_flies_a_controller_and_the_companion_beside_it() {
    fly_in(&MAVSDK_3, "mavsdk3_router.py");
}

#[test]
fn mavproxy_flies_a_controller_through_the_companion() {
    fly("mavproxy_router.py");
}

#[test]
fn misbehaviour_over_real_sockets_neither_ends_the_companion_nor_moves_the_surfaces() {
    fly("pymavlink_trouble.py");
}

#[test]
fn signed_links_serve_who_has_the_key_and_nobody_else() {
    fly("pymavlink_signing.py");
}
