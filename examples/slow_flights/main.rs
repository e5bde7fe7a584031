//! Whether the 95 % intervals of a fit hold the true coefficients of a slow aircraft under motion capture:
//! `cargo run --release --ignore-rust-version --features sitl --example slow_flights -- [SETS] [--seed FIRST] [--tilt FACTOR]
//! > results/slow-flights.txt`.
//!
//! Each set (40 by default, from seed 1) is an aircraft whose coefficients are drawn from the prior of the A430, with nine
//! flights of 2 s that begin at 5 m/s. The log has what the real one has: position and attitude at 100 Hz with noise, commands,
//! no accelerometer, no airspeed. The measured axes are tilted alike in all flights: standard deviation 5° in pitch, 2° in roll
//! and yaw, times FACTOR (1 by default). The logs are read with the mapping of the A430, and the fits are those of
//! `examples/real_aircraft`. Required are 93 to 97 % inside.
//!
//! The model has the aircraft's effects, mass and inertia, and the prior is that of the draw. Other errors of the model are not
//! part of this measurement.

mod coverage;
mod flights;

use std::time::Instant;

use anyhow::{Context, Result};
use greylag::sysid::amend::{Amended, Options, amend};
use greylag::sysid::per_flight::{PerFlight, SensorErrors};
use greylag::sysid::progress::ignore_progress;

use coverage::Tally;
use flights::{A430, Set};

/// Fits that are judged: name, and prior standard deviation of the misalignment angles of each flight, degrees; `None` for a fit
/// with aligned axes.
const FITS: [(&str, Option<f64>); 3] = [
    ("coefficients alone", None),
    ("coefficients and axes of each flight, prior 3°", Some(3.0)),
    ("coefficients and axes of each flight, prior 5°", Some(5.0)),
];

/// What is asked for on the command line.
struct Asked {
    sets: u64,
    seed: u64,
    tilted: f64,
}

fn main() -> Result<()> {
    let asked = asked(std::env::args().skip(1))?;
    let aircraft = A430::load()?;
    let mut tallies = FITS.map(|_| Tally::default());
    let (mut rejected, mut unread) = (0, 0);
    for k in 0..asked.sets {
        let (seed, begun) = (asked.seed + k, Instant::now());
        match aircraft.set(seed, asked.tilted) {
            Ok(set) => {
                rejected += set.rejected;
                for ((name, askew_deg), tally) in FITS.iter().zip(&mut tallies) {
                    judge(&aircraft, &set, *askew_deg, tally, name);
                }
            }
            Err(why) => {
                eprintln!("seed {seed}: no flights: {why:#}");
                unread += 1;
            }
        }
        let seconds = begun.elapsed().as_secs_f64();
        eprintln!("set {} of {}, seed {seed}: {seconds:.1} s", k + 1, asked.sets);
    }
    println!(
        "Simulated flights of aircraft like the A430, {} sets from seed {}, tilt times {}; {rejected} drawn aircraft did not fly, \
         {unread} sets could not be read",
        asked.sets, asked.seed, asked.tilted
    );
    FITS.iter().zip(&tallies).for_each(|((name, _), tally)| tally.print(name));
    Ok(())
}

/// Reads the command line.
fn asked(mut words: impl Iterator<Item = String>) -> Result<Asked> {
    let mut asked = Asked { sets: 40, seed: 1, tilted: 1.0 };
    while let Some(word) = words.next() {
        let mut value = || words.next().with_context(|| format!("write a number after {word}"));
        match word.as_str() {
            "--seed" => asked.seed = value()?.parse()?,
            "--tilt" => asked.tilted = value()?.parse()?,
            sets => {
                let wrong = || format!("{sets}: write the number of sets, --seed or --tilt");
                asked.sets = sets.parse().with_context(wrong)?;
            }
        }
    }
    Ok(asked)
}

/// Fits the prior model to the flights of `set` and adds the result to `tally`. `name` is the name of the fit.
fn judge(aircraft: &A430, set: &Set, askew_deg: Option<f64>, tally: &mut Tally, name: &str) {
    let per_flight =
        PerFlight { askew_deg, sensors: SensorErrors::Dropped, ..PerFlight::default() };
    let options = Options { per_flight, ..Options::default() };
    match amend(&aircraft.prior, &set.flights, &set.flights, &options, &ignore_progress) {
        Ok(amended) => {
            tally.add(&amended.amendment.parameters, &set.truth);
            if askew_deg.is_some() {
                tally.add_tilt(tilt_error(&amended, set));
            }
        }
        Err(why) => {
            eprintln!("  no fit of {name}: {why}");
            tally.fail();
        }
    }
}

/// Mean over the flights of the estimated misalignment, less the true tilt, about body x, y and z, rad.
fn tilt_error(amended: &Amended, set: &Set) -> [f64; 3] {
    let flights = &amended.amendment.flights;
    let mean = |name: &str| {
        let own = flights.iter().flat_map(|f| &f.own).filter(|own| own.name == name);
        own.map(|own| own.value).sum::<f64>() / flights.len() as f64
    };
    let estimated = ["askew_roll", "askew_pitch", "askew_yaw"].map(mean);
    std::array::from_fn(|axis| estimated[axis] - set.tilt_rad[axis])
}
