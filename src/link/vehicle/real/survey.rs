//! Measured quality of the link to a flight controller: message rates, lost frames, jitter and round-trip times.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

/// Length of the time window over which rates are counted.
const WINDOW: Duration = Duration::from_secs(1);
/// A frame counts as late if its sequence number is behind by less than this. If it is further behind, the counter has restarted.
const LATE: u32 = 32;
/// Largest number of round-trip times that are kept.
const TRIPS: usize = 256;

/// Statistics of the frames with one message id.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Traffic {
    /// Number of frames received.
    pub frames: u64,
    /// Number of bytes received, headers included.
    pub bytes: u64,
    /// Rate in the last complete window, Hz.
    pub hz: f64,
    /// Time at which the counting of this message began, by this computer's clock.
    since: Duration,
    /// Arrival of the last frame, by this computer's clock.
    last: Duration,
    in_window: u32,
    /// Mean interval between frames (s). `squares` is the sum of the squared deviations from it (s²), by Welford's method.
    mean: f64,
    squares: f64,
}

impl Traffic {
    /// Standard deviation of the interval between two frames, ms; 0 with fewer than three frames.
    pub fn jitter_ms(&self) -> f64 {
        match self.frames {
            0..3 => 0.0,
            frames => 1e3 * (self.squares / (frames - 2) as f64).sqrt(),
        }
    }

    fn note(&mut self, host: Duration, bytes: usize) {
        if self.frames > 0 {
            let interval = host.saturating_sub(self.last).as_secs_f64();
            let delta = interval - self.mean;
            self.mean += delta / self.frames as f64;
            self.squares += delta * (interval - self.mean);
        }
        self.frames += 1;
        self.bytes += bytes as u64;
        self.last = host;
        self.in_window += 1;
    }
}

/// Statistics of the traffic from one flight controller.
#[derive(Clone, Debug, Default)]
pub struct Survey {
    messages: BTreeMap<u32, Traffic>,
    /// Arrival of the first and the last frame.
    span: Option<(Duration, Duration)>,
    sequence: Option<u8>,
    received: u64,
    lost: u64,
    trips: VecDeque<Duration>,
    window_ends: Option<Duration>,
    windows: u32,
}

impl Survey {
    /// Counts a frame of the controller.
    pub(super) fn frame(&mut self, host: Duration, id: u32, sequence: u8, bytes: usize) {
        match self.sequence.map(|before| sequence.wrapping_sub(before)) {
            // the last frame again
            Some(0) => {}
            // a late frame: it was counted as lost when a later one arrived
            Some(back) if u32::from(back) > 256 - LATE => self.lost = self.lost.saturating_sub(1),
            Some(ahead) => {
                // a step by more than half of the counter's range is taken as a restart of the counter
                self.lost += if ahead <= 128 { u64::from(ahead - 1) } else { 0 };
                self.sequence = Some(sequence);
            }
            None => self.sequence = Some(sequence),
        }
        self.received += 1;
        let (first, _) = *self.span.get_or_insert((host, host));
        self.span = Some((first, host));
        let fresh = Traffic { since: first, ..Traffic::default() };
        self.messages.entry(id).or_insert(fresh).note(host, bytes);
    }

    /// Restarts the statistics of message `id`, for instance when the controller has accepted a rate for it.
    pub(super) fn restart(&mut self, host: Duration, id: u32) {
        if let Some(traffic) = self.messages.get_mut(&id) {
            let Traffic { hz, in_window, .. } = *traffic;
            *traffic = Traffic { since: host, hz, in_window, ..Traffic::default() };
        }
    }

    /// Mean rate of a message from the start of its counting to the last frame of any message, at least over 1 s, Hz.
    pub fn mean_hz(&self, traffic: &Traffic) -> f64 {
        let last = self.span.map_or(Duration::ZERO, |(_, last)| last);
        traffic.frames as f64 / last.saturating_sub(traffic.since).max(WINDOW).as_secs_f64()
    }

    /// Closes the window and computes the rates if the window has ended at `host`. Returns whether it has.
    pub(super) fn turn(&mut self, host: Duration) -> bool {
        let ends = *self.window_ends.get_or_insert(host + WINDOW);
        if host < ends {
            return false;
        }
        let length = (host + WINDOW).saturating_sub(ends).as_secs_f64();
        for traffic in self.messages.values_mut() {
            traffic.hz = f64::from(std::mem::take(&mut traffic.in_window)) / length;
        }
        self.window_ends = Some(host + WINDOW);
        self.windows += 1;
        true
    }

    /// Whether no window has begun yet, because `turn` was not called since the controller was found.
    pub(super) fn is_new(&self) -> bool {
        self.window_ends.is_none()
    }

    /// Stores a round-trip time, and drops the oldest beyond [`TRIPS`].
    pub(super) fn trip(&mut self, time: Duration) {
        if self.trips.len() == TRIPS {
            self.trips.pop_front();
        }
        self.trips.push_back(time);
    }

    /// Rate of message `id` in the last complete window, Hz; 0 if it was not received.
    pub fn hz(&self, id: u32) -> f64 {
        self.messages.get(&id).map_or(0.0, |traffic| traffic.hz)
    }

    /// Number of complete windows.
    pub fn windows(&self) -> u32 {
        self.windows
    }

    /// All received messages with their id.
    pub fn messages(&self) -> impl Iterator<Item = (u32, &Traffic)> {
        self.messages.iter().map(|(id, traffic)| (*id, traffic))
    }

    /// Number of frames received, and number of frames lost according to the gaps in the sequence numbers.
    pub(super) fn frames(&self) -> [u64; 2] {
        [self.received, self.lost]
    }

