//! Reads randomly damaged effect files and prints how many were refused with the place of the fault. The first argument is the
//! number of files (default one million), the second the seed.
//!
//! `cargo run --release --ignore-rust-version --no-default-features --example fuzz_effect_files -- 1000000 1`

use greylag::physics::formula::fuzz;

fn main() {
    let number = |k: usize, default: u64| {
        std::env::args().nth(k).map_or(default, |text| text.parse().unwrap_or(default))
    };
    let (count, seed) = (number(1, 1_000_000), number(2, 1));
    let (mut located, mut refused) = (0_u64, 0_u64);
    let good = fuzz::run(count as usize, seed, &mut |_, said| {
        if let Err(why) = said {
            refused += 1;
            located += u64::from(
                why.contains("line ") || why.contains(" = ") || why.contains("parameters."),
            );
        }
    });
    println!(
        "{count} files of seed {seed}: {good} read, {refused} refused, {located} of these with their place, no panic"
    );
}
