//! Checksum of MAVLink frames: CRC-16/MCRF4XX.
//!
//! A log of an hour has a million frames, and parsing them spends most of its time on checksums. The tables of the
//! crate `crc` process 16 bytes at a time.

use crc::{CRC_16_MCRF4XX, Crc, Table};

static CHECKSUM: Crc<u16, Table<16>> = Crc::<u16, Table<16>>::new(&CRC_16_MCRF4XX);

/// The checksum of a frame. `bytes` begins after the start marker and ends with the payload. `extra` is the constant
/// CRC_EXTRA of the message type.
pub(crate) fn checksum(bytes: &[u8], extra: u8) -> u16 {
    let mut digest = CHECKSUM.digest();
    digest.update(bytes);
    digest.update(&[extra]);
    digest.finalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_is_that_of_the_protocols_own_library() {
        // the published check value of CRC-16/MCRF4XX is the checksum of the digits 1 to 9
        assert_eq!(checksum(b"12345678", b'9'), 0x6F91);
        let mut seed = 1u32;
        let mut byte = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 24) as u8
        };
        for len in 0..300 {
            let bytes: Vec<u8> = (0..len).map(|_| byte()).collect();
            let extra = byte();
            assert_eq!(checksum(&bytes, extra), mavlink::calculate_crc(&bytes, extra), "{len}");
        }
    }
}
