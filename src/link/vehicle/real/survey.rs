//! What a link really carries: rates, gaps, jitter, latency.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

/// Rates are taken over windows of this length.
const WINDOW: Duration = Duration::from_secs(1);
/// Round trips that are kept.
const TRIPS: usize = 256;

/// One message's traffic.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Traffic {
    /// Frames so far.
    pub frames: u64,
    /// Bytes so far, headers included.
    pub bytes: u64,
    /// Rate over the last whole window, Hz.
    pub hz: f64,
    /// When the first came.
    pub first: Duration,
    /// When the last came.
    pub last: Duration,
    in_window: u32,
    /// Sum of the squared deviations of the interval from its mean (Welford), with the mean, s.
    mean: f64,
    squares: f64,
}

impl Traffic {
    /// Mean rate between the first and the last frame, Hz; 0 for fewer than two.
    pub fn mean_hz(&self) -> f64 {
        let span = self.last.saturating_sub(self.first).as_secs_f64();
        if span > 0.0 { (self.frames - 1) as f64 / span } else { 0.0 }
    }

    /// Standard deviation of the interval between two frames, ms.
    pub fn jitter_ms(&self) -> f64 {
        match self.frames {
            0..3 => 0.0,
            frames => 1e3 * (self.squares / (frames - 2) as f64).sqrt(),
        }
    }

    fn note(&mut self, host: Duration, bytes: usize) {
        if self.frames == 0 {
            self.first = host;
        } else {
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

/// The survey of one controller's traffic.
#[derive(Clone, Debug, Default)]
pub struct Survey {
    messages: BTreeMap<u32, Traffic>,
    sequence: Option<u8>,
    received: u64,
    lost: u64,
    trips: VecDeque<Duration>,
    window_ends: Option<Duration>,
    windows: u32,
}

impl Survey {
    /// Notes a frame of the controller.
    pub(super) fn frame(&mut self, host: Duration, id: u32, sequence: u8, bytes: usize) {
        if let Some(before) = self.sequence.replace(sequence) {
            // A gap of more than half the counter is a frame that came late, or a new start.
            let gap = sequence.wrapping_sub(before).wrapping_sub(1);
            self.lost += if gap < 128 { u64::from(gap) } else { 0 };
        }
        self.received += 1;
        self.messages.entry(id).or_default().note(host, bytes);
    }

    /// Closes windows that are over at `host`; whether one has closed.
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

    /// Notes a round trip.
    pub(super) fn trip(&mut self, time: Duration) {
        if self.trips.len() == TRIPS {
            self.trips.pop_front();
        }
        self.trips.push_back(time);
    }

    /// A message's rate over the last whole second, Hz; 0 when it does not come.
    pub fn hz(&self, id: u32) -> f64 {
        self.messages.get(&id).map_or(0.0, |traffic| traffic.hz)
    }

    /// Whole seconds surveyed.
    pub fn windows(&self) -> u32 {
        self.windows
    }

    /// Every message that came, by number.
    pub fn messages(&self) -> impl Iterator<Item = (u32, &Traffic)> {
        self.messages.iter().map(|(id, traffic)| (*id, traffic))
    }

    /// Share of frames that never came, by the gaps in their sequence numbers.
    pub fn loss(&self) -> f64 {
        let all = self.received + self.lost;
        if all == 0 { 0.0 } else { self.lost as f64 / all as f64 }
    }

    /// Round trips by TIMESYNC, shortest first.
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
    fn rates_losses_and_jitter_of_a_known_stream() {
        let mut survey = Survey::default();
        let mut sequence = 250u8;
        for i in 0..300u64 {
            // Each tenth frame is lost; those left come every 10 ms, 1 ms early or late.
            sequence = sequence.wrapping_add(1);
            let host = Duration::from_micros(10_000 * i + if i % 2 == 0 { 1000 } else { 0 });
            survey.turn(host);
            if i % 10 != 9 {
                survey.frame(host, 31, sequence, 60);
            }
        }
        assert!((survey.hz(31) - 90.0).abs() < 2.0, "{}", survey.hz(31));
        // The last one lost is not known yet: 29 of 299.
        assert!((survey.loss() - 29.0 / 299.0).abs() < 1e-9);
        let traffic = survey.messages().next().unwrap().1;
        // Intervals of 9, 11 and, over a lost frame, 20 ms.
        assert!((2.0..5.0).contains(&traffic.jitter_ms()), "{}", traffic.jitter_ms());
        assert_eq!((survey.hz(105), survey.windows()), (0.0, 2));
    }
}
