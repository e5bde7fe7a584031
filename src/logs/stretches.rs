//! Stretches of a long log. A stretch is an interval of 30 s. If a log is only inspected, and a topic has many samples, then
//! only the samples of some stretches are kept in memory, and statistics of all samples.
//!
//! Some minutes of flight suffice to check units, signs, axes and delays. But a single event may lie outside the kept stretches.
//! Gaps and values that stay constant are therefore detected in all samples, and one sample per second is kept throughout the
//! log.

use super::phases::Phase;
use super::quality::FROZEN_S;

/// How much of a log is kept in memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Keep {
    /// Every sample, as computations need.
    #[default]
    All,
    /// Only stretches of the topics that have more samples than [`MOST`].
    Stretches,
}

/// Largest number of kept samples of a topic. Above it, half of the kept stretches are dropped.
pub(super) const MOST: usize = 65_536;
/// Length of a stretch, s.
pub(super) const LENGTH_S: f64 = 30.0;
/// Largest number of times that the kept stretches of a topic are halved.
const LEVELS: u32 = 24;
/// A time without samples is recorded as a gap if it exceeds both limits: the first in s, the second in mean sample periods.
const PAUSE_S: f64 = 0.1;
const PAUSE_STEPS: f64 = 3.0;
/// Largest number of recorded gaps of a topic, and of recorded constant intervals of a field.
const NOTED: usize = 4096;
/// Smallest time between the samples that are kept throughout the log, s.
const COARSE_S: f64 = 1.0;

/// Selection of stretches: at level n, every 2^n-th stretch is kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Level(u32);

impl Level {
    /// Whether any stretch is dropped.
    pub fn thins(self) -> bool {
        self.0 > 0
    }

    /// The ratio of all stretches to kept stretches.
    pub fn every(self) -> usize {
        1 << self.0
    }

    /// Whether `time_s` lies in a stretch that is kept.
    pub fn keeps(self, time_s: f64) -> bool {
        (time_s / LENGTH_S).floor() as i64 % (1 << self.0) == 0
    }

    /// The level that keeps half as many stretches; `None` after `LEVELS` halvings.
    pub fn halved(self) -> Option<Level> {
        (self.0 < LEVELS).then_some(Level(self.0 + 1))
    }

    /// The one of the two levels that keeps fewer stretches.
    pub fn sparser(self, other: Level) -> Level {
        Level(self.0.max(other.0))
    }
}

/// An interval in which a value stays constant.
#[derive(Clone, Debug)]
struct Stay {
    value: f64,
    from_s: f64,
    to_s: f64,
}

/// Statistics over all samples of a topic, kept or not.
#[derive(Clone, Debug, Default)]
pub(super) struct Watch {
    /// Number of samples. A sample counts only if it is later than the previous one.
    pub samples: usize,
    /// Time of the first and of the last sample, s.
    pub span_s: Option<(f64, f64)>,
    /// Longest time between two samples, s.
    pub largest_gap_s: f64,
    /// Gaps that are much longer than the mean sample period: start and length, s.
    pub gaps: Vec<(f64, f64)>,
    /// For each field, the ended intervals in which its value stayed constant, not zero, for longer than `FROZEN_S`: start and
    /// end, s.
    stays: Vec<Vec<(f64, f64)>>,
    current: Vec<Stay>,
    /// One sample per second: the times (s), and in `coarse` the values of each field.
    pub coarse_s: Vec<f64>,
    pub coarse: Vec<Vec<f64>>,
}

impl Watch {
    /// Updates the statistics with a sample at `time_s` (s). The sample is ignored if it is not later than the previous one.
    pub fn take(&mut self, time_s: f64, values: &[f64]) {
        if !time_s.is_finite() || self.span_s.is_some_and(|(_, last)| time_s <= last) {
            return;
        }
        let (first, last) = self.span_s.unwrap_or((time_s, time_s));
        let step = time_s - last;
        self.largest_gap_s = self.largest_gap_s.max(step);
        let usual = (last - first) / self.samples.max(1) as f64;
        if step > PAUSE_S.max(PAUSE_STEPS * usual) && self.gaps.len() < NOTED {
            self.gaps.push((last, step));
        }
        self.samples += 1;
        self.span_s = Some((first, time_s));
        self.stay(time_s, values);
    }

