//! Random streams from a seed and a path, a list of numbers that names the purpose of the stream.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// A reproducible random stream. ChaCha8 is specified to the bit. A seed therefore gives the same random numbers with every
/// version of the program on every machine.
pub type Stream = ChaCha8Rng;

/// Random stream of `seed` for the purpose `path`, for example `stream(seed, &[episode, tick])`. Streams with different paths
/// are independent and may be drawn in any order.
pub fn stream(seed: u64, path: &[u64]) -> Stream {
    // the FNV-1a hash of the path selects one of the 2^64 streams that ChaCha has for each seed
    let number =
        path.iter().flat_map(|p| p.to_le_bytes()).fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        });
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(number);
    rng
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngExt;

    #[test]
    fn paths_are_independent_and_repeatable() {
        let draw = |seed, path: &[u64]| stream(seed, path).random::<u64>();
        assert_eq!(draw(1, &[2, 3]), draw(1, &[2, 3]));
        assert_ne!(draw(1, &[2, 3]), draw(1, &[3, 2]));
        assert_ne!(draw(1, &[2, 3]), draw(2, &[2, 3]));
    }
}
