//! Separates the usable rows of a log's table from the unusable ones, and counts the unusable ones by reason.

use super::Sample;
use super::columns::{COLUMNS, NEEDED, index};

/// Share of unusable rows above which a log is refused.
const REFUSED_SHARE: f64 = 0.05;
/// Airspeeds from this value up to zero are noise of a pitot tube at rest, m/s.
const PITOT_AT_REST: f64 = -5.0;
/// A column with values in less than this share of the rows is taken for that of a slow sensor.
const FILLED_SHARE: f64 = 0.95;
/// A column with fewer values is not taken for that of a slow sensor: the sensor failed.
const ENOUGH: usize = 50;
/// Largest number of unusable rows that are reported with their row numbers.
const ROWS_NAMED: usize = 20;

/// Whether a log with many unusable rows is accepted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tolerance {
    /// A log with more than 5 % unusable rows is refused.
    #[default]
    Strict,
    /// Unusable rows are dropped, and the log is accepted however many there are.
    Lenient,
}

/// Reason why a row cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Reason {
    /// A value is not a number, or the row has too few values.
    Unreadable,
    /// A required column is empty.
    Incomplete,
    /// An angle or the airspeed is impossible, or any number is infinite.
    Impossible,
    /// The time is not later than that of the last usable row.
    OutOfOrder,
}

impl Reason {
    const ALL: [(Reason, &'static str); 4] = [
        (Reason::Unreadable, "hold what is no number"),
        (Reason::Incomplete, "lack a needed column"),
        (Reason::Impossible, "hold an infinite number, or an impossible angle or airspeed"),
        (Reason::OutOfOrder, "are not later than the row before"),
    ];
}

/// The usable rows of a table, with a count of the others.
#[derive(Clone, Debug, Default)]
pub(super) struct Rows {
    pub samples: Vec<Sample>,
    /// Number of rows that were read.
    pub total: usize,
    /// Number of rows that were dropped.
    pub dropped: usize,
    /// Numbers of the first dropped rows.
    pub dropped_rows: Vec<usize>,
    /// Number of rows dropped for each reason, in the order of [`Reason::ALL`].
    counts: [usize; Reason::ALL.len()],
    /// For each required column, in the order of [`NEEDED`]: whether it may be empty in a usable row.
    sparse: [bool; NEEDED.len()],
    /// Time of the last usable row that was only counted, s.
    counted_s: Option<f64>,
}

impl Rows {
    /// An empty table. A required column may be empty in a usable row if only some of `rows` fill it, because its sensor is
    /// slower than the others.
    pub fn with_sparse_columns_of(rows: &[Sample]) -> Rows {
        let sparse = NEEDED.map(|name| {
            let get = index(name).map(|i| COLUMNS[i].1);
            let filled = rows.iter().filter(|s| get.is_some_and(|get| get(s).is_finite())).count();
            name != "time_s"
                && filled >= ENOUGH
                && (filled as f64) < FILLED_SHARE * rows.len() as f64
        });
        Rows { sparse, ..Rows::default() }
    }

    /// Counts row `number` as usable or unusable, without keeping it.
    fn count(&mut self, number: usize, sample: Option<Sample>) {
        let usable = self.judged(number, sample, self.counted_s);
        self.counted_s = usable.map(|row| row.time_s).or(self.counted_s);
    }

    /// Counts the usable and the unusable rows among `rows` without keeping any.
    pub fn counted(mut self, rows: &[Sample]) -> Rows {
        rows.iter().enumerate().for_each(|(i, row)| self.count(i + 1, Some(*row)));
        self
    }

    /// Keeps the usable rows among `rows`, and counts all. The result uses the memory of `rows`, because there may be too little
    /// for a second table.
    pub fn taken(mut self, mut rows: Vec<Sample>) -> Rows {
        let mut kept = 0_usize;
        for i in 0..rows.len() {
            let last = kept.checked_sub(1).map(|k| rows[k].time_s);
            if let Some(row) = self.judged(i + 1, Some(rows[i]), last) {
                rows[kept] = row;
                kept += 1;
            }
        }
        rows.truncate(kept);
        rows.shrink_to_fit();
        Rows { samples: rows, ..self }
    }

    /// Counts row `number` and returns it if it is usable. `row` is `None` if the row could not be read. `last` is the time of
    /// the last usable row, s.
    pub fn judged(
        &mut self,
        number: usize,
        row: Option<Sample>,
        last: Option<f64>,
    ) -> Option<Sample> {
        self.total += 1;
        let row = row.map(at_rest);
        match row.map_or(Some(Reason::Unreadable), |row| self.fault(&row, last)) {
            None => row,
            Some(reason) => {
                self.drop(number, reason);
                None
            }
        }
    }

    fn drop(&mut self, number: usize, reason: Reason) {
        self.dropped += 1;
        self.counts[reason as usize] += 1;
        if self.dropped_rows.len() < ROWS_NAMED {
            self.dropped_rows.push(number);
        }
    }

    /// Keeps row `number` if it is later than the last kept row, even if required columns are empty.
    pub fn take_incomplete(&mut self, number: usize, sample: Sample) {
        let last = self.samples.last().map(|last| last.time_s);
        let later = self.later(number, sample, last);
        self.samples.extend(later);
    }