    /// Keeps the sample if at least a second has passed since the last sample that this function kept.
    pub fn coarsely(&mut self, time_s: f64, values: &[f64]) {
        if self.coarse_s.last().is_none_or(|last| time_s - last >= COARSE_S) {
            self.coarse_s.push(time_s);
            self.coarse.resize_with(values.len(), Vec::new);
            self.coarse.iter_mut().zip(values).for_each(|(column, x)| column.push(*x));
        }
    }

    fn stay(&mut self, time_s: f64, values: &[f64]) {
        if self.current.is_empty() {
            let begun = |x: &f64| Stay { value: *x, from_s: time_s, to_s: time_s };
            self.current = values.iter().map(begun).collect();
            self.stays = vec![Vec::new(); values.len()];
        }
        for ((stay, ended), x) in self.current.iter_mut().zip(&mut self.stays).zip(values) {
            if stay.value == *x {
                stay.to_s = time_s;
            } else if x.is_finite() {
                ended.extend(long(stay).filter(|_| ended.len() < NOTED));
                *stay = Stay { value: *x, from_s: time_s, to_s: time_s };
            }
        }
    }

    /// Intervals in which the field with index `field` stayed constant, not zero, for longer than `FROZEN_S`: start and end, s.
    pub fn stays(&self, field: usize) -> Vec<(f64, f64)> {
        let ended = self.stays.get(field).into_iter().flatten().copied();
        ended.chain(self.current.get(field).and_then(long)).collect()
    }
}

/// Start and end (s) of the interval `stay`. `None` if its value is zero or it is not longer than `FROZEN_S`.
fn long(stay: &Stay) -> Option<(f64, f64)> {
    let noted = stay.value != 0.0 && stay.to_s - stay.from_s > FROZEN_S;
    noted.then_some((stay.from_s, stay.to_s))
}

/// Statistics of a whole long log of which only stretches of the topics with many samples were inspected.
#[derive(Clone, Debug, PartialEq)]
pub struct Stretches {
    /// The number n: one of n stretches was inspected.
    pub every: usize,
    /// Length of a stretch, s.
    pub length_s: f64,
    /// Number of rows that the whole table would have.
    pub rows: usize,
    /// Times of the first and the last row of the whole table, s.
    pub span_s: (f64, f64),
    /// Gaps in the rows: start and length, s.
    pub gaps: Vec<(f64, f64)>,
    /// Phases of flight and ground of the whole log.
    pub phases: Vec<Phase>,
}

impl Stretches {
    /// Text of a note for the user.
    pub(super) fn said(&self) -> String {
        format!(
            "a long log of {} rows: a look at it judges units, signs and axes by one of {} stretches of {:.0} s; \
             what computes with it reads every row",
            self.rows, self.every, self.length_s
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fewer_stretches_are_some_of_the_more() {
        let one = Level::default().halved().unwrap();
        let two = one.halved().unwrap();
        assert!((0..1000).all(|t| !two.keeps(f64::from(t)) || one.keeps(f64::from(t))));
        let kept = (0..1200).filter(|t| two.keeps(f64::from(*t))).count();
        assert_eq!((kept, two.every()), (300, 4));
    }

    #[test]
    fn pauses_and_values_that_stay_are_noted_with_their_times() {
        let mut watch = Watch::default();
        for k in (0..1000).filter(|k| !(300..350).contains(k)) {
            let x = if (500..800).contains(&k) { 3.0 } else { f64::from(k) };
            watch.take(0.01 * f64::from(k), &[x, 0.0]);
            watch.coarsely(0.01 * f64::from(k), &[x, 0.0]);
        }
        let near =
            |(a, b): (f64, f64), (c, d): (f64, f64)| (a - c).abs() < 1e-9 && (b - d).abs() < 1e-9;
        let [gap] = watch.gaps[..] else { panic!("{:?}", watch.gaps) };
        assert!(near(gap, (2.99, 0.51)), "{gap:?}");
        let [stay] = watch.stays(0)[..] else { panic!() };
        assert!(near(stay, (5.0, 7.99)), "{stay:?}");
        // A constant zero means that the sensor is absent; it is not recorded.
        assert!(watch.stays(1).is_empty());
        assert_eq!((watch.samples, watch.coarse_s.len()), (950, 10));
    }
}