    /// Fraction of frames lost (0..1), from gaps in the sequence numbers.
    pub fn loss(&self) -> f64 {
        let all = self.received + self.lost;
        if all == 0 { 0.0 } else { self.lost as f64 / all as f64 }
    }

    /// Round-trip times from TIMESYNC, shortest first.
    pub fn round_trips(&self) -> Vec<Duration> {
        let mut trips: Vec<_> = self.trips.iter().copied().collect();
        trips.sort_unstable();
        trips
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_burst_of_answers_is_no_stream() {
        let mut survey = Survey::default();
        survey.frame(Duration::ZERO, 0, 0, 21);
        for i in 0..9 {
            survey.frame(Duration::from_micros(3_000_000 + i), 22, 1 + i as u8, 37);
        }
        survey.frame(Duration::from_secs(8), 0, 10, 21);
        let rate = survey.messages().find(|(id, _)| *id == 22).map(|(_, t)| survey.mean_hz(t));
        // nine frames in the 8 s since the controller's first frame
        assert_eq!(rate, Some(9.0 / 8.0));
    }

    #[test]
    fn jitter_is_counted_from_the_granting_of_the_rate() {
        let mut survey = Survey::default();
        // 4 Hz before the restart of the statistics and 50 Hz after it
        (0..8).for_each(|i| survey.frame(Duration::from_millis(250 * i), 74, i as u8, 32));
        survey.restart(Duration::from_secs(2), 74);
        (0..100)
            .for_each(|i| survey.frame(Duration::from_millis(2020 + 20 * i), 74, 8 + i as u8, 32));
        let (_, traffic) = survey.messages().next().unwrap();
        assert!(traffic.jitter_ms() < 1e-6 && (survey.mean_hz(traffic) - 50.0).abs() < 1.0);
    }

    #[test]
    fn rates_losses_and_jitter_of_a_known_stream() {
        let mut survey = Survey::default();
        let mut sequence = 250u8;
        for i in 0..300u64 {
            // frames are sent every 10 ms and arrive alternately 1 ms late and on time; every tenth frame is lost
            sequence = sequence.wrapping_add(1);
            let host = Duration::from_micros(10_000 * i + if i % 2 == 0 { 1000 } else { 0 });
            survey.turn(host);
            if i % 10 != 9 {
                survey.frame(host, 31, sequence, 60);
            }
        }
        assert!((survey.hz(31) - 90.0).abs() < 2.0, "{}", survey.hz(31));
        // the last frame is lost too, but nothing follows from which this could be seen: 29 of 299 count as lost
        assert!((survey.loss() - 29.0 / 299.0).abs() < 1e-9);
        let traffic = survey.messages().next().unwrap().1;
        // the intervals are 9 ms and 11 ms, and about 20 ms where a frame is lost
        assert!((2.0..5.0).contains(&traffic.jitter_ms()), "{}", traffic.jitter_ms());
        assert_eq!((survey.hz(105), survey.windows()), (0.0, 2));
    }

    #[test]
    fn a_message_is_counted_from_the_first_frame_of_the_controller() {
        let mut survey = Survey::default();
        survey.frame(Duration::from_secs(5), 0, 0, 21);
        for i in 0..9 {
            survey.frame(Duration::from_secs(8), 22, 1 + i, 37);
        }
        survey.frame(Duration::from_secs(13), 0, 10, 21);
        let rate = survey.messages().find(|(id, _)| *id == 22).map(|(_, t)| survey.mean_hz(t));
        // nine frames in 8 s: the time counts from the controller's first frame, which arrived at 5 s
        assert_eq!(rate, Some(9.0 / 8.0));
    }

    #[test]
    fn frames_that_come_late_or_twice_are_not_lost() {
        let mut survey = Survey::default();
        for sequence in [250, 252, 251, 251, 255, 254, 253, 0, 2, 1, 3] {
            survey.frame(Duration::ZERO, 0, sequence, 21);
        }
        assert_eq!(survey.frames()[1], 0);
        // five frames are missing, then the controller restarts
        survey.frame(Duration::ZERO, 0, 9, 21);
        survey.frame(Duration::ZERO, 0, 150, 21);
        assert_eq!(survey.frames()[1], 5);
        survey.frame(Duration::ZERO, 0, 152, 21);
        assert_eq!(survey.frames()[1], 6);
    }

    #[test]
    fn a_rate_that_is_granted_amid_a_window_does_not_empty_it() {
        let mut survey = Survey::default();
        survey.turn(Duration::ZERO);
        for i in 0..100 {
            survey.frame(Duration::from_millis(10 * i), 31, i as u8, 60);
            if i == 50 {
                survey.restart(Duration::from_millis(500), 31);
            }
        }
        assert!(survey.turn(Duration::from_secs(1)));
        assert!((survey.hz(31) - 100.0).abs() < 1e-9, "{}", survey.hz(31));
    }

    #[test]
    fn the_jitter_of_two_intervals_is_their_standard_deviation() {
        let mut survey = Survey::default();
        for (i, ms) in [0, 10, 30].into_iter().enumerate() {
            survey.frame(Duration::from_millis(ms), 31, i as u8, 60);
        }
        // the intervals are 10 ms and 20 ms: √(2 · 5²) ms with one degree of freedom
        let jitter = survey.messages().next().unwrap().1.jitter_ms();
        assert!((jitter - 7.071).abs() < 0.001, "{jitter}");
    }

    #[test]
    fn a_window_that_is_closed_late_counts_for_its_length() {
        let mut survey = Survey::default();
        survey.turn(Duration::ZERO);
        for i in 0..150 {
            survey.frame(Duration::from_millis(10 * i), 31, i as u8, 60);
        }
        assert!(survey.turn(Duration::from_millis(1500)));
        assert!((survey.hz(31) - 100.0).abs() < 1e-9, "{}", survey.hz(31));
    }
}
