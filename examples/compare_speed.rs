//! How long a comparison of a ten-minute log takes, with its memory: `cargo run --release --example compare_speed`.

#[path = "../tests/compare_support/mod.rs"]
mod compare_support;

use std::time::Instant;

use compare_support::{REALISTIC, fly, model};
use greylag::sysid::compare::{Options, compare};
use greylag::sysid::reconstruct::{self, reconstruct};

fn main() {
    let flight = fly(1, 600.0, REALISTIC);
    println!("{} samples; {} MB resident before", flight.samples.len(), resident_mb());
    let start = Instant::now();
    let prior = model("prior-as-printed");
    let options = reconstruct::Options::new("ten minutes", prior.airframe.actuators);
    let flight = reconstruct(&flight, &options).expect("a flight");
    println!("reconstructed in {:.2} s", start.elapsed().as_secs_f64());
    let start = Instant::now();
    let found = compare(&[prior, model("jsbsim")], &[flight], &Options::default(), &|_| ());
    let found = found.expect("a comparison");
    println!("two models compared in {:.2} s", start.elapsed().as_secs_f64());
    let json = serde_json::to_string(&found.document()).expect("numbers");
    println!("JSON of {} kB; peak {} MB", json.len() / 1000, peak_mb());
}

/// A line of `/proc/self/status`, in MB; 0 where there is none.
fn status_mb(key: &str) -> u64 {
    let text = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = text.lines().find(|l| l.starts_with(key)).unwrap_or_default();
    line.split_whitespace().nth(1).and_then(|kb| kb.parse::<u64>().ok()).unwrap_or(0) / 1000
}

fn resident_mb() -> u64 {
    status_mb("VmRSS:")
}

fn peak_mb() -> u64 {
    status_mb("VmHWM:")
}
