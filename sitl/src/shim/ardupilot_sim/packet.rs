//! Parser for the servo packet that ArduPilot sends for every step.

/// Magic number of a packet with 16 channels, and of one with 32 channels (SERVO_32_ENABLE 1).
const MAGIC_16: u16 = 18_458;
const MAGIC_32: u16 = 29_569;
/// Bytes before the channels: magic, frame rate, frame count.
const HEAD: usize = 8;

/// Servo packet of ArduPilot's JSON interface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ServoPacket {
    /// Step rate that ArduPilot requests, Hz.
    pub frame_rate_hz: u16,
    /// Number of packets since ArduPilot was started.
    pub frame_count: u32,
    /// Channels sent: 16 or 32.
    pub channels: usize,
    pwm_us: [u16; 32],
}

impl ServoPacket {
    /// Reads a datagram; `None` if it is not a servo packet.
    pub fn read(datagram: &[u8]) -> Option<Self> {
        let (head, channels) = datagram.split_at_checked(HEAD)?;
        let word = |at: usize| u16::from_le_bytes([head[at], head[at + 1]]);
        let count = match word(0) {
            MAGIC_16 => 16,
            MAGIC_32 => 32,
            _ => return None,
        };
        if channels.len() != 2 * count {
            return None;
        }
        let mut pwm_us = [0; 32];
        for (pwm, bytes) in pwm_us.iter_mut().zip(channels.chunks_exact(2)) {
            *pwm = u16::from_le_bytes([bytes[0], bytes[1]]);
        }
        let frame_count = u32::from_le_bytes([head[4], head[5], head[6], head[7]]);
        Some(ServoPacket { frame_rate_hz: word(2), frame_count, channels: count, pwm_us })
    }

    /// Pulse width of the channel at index `place`, from 0, µs; 0 means no pulse or a channel that is not sent.
    pub fn pwm_us(&self, place: usize) -> u16 {
        self.pwm_us.get(place).copied().unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_packet_is_read_byte_by_byte_and_anything_else_is_none() {
        // 18458 = 0x481A, 1200 = 0x04B0, frame 0x01020304, then 1500 = 0x05DC in channel 1.
        let mut bytes = vec![0x1A, 0x48, 0xB0, 0x04, 0x04, 0x03, 0x02, 0x01, 0xDC, 0x05];
        bytes.resize(40, 0);
        let packet = ServoPacket::read(&bytes).unwrap();
        assert_eq!((packet.frame_rate_hz, packet.frame_count), (1200, 0x0102_0304));
        assert_eq!((packet.channels, packet.pwm_us(0), packet.pwm_us(31)), (16, 1500, 0));
        for length in [0, 7, 8, 39, 41, 72] {
            let mut wrong = bytes.clone();
            wrong.resize(length, 0);
            assert_eq!(ServoPacket::read(&wrong), None, "{length} bytes");
        }
        bytes[0] ^= 1;
        assert_eq!(ServoPacket::read(&bytes), None, "another magic number");
    }
}
