//! Converts pulse widths of servo channels to normalised commands.

use std::fmt;
use std::str::FromStr;

use crate::shim::outputs::Range;

/// Pulse widths of a channel at its lower stop, its neutral position and its upper stop, µs.
///
/// Written as `1000:1500:2000`: SERVOn_MIN, SERVOn_TRIM and SERVOn_MAX.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PwmRange {
    low_us: u16,
    neutral_us: u16,
    high_us: u16,
}

/// Range of one channel or of all channels, written as `3=1100:1500:1900` or `1000:1500:2000`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChannelRange {
    /// The channel, from 1; `None` for all channels without a specific range.
    pub channel: Option<usize>,
    /// Pulse widths of the channel.
    pub range: PwmRange,
}

/// Error of parsing a pulse-width range.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "cannot read the pulse widths '{given}': {fault}; write SERVOn_MIN:SERVOn_TRIM:SERVOn_MAX in µs, such as 1000:1500:2000, or 3=1000:1500:2000 for channel 3"
)]
pub struct PwmRangeError {
    given: String,
    fault: &'static str,
}

impl PwmRange {
    /// 1000, 1500 and 2000 µs, as for ArduPilot's own simulated aircraft.
    pub const STANDARD: PwmRange = PwmRange { low_us: 1000, neutral_us: 1500, high_us: 2000 };

    /// Command at a pulse of `pwm_us`, µs: −1..1 for a surface, 0..1 for a throttle. A pulse width beyond the stops gives a
    /// command outside these limits. No pulse (0) gives 0.
    pub fn command(self, pwm_us: u16, range: Range) -> f64 {
        let [pwm, low, neutral, high] =
            [pwm_us, self.low_us, self.neutral_us, self.high_us].map(f64::from);
        match range {
            _ if pwm_us == 0 => 0.0,
            Range::Throttle => (pwm - low) / (high - low),
            Range::Surface if pwm < neutral => (pwm - neutral) / (neutral - low),
            Range::Surface => (pwm - neutral) / (high - neutral),
        }
    }
}

impl FromStr for PwmRange {
    type Err = &'static str;

    fn from_str(given: &str) -> Result<Self, &'static str> {
        let numbers: Vec<u16> = given
            .split(':')
            .map(|number| number.trim().parse().map_err(|_| "a pulse width is no whole number"))
            .collect::<Result<_, _>>()?;
        let [low_us, neutral_us, high_us] = numbers[..] else {
            return Err("there must be three pulse widths");
        };
        if !(0 < low_us && low_us < neutral_us && neutral_us < high_us) {
            return Err("the pulse widths must grow");
        }
        Ok(PwmRange { low_us, neutral_us, high_us })
    }
}

impl FromStr for ChannelRange {
    type Err = PwmRangeError;

    fn from_str(given: &str) -> Result<Self, PwmRangeError> {
        let fail = |fault| PwmRangeError { given: given.to_owned(), fault };
        let (channel, range) = match given.split_once('=') {
            Some((channel, range)) => (Some(channel), range),
            None => (None, given),
        };
        let channel = channel
            .map(|number| number.trim().parse().ok().filter(|n| (1..=32).contains(n)))
            .map(|number| number.ok_or(fail("channels are numbered 1 to 32")))
            .transpose()?;
        Ok(ChannelRange { channel, range: range.parse().map_err(fail)? })
    }
}

impl fmt::Display for ChannelRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let PwmRange { low_us, neutral_us, high_us } = self.range;
        if let Some(channel) = self.channel {
            write!(f, "{channel}=")?;
        }
        write!(f, "{low_us}:{neutral_us}:{high_us}")
    }
}

/// Range of the channel at index `place`, from 0. The last range for this channel takes precedence over the last range for all
/// channels; without either, the standard range applies.
pub fn range_at(given: &[ChannelRange], place: usize) -> PwmRange {
    let last = |channel: Option<usize>| given.iter().rfind(move |item| item.channel == channel);
    last(Some(place + 1)).or(last(None)).map_or(PwmRange::STANDARD, |item| item.range)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ranges(given: &[&str]) -> Vec<ChannelRange> {
        given.iter().map(|item| item.parse().unwrap()).collect()
    }

    #[test]
    fn a_pulse_width_commands_by_its_own_stops() {
        let given = ranges(&["1=1100:1400:2000", "3=1000:1500:1800"]);
        let command = |place, pwm, range| range_at(&given, place).command(pwm, range);
        // The neutral position may be off-centre; each side is scaled to its stop.
        assert_eq!(command(0, 1250, Range::Surface), -0.5);
        assert_eq!(command(0, 1700, Range::Surface), 0.5);
        assert_eq!(command(2, 1400, Range::Throttle), 0.5);
        assert_eq!(command(1, 2000, Range::Surface), 1.0, "the standard range");
        assert_eq!(command(1, 2500, Range::Surface), 2.0, "limited by the mix");
        for range in [Range::Surface, Range::Throttle] {
            assert_eq!(command(0, 0, range), 0.0, "no pulse");
        }
        let all = ranges(&["900:1500:2100"]);
        assert_eq!(range_at(&all, 7).command(2100, Range::Surface), 1.0);
    }

    #[test]
    fn reads_what_it_writes_and_refuses_the_rest_in_one_line() {
        for text in ["1000:1500:2000", "3=1100:1500:1900"] {
            assert_eq!(text.parse::<ChannelRange>().map(|r| r.to_string()).as_deref(), Ok(text));
        }
        for text in ["", "1000:2000", "2000:1500:1000", "0:1:2", "0=1:2:3", "33=1:2:3", "a:b:c"] {
            let error = text.parse::<ChannelRange>().expect_err(text).to_string();
            assert!(error.contains(&format!("'{text}'")) && !error.contains('\n'), "{error}");
        }
    }
}
