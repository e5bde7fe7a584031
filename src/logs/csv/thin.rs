//! Limits the memory for a long table. An inspection parses every row, but keeps only the rows in some stretches: blocks of
//! consecutive rows at regular intervals.

use crate::Sample;
use crate::columns::COLUMNS;
use crate::phases::{self, Flying};
use crate::stretches::{Keep, Level, MOST, Stretches, Watch};

/// Number of rows in a stretch.
pub(super) const STRETCH: usize = 4096;
/// One airspeed in this number of rows is kept of the whole table. Flight and ground phases are found from these airspeeds.
const COARSE: usize = 16;
/// A backward step of the time by more than this may be the start of another recording, s.
const BACK_S: f64 = 1.0;

/// Selection of the rows of a long table.
#[derive(Default)]
pub(super) struct Thin {
    keep: Keep,
    level: Level,
    watch: Watch,
    /// Times (s) and airspeeds (m/s) at intervals of [`COARSE`] rows.
    air: Vec<(f64, f64)>,
    due: bool,
    last_s: f64,
}

impl Thin {
    pub fn new(keep: Keep) -> Thin {
        Thin { keep, last_s: f64::NEG_INFINITY, ..Thin::default() }
    }

    /// Whether row `number` of the file is kept.
    pub fn keeps(&self, number: usize) -> bool {
        self.keep == Keep::All || (number / STRETCH).is_multiple_of(self.level.every())
    }

    /// Adds row `number` of the file to the statistics of the whole table, even if the row is not kept.
    pub fn take(&mut self, number: usize, row: &Sample) {
        if self.keep == Keep::All {
            return;
        }
        if row.time_s < self.last_s - BACK_S {
            // Another recording may begin. Its first rows are needed to decide this, so all further rows are kept.
            self.keep = Keep::All;
        }
        self.last_s = row.time_s;
        self.watch.take(row.time_s, &COLUMNS.map(|(_, get, _)| get(row)));
        self.due |= number.is_multiple_of(COARSE);
        if self.due && row.airspeed_mps.is_finite() {
            self.due = false;
            self.air.push((row.time_s, row.airspeed_mps));
        }
    }

    /// Returns whether `rows`, the number of kept rows, exceeds the limit. If so, deselects every second stretch.
    pub fn is_full(&mut self, rows: usize) -> bool {
        let fewer = (self.keep == Keep::Stretches && rows > MOST).then(|| self.level.halved());
        self.level = fewer.flatten().unwrap_or(self.level);
        fewer.is_some()
    }

    /// Removes the entries of `all` whose rows are not kept. `places` has the row number of each entry.
    pub fn thin<T: Copy>(&self, all: &mut Vec<T>, places: &[usize]) {
        let mut place = places.iter();
        all.retain(|_| place.next().is_some_and(|place| self.keeps(*place)));
    }

    /// Statistics of the whole table; `None` if all of it is kept.
    pub fn whole(self) -> Option<Whole> {
        let every = self.level.every();
        self.level.thins().then_some(Whole { watch: self.watch, air: self.air, every })
    }
}

/// Statistics of a whole table of which only stretches are kept.
pub(crate) struct Whole {
    pub(crate) watch: Watch,
    air: Vec<(f64, f64)>,
    every: usize,
}

impl Whole {
    /// Description of the stretches, with the phases of the whole table. `period` is the time between two rows, s.
    pub(crate) fn stretches(&self, period: f64, flies: &Flying) -> Option<Stretches> {
        let (from, to) = self.watch.span_s?;
        let airspeeds: Vec<Sample> = self
            .air
            .iter()
            .map(|(t, v)| Sample { time_s: *t, airspeed_mps: *v, ..Sample::default() })
            .collect();
        Some(Stretches {
            every: self.every,
            length_s: STRETCH as f64 * period,
            rows: self.watch.samples,
            span_s: (from, to),
            gaps: self.watch.gaps.clone(),
            phases: phases::phases(&airspeeds, flies),
        })
    }
}
