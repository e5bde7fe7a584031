//! `greylag link key`: makes a key file for MAVLink message signing.

use std::io;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, ensure};
use clap::Args;

use crate::link::signing::Key;

/// The arguments of `greylag link key`.
#[derive(Args)]
pub struct Make {
    /// File to make for the key: 64 hexadecimal digits, readable by its owner alone.
    file: PathBuf,
    /// Read a passphrase from standard input and use its SHA-256 as the key, as QGroundControl and MAVProxy do [default: a
    /// random key].
    #[arg(long)]
    passphrase: bool,
}

/// Makes a new key file and prints how to use it.
///
/// # Errors
/// If the file exists or cannot be written, or standard input holds no passphrase.
pub fn run(make: &Make) -> Result<ExitCode> {
    let key = if make.passphrase { asked()? } else { random()? };
    key.save(&make.file)?;
    said(&make.file, make.passphrase);
    Ok(ExitCode::SUCCESS)
}

fn random() -> Result<Key> {
    let mut bytes = [0; 32];
    getrandom::fill(&mut bytes)
        .map_err(io::Error::other)
        .context("drawing random bytes from the system")?;
    Ok(Key::from_bytes(bytes))
}

fn asked() -> Result<Key> {
    let mut line = String::new();
    io::stdin().read_line(&mut line).context("reading the passphrase from standard input")?;
    let passphrase = line.trim_end_matches(['\r', '\n']);
    ensure!(
        !passphrase.is_empty(),
        "no passphrase on standard input: type one, or leave --passphrase out"
    );
    Ok(Key::of_passphrase(passphrase))
}

fn said(file: &Path, of_passphrase: bool) {
    let file = file.display();
    println!("key in {file}; fly with it: greylag fly --sign {file}");
    if of_passphrase {
        println!(
            "give the same passphrase to the ground station (MAVProxy: signing key PASSPHRASE)"
        );
    } else {
        println!(
            "give the same 64 digits to the ground station, over a way that nobody else reads"
        );
    }
}