    /// Counts row `number` and returns it if its time is later than `last` (s), even if required columns are empty.
    pub fn later(&mut self, number: usize, sample: Sample, last: Option<f64>) -> Option<Sample> {
        if !sample.time_s.is_finite() {
            return self.judged(number, None, last);
        }
        self.total += 1;
        if last.is_some_and(|last| sample.time_s <= last) {
            self.drop(number, Reason::OutOfOrder);
            return None;
        }
        Some(sample)
    }

    /// The number of the first dropped row if so many rows were dropped that the log is refused; `None` if it is accepted.
    pub fn refused(&self, tolerance: Tolerance) -> Option<usize> {
        let poor = self.dropped as f64 > REFUSED_SHARE * self.total as f64;
        let first = self.dropped_rows.first().copied();
        if tolerance == Tolerance::Strict && poor { first } else { None }
    }

    /// Text with the reasons for which rows were dropped, and the number of rows for each.
    pub fn reasons(&self) -> String {
        let said = Reason::ALL.iter().zip(self.counts).filter(|(_, count)| *count > 0);
        said.map(|((_, text), count)| format!("{count} {text}")).collect::<Vec<_>>().join(", ")
    }

    /// The reason why the sample `s` is unusable; `None` if it is usable. `last` is the time of the last usable row, s.
    fn fault(&self, s: &Sample, last: Option<f64>) -> Option<Reason> {
        let missing = NEEDED
            .iter()
            .zip(self.sparse)
            .any(|(name, sparse)| !sparse && index(name).is_some_and(|i| COLUMNS[i].1(s).is_nan()));
        let pi = std::f64::consts::PI + 1e-6;
        let impossible = COLUMNS.iter().any(|c| c.1(s).is_infinite())
            || s.attitude_rad[0].abs() > pi
            || s.attitude_rad[1].abs() > pi / 2.0
            || s.airspeed_mps < 0.0;
        let late = last.is_some_and(|last| s.time_s <= last);
        [
            (missing, Reason::Incomplete),
            (impossible, Reason::Impossible),
            (late, Reason::OutOfOrder),
        ]
        .into_iter()
        .find_map(|(so, reason)| so.then_some(reason))
    }
}

/// The sample with its airspeed set to zero if the airspeed is noise of a pitot tube at rest.
fn at_rest(mut sample: Sample) -> Sample {
    if (PITOT_AT_REST..0.0).contains(&sample.airspeed_mps) {
        sample.airspeed_mps = 0.0;
    }
    sample
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(time_s: f64, airspeed_mps: f64) -> Sample {
        Sample {
            time_s,
            attitude_rad: [0.0; 3],
            rates_radps: [0.0; 3],
            airspeed_mps,
            ..Sample::default()
        }
    }

    fn take(rows: &mut Rows, number: usize, row: Option<Sample>) {
        let last = rows.samples.last().map(|last| last.time_s);
        let usable = rows.judged(number, row, last);
        rows.samples.extend(usable);
    }

    #[test]
    fn a_pitot_at_rest_costs_no_row() {
        // A PX4 log has −3.6 to −1.1 m/s before take-off. An airspeed of −20 m/s is due to a wrong unit or a fault.
        let mut rows = Rows::default();
        for (k, airspeed) in [-3.6, -1.1, 0.2, 17.0, -20.0].into_iter().enumerate() {
            take(&mut rows, k + 1, Some(row(k as f64, airspeed)));
        }
        let speeds: Vec<f64> = rows.samples.iter().map(|s| s.airspeed_mps).collect();
        assert_eq!(speeds, [0.0, 0.0, 0.2, 17.0]);
        assert_eq!(rows.dropped_rows, [5]);
    }

    #[test]
    fn a_slow_sensor_beside_a_fast_one_costs_no_row() {
        // airspeed at 5 Hz in rows at 50 Hz: nine of ten rows have none
        let airspeed = |k: usize| if k.is_multiple_of(10) { 17.0 } else { f64::NAN };
        let all: Vec<Sample> = (0..1000).map(|k| row(k as f64 * 0.02, airspeed(k))).collect();
        let mut rows = Rows::with_sparse_columns_of(&all);
        all.iter().enumerate().for_each(|(k, s)| take(&mut rows, k + 1, Some(*s)));
        assert_eq!((rows.samples.len(), rows.dropped), (1000, 0));
    }

    #[test]
    fn the_reasons_are_counted() {
        let mut rows = Rows::default();
        let samples = [Some(row(1.0, 17.0)), Some(row(0.5, 17.0)), Some(row(2.0, f64::NAN)), None];
        samples.into_iter().enumerate().for_each(|(k, s)| take(&mut rows, k + 1, s));
        assert_eq!(
            rows.reasons(),
            "1 hold what is no number, 1 lack a needed column, 1 are not later than the row before"
        );
        let mut rows = Rows::default();
        take(&mut rows, 1, Some(Sample { altitude_m: f64::INFINITY, ..row(1.0, 17.0) }));
        assert!(rows.reasons().contains("1 hold an infinite number"), "{}", rows.reasons());
    }
}
