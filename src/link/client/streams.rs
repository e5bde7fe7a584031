//! Intervals of the streams that a client (a ground station or an offboard program) receives. A stream is a MAVLink message that
//! is sent periodically.
//!
//! [`STREAMS`] in `link/wire/telemetry.rs` lists the messages and their default rates.

use std::time::Duration;

use crate::wire::telemetry::STREAMS;

/// Shortest interval of a stream: one control cycle.
const SHORTEST: Duration = Duration::from_millis(10);
/// Longest interval of a stream.
const LONGEST: Duration = Duration::from_secs(60);

/// Intervals of one client's streams, one row per entry of [`STREAMS`].
#[derive(Clone, Debug)]
pub struct StreamTable {
    rows: [Row; STREAMS.len()],
}

#[derive(Clone, Copy, Debug)]
struct Row {
    interval: Option<Duration>,
    due: Duration,
}

impl StreamTable {
    /// A table with the default rates. All streams are due at `host`, a time by this computer's clock.
    pub fn new(host: Duration) -> Self {
        StreamTable {
            rows: STREAMS
                .map(|stream| Row { interval: default_interval(stream.default_hz), due: host }),
        }
    }

    /// Whether row `at` is due at the time `host`. If so, it is due again one interval later. Messages that were missed in a
    /// pause are not sent later.
    pub fn is_due(&mut self, at: usize, host: Duration) -> bool {
        let row = &mut self.rows[at];
        let Some(interval) = row.interval.filter(|_| host >= row.due) else {
            return false;
        };
        row.due += interval;
        if row.due <= host {
            row.due = host + interval;
        }
        true
    }

    /// Interval of row `at`, µs; −1 if the stream is off.
    pub fn interval_us(&self, at: usize) -> i32 {
        self.rows[at].interval.map_or(-1, |interval| interval.as_micros() as i32)
    }

    /// Sets the interval of row `at` as MAV_CMD_SET_MESSAGE_INTERVAL specifies: in µs, with 0 for the default and −1 for off. The
    /// interval is clamped to 10 ms..60 s. `Err` for any other negative value and for NaN.
    pub fn set_interval(&mut self, at: usize, us: f64, host: Duration) -> Result<(), ()> {
        let interval = match us {
            -1.0 => None,
            0.0 => default_interval(STREAMS[at].default_hz),
            us if us > 0.0 => Some(limited(us * 1e-6)),
            _ => return Err(()),
        };
        self.rows[at] = Row { interval, due: host };
        Ok(())
    }

    /// Sets all streams of a group of REQUEST_DATA_STREAM to `rate` in Hz. A rate of 0 restores their default rates, and `None`
    /// turns them off. Group 0 means all streams that are on by default.
    pub fn set_group(&mut self, group: u8, rate: Option<u16>, host: Duration) {
        for (row, stream) in self.rows.iter_mut().zip(STREAMS) {
            let meant = stream.group == group || (group == 0 && stream.default_hz > 0.0);
            if meant {
                let interval = match rate {
                    None => None,
                    Some(0) => default_interval(stream.default_hz),
                    Some(hz) => Some(limited(1.0 / f64::from(hz))),
                };
                *row = Row { interval, due: host };
            }
        }
    }
}

fn default_interval(hz: f64) -> Option<Duration> {
    (hz > 0.0).then(|| limited(1.0 / hz))
}

fn limited(seconds: f64) -> Duration {
    Duration::from_secs_f64(seconds.clamp(SHORTEST.as_secs_f64(), LONGEST.as_secs_f64()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_are_limited_and_garbage_is_refused() {
        let mut table = StreamTable::new(Duration::ZERO);
        // 1 µs would be a million messages per second
        table.set_interval(0, 1.0, Duration::ZERO).unwrap();
        assert_eq!(table.interval_us(0), 10_000);
        table.set_interval(0, 1e30, Duration::ZERO).unwrap();
        assert_eq!(table.interval_us(0), 60_000_000);
        table.set_interval(0, -1.0, Duration::ZERO).unwrap();
        assert_eq!(table.interval_us(0), -1);
        table.set_interval(0, 0.0, Duration::ZERO).unwrap();
        assert_eq!(table.interval_us(0), 100_000);
        for garbage in [f64::NAN, -2.0, f64::NEG_INFINITY] {
            assert!(table.set_interval(0, garbage, Duration::ZERO).is_err());
        }
    }

    #[test]
    fn a_pause_is_not_caught_up() {
        let mut table = StreamTable::new(Duration::ZERO);
        assert!(table.is_due(0, Duration::ZERO));
        // the stream has 10 Hz: after a pause of 5 s one message is due, and the next one 100 ms later
        let late = Duration::from_secs(5);
        assert!(table.is_due(0, late));
        assert!(!table.is_due(0, late + Duration::from_millis(99)));
        assert!(table.is_due(0, late + Duration::from_millis(100)));
    }
}
