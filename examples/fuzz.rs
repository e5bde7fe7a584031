//! Fuzzing with about a hundred million inputs. The inputs are seeded mutations, which are passed to parsers, message handlers
//! and file loaders.
//!
//! ```text
//! cargo run --release --ignore-rust-version --no-default-features --features sitl --example fuzz -- [SEED [SHARE]]
//! ```
//! SHARE scales the number of inputs; with 1 there are 1.0e8 inputs in total. A target that panics prints the seed of the
//! batch of inputs. `-- SEED 0 TARGET` repeats only this batch.

#[path = "../tests/link/fuzz_support.rs"]
mod fuzz_support;
#[path = "../tests/link/link_support/mod.rs"]
mod link_support;

use std::process::ExitCode;
use std::time::Instant;

use fuzz_support::{Target, feed};

/// Number of inputs of each target at SHARE = 1. Faster targets get more inputs.
const SHARES: [(Target, f64); 7] = [
    (Target::Parser, 88e6),
    (Target::Clients, 6e6),
    (Target::Sitl, 2e6),
    (Target::Real, 1.5e6),
    (Target::Signing, 2e6),
    (Target::Toml, 0.2e6),
    (Target::Safetensors, 0.5e6),
];

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let number = |at: usize, default: f64| words.get(at).map_or(Ok(default), |w| w.parse::<f64>());
    let (Ok(seed), Ok(share)) = (number(0, 1.0), number(1, 1.0)) else {
        eprintln!("write the seed, then the share of 1e8 inputs, both as numbers");
        return ExitCode::FAILURE;
    };
    let seed = seed as u64;
    let alone = match words.get(2).map(|word| word.parse::<Target>()) {
        Some(Err(words)) => {
            eprintln!("{words}");
            return ExitCode::FAILURE;
        }
        Some(Ok(target)) => Some(target),
        None => None,
    };
    let (mut total, mut panics) = (0, 0);
    for (target, inputs) in SHARES.into_iter().filter(|(t, _)| alone.is_none_or(|a| a == *t)) {
        let begun = Instant::now();
        let inputs = if alone.is_some() { 100_000 } else { (inputs * share) as u64 };
        let fed = feed(target, inputs, seed);
        let seconds = begun.elapsed().as_secs_f64();
        println!(
            "{target:>12}: {} inputs from seed {seed}, {} taken, {} panics, {:.2} us each",
            fed.inputs,
            fed.taken,
            fed.panics,
            1e6 * seconds / fed.inputs.max(1) as f64
        );
        (total, panics) = (total + fed.inputs, panics + fed.panics);
    }
    println!("{total} inputs, {panics} panics");
    if panics == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
