//! Checksum of MAVLink frames: CRC-16/MCRF4XX, eight bytes at a time.
//!
//! A log of an hour has a million frames, and most of the time to cut them is that of their checksums. Table k holds
//! the effect of a byte with k bytes behind it, so that eight look-ups do not wait for each other ("slicing by 8";
//! Kounavis and Berry 2008).

/// The polynomial x¹⁶ + x¹² + x⁵ + 1 with its bits reversed.
const POLYNOMIAL: u16 = 0x8408;
const START: u16 = 0xFFFF;
/// Bytes that are taken at a time.
const SLICE: usize = 8;

const TABLES: [[u16; 256]; SLICE] = tables();

const fn tables() -> [[u16; 256]; SLICE] {
    let mut tables = [[0; 256]; SLICE];
    let mut i = 0;
    while i < 256 {
        let mut sum = i as u16;
        let mut bit = 0;
        while bit < 8 {
            sum = if sum & 1 == 0 { sum >> 1 } else { sum >> 1 ^ POLYNOMIAL };
            bit += 1;
        }
        tables[0][i] = sum;
        i += 1;
    }
    let mut k = 1;
    while k < SLICE {
        i = 0;
        while i < 256 {
            let before = tables[k - 1][i];
            tables[k][i] = before >> 8 ^ tables[0][before as usize & 0xFF];
            i += 1;
        }
        k += 1;
    }
    tables
}

/// The checksum of a frame: `bytes` from behind the start marker to the end of the payload, then CRC_EXTRA.
pub(crate) fn checksum(bytes: &[u8], extra: u8) -> u16 {
    let (slices, rest) = bytes.as_chunks::<SLICE>();
    let sum = slices.iter().fold(START, |sum, slice| {
        let [low, high] = sum.to_le_bytes();
        let first =
            TABLES[7][usize::from(slice[0] ^ low)] ^ TABLES[6][usize::from(slice[1] ^ high)];
        let others = slice[2..].iter().zip(TABLES[..6].iter().rev());
        others.fold(first, |sum, (byte, table)| sum ^ table[usize::from(*byte)])
    });
    let one = |sum: u16, byte: u8| sum >> 8 ^ TABLES[0][usize::from(sum as u8 ^ byte)];
    one(rest.iter().fold(sum, |sum, byte| one(sum, *byte)), extra)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_is_that_of_the_protocols_own_library() {
        // The check value of CRC-16/MCRF4XX is that of the digits 1 to 9.
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
