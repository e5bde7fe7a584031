//! A small share of `examples/fuzz.rs`: every target takes some of its inputs, and none panics.

use crate::fuzz_support::{Target, feed};

#[test]
fn nothing_that_reads_what_others_wrote_panics() {
    for target in Target::ALL {
        let inputs = match target {
            Target::Parser => 200_000,
            Target::Toml => 2000,
            _ => 20_000,
        };
        let fed = feed(target, inputs, 7);
        println!("{target}: {fed:?}");
        assert_eq!((fed.inputs, fed.panics), (inputs, 0), "{target}");
        // Some get past the first check, and not all: what is fed is spoilt, but not noise.
        assert!(fed.taken > inputs / 100, "{target}: {fed:?}");
        let frames = matches!(target, Target::Parser | Target::Clients);
        assert!(frames || fed.taken < inputs, "{target}: {fed:?}");
    }
}
