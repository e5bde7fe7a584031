//! Hostile files: logs of all formats mutated by the thousand.

mod logs_support;

use std::path::Path;

use greylag::logs::csv::Tolerance;
use greylag::logs::{Options, parse};
use logs_support::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Reads `inputs` mutated files, returns how many were read as a log all the same.
fn mutate(inputs: usize, seed: u64) -> usize {
    let truth = samples(4);
    let whole = [csv(&truth), ulog(&truth), dataflash(&truth), tlog(&truth)];
    let options = Options { tolerance: Tolerance::Lenient, ..Options::default() };
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut read = 0;
    for i in 0..inputs {
        let mut bytes = whole[i % 4].clone();
        for _ in 0..rng.random_range(1..6u32) {
            let at = rng.random_range(0..bytes.len());
            match rng.random_range(0..5u32) {
                0 => bytes.truncate(at.max(1)),
                1 => drop(bytes.remove(at)),
                2 => bytes.insert(at, rng.random()),
                3 => {
                    // A declaration copied to where it does not belong.
                    let end = (at + rng.random_range(1..90usize)).min(bytes.len());
                    let piece = bytes[at..end].to_vec();
                    let to = rng.random_range(0..bytes.len());
                    bytes.splice(to..to, piece);
                }
                _ => {
                    bytes[at] = [rng.random(), 0, 1, 0x7F, 0x80, 0xFF][rng.random_range(0..6usize)]
                }
            }
            if bytes.len() < 2 {
                break;
            }
        }
        if let Ok(log) = parse(&bytes, Path::new("mutated"), &options) {
            // Nothing is invented: no more rows than the bytes could hold.
            assert!(log.flight.samples.len() <= bytes.len() / 16);
            read += 1;
        }
    }
    read
}

#[test]
fn mutated_logs_cause_no_panic() {
    let read = mutate(100_000, 1);
    // Most mutations leave a readable log: the readers are really reached.
    assert!(read > 30_000, "{read}");
}

/// Recorded: see the printed line; run with `--release -- --ignored --nocapture`.
#[test]
#[ignore = "takes four minutes; the test above does a tenth of it"]
fn a_million_mutated_logs_cause_no_panic() {
    let before = std::time::Instant::now();
    let read = mutate(1_000_000, 2);
    println!("1000000 inputs, {read} read as logs, {:.0} s", before.elapsed().as_secs_f64());
}
