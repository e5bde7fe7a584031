//! Which rows of a table can be used.

use super::Sample;
use super::columns::COLUMNS;

/// Share of unusable rows above which a log is refused.
const REFUSED_SHARE: f64 = 0.05;
/// The least that a pitot at rest shows, m/s: noise about zero, as true airspeed.
const PITOT_AT_REST: f64 = -5.0;
/// Row numbers kept in the report of unusable rows.
const ROWS_NAMED: usize = 20;

/// Whether a log with many unusable rows is read all the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tolerance {
    /// More than 5 % of unusable rows refuse the log.
    #[default]
    Strict,
    /// Unusable rows are dropped, however many.
    Lenient,
}

/// The usable rows of a table, with a count of the others.
#[derive(Clone, Debug, Default)]
pub(super) struct Rows {
    pub samples: Vec<Sample>,
    /// Rows seen.
    pub total: usize,
    /// Rows dropped.
    pub dropped: usize,
    /// The numbers of the first of them.
    pub dropped_rows: Vec<usize>,
}

impl Rows {
    /// Takes row `number`; `None` is a row that could not be read.
    pub fn take(&mut self, number: usize, sample: Option<Sample>) {
        self.total += 1;
        match sample.map(at_rest).filter(|s| usable(s, self.samples.last())) {
            Some(sample) => self.samples.push(sample),
            None => {
                self.dropped += 1;
                if self.dropped_rows.len() < ROWS_NAMED {
                    self.dropped_rows.push(number);
                }
            }
        }
    }

    /// Takes every row that is later than the last one, complete or not.
    pub fn take_incomplete(&mut self, number: usize, sample: Sample) {
        let later = self.samples.last().is_none_or(|last| sample.time_s > last.time_s);
        if later && sample.time_s.is_finite() {
            self.total += 1;
            self.samples.push(sample);
        } else {
            self.take(number, None);
        }
    }

    /// The first dropped row, if there are too many of them.
    pub fn refused(&self, tolerance: Tolerance) -> Option<usize> {
        let poor = self.dropped as f64 > REFUSED_SHARE * self.total as f64;
        let first = self.dropped_rows.first().copied();
        if tolerance == Tolerance::Strict && poor { first } else { None }
    }
}

/// The sample with an airspeed of zero where the pitot shows its noise about zero.
fn at_rest(mut sample: Sample) -> Sample {
    if (PITOT_AT_REST..0.0).contains(&sample.airspeed_mps) {
        sample.airspeed_mps = 0.0;
    }
    sample
}

/// Whether a sample is later than the last one, has what is needed, and is possible.
fn usable(s: &Sample, last: Option<&Sample>) -> bool {
    let needed = [s.time_s, s.attitude_rad[0], s.attitude_rad[1], s.airspeed_mps];
    let pi = std::f64::consts::PI + 1e-6;
    needed.iter().chain(&s.rates_radps).all(|x| x.is_finite())
        && COLUMNS.iter().all(|c| !c.1(s).is_infinite())
        && s.attitude_rad[0].abs() <= pi
        && s.attitude_rad[1].abs() <= pi / 2.0
        && s.airspeed_mps >= 0.0
        && last.is_none_or(|last| s.time_s > last.time_s)
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

    #[test]
    fn a_pitot_at_rest_costs_no_row() {
        // −3.6 to −1.1 m/s stand in a PX4 log before its flight; −20 m/s is another unit or a fault
        let mut rows = Rows::default();
        for (k, airspeed) in [-3.6, -1.1, 0.2, 17.0, -20.0].into_iter().enumerate() {
            rows.take(k + 1, Some(row(k as f64, airspeed)));
        }
        let speeds: Vec<f64> = rows.samples.iter().map(|s| s.airspeed_mps).collect();
        assert_eq!(speeds, [0.0, 0.0, 0.2, 17.0]);
        assert_eq!(rows.dropped_rows, [5]);
    }
}
