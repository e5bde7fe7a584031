//! A CSV table as read from its file, before unusable rows are dropped. Of a long table, an inspection keeps only stretches of
//! rows, with statistics of the whole table.

use std::collections::BTreeMap;
use std::io::BufRead;
use std::path::Path;

use super::CsvError;
use super::airspeed;
use super::dialect;
use super::head::Head;
use super::quaternion;
use super::records::{Fields, Records};
use super::thin::{STRETCH, Thin, Whole};
use crate::Channel;
use crate::columns::index;
use crate::mapping::{Entry, Mapping};
use crate::phases::Flying;
use crate::quality::frozen_of;
use crate::stretches::{Keep, Stretches};
use crate::topics::period_s;
use crate::{Sample, rows};

/// A CSV table as read from its file, before unusable rows are dropped.
#[derive(Default)]
pub(crate) struct Raw {
    /// The rows that could be parsed and that have a time.
    pub rows: Vec<Sample>,
    /// For each of `rows`: the number of rows that precede it in the file, without the header.
    pub(super) places: Vec<usize>,
    /// The same number for each row that could not be parsed.
    pub(super) unreadable: Vec<usize>,
    /// One error for each required column that the table lacks.
    pub missing: Vec<CsvError>,
    pub(crate) unknown_columns: Vec<String>,
    /// For each column that a single column of the file fills: the entry of a mapping file that fills it in the same way.
    pub entries: BTreeMap<String, Entry>,
    pub(super) cut_short: bool,
    /// Notes for the user, for instance on columns that were found under other names.
    pub notes: Vec<String>,
    /// Statistics of the whole table; `None` if the whole table is kept.
    pub(crate) whole: Option<Whole>,
}

/// Backward jump of time above which another recording may begin: the larger of `BACK_PERIODS` sample periods and `BACK_S`, s.
const BACK_PERIODS: f64 = 10.0;
const BACK_S: f64 = 1.0;
/// A new recording starts at a time within the first part of the previous recording's time span. This is the size of that part,
/// as a fraction of the span.
const BEGINS: f64 = 0.1;
/// Smallest number of rows that form a recording.
const RECORDING: usize = 50;

impl Raw {
    /// Calls `judge` for every row, also for those that could not be parsed (`None`). `judge` gets the row's number in the file
    /// (the header is row 1), the row and the rows kept so far. It returns the row if it is usable. The result has the kept rows.
    /// They are moved within the same memory, because a copy of a long table would be large.
    pub(super) fn judged(
        &mut self,
        judge: impl Fn(&mut rows::Rows, usize, Option<Sample>, &[Sample]) -> Option<Sample>,
    ) -> rows::Rows {
        let mut rows = rows::Rows::with_sparse_columns_of(&self.rows);
        let mut all = std::mem::take(&mut self.rows);
        let mut unreadable = self.unreadable.iter().peekable();
        let mut kept = 0;
        // a row with no row before it has the number 2, because the header is row 1
        for (i, place) in self.places.iter().enumerate() {
            while let Some(i) = unreadable.next_if(|i| *i < place) {
                judge(&mut rows, i + 2, None, &all[..kept]);
            }
            if let Some(row) = judge(&mut rows, place + 2, Some(all[i]), &all[..kept]) {
                all[kept] = row;
                kept += 1;
            }
        }
        for i in unreadable {
            judge(&mut rows, i + 2, None, &all[..kept]);
        }
        all.truncate(kept);
        // a table that has grown row by row may have room for twice as many
        all.shrink_to_fit();
        rows.samples = all;
        rows
    }

    /// Removes the rows for which `is` holds. They do not count as dropped.
    pub fn leave_out(&mut self, is: impl Fn(&Sample) -> bool) {
        if self.rows.iter().any(&is) {
            let places = std::mem::take(&mut self.places);
            let rows = std::mem::take(&mut self.rows).into_iter().zip(places);
            (self.rows, self.places) = rows.filter(|(row, _)| !is(row)).unzip();
        }
    }

    /// For each place at which rows between two kept stretches are left out: the times (s) of the last row before it and of the
    /// first row after it.
    fn pauses(&self) -> impl Iterator<Item = (f64, f64)> {
        let pairs = self.rows.windows(2).zip(self.places.windows(2));
        let left_out =
            pairs.filter(|(_, places)| self.whole.is_some() && places[1] - places[0] >= STRETCH);
        left_out.map(|(rows, _)| (rows[0].time_s, rows[1].time_s))
    }

    /// Longest time between the kept stretches, s, with a margin of 1 %; 0 if the whole table is kept.
    pub fn bridged_s(&self) -> f64 {
        self.pauses().map(|(from, to)| 1.01 * (to - from)).fold(0.0, f64::max)
    }

    /// Description of the kept stretches and of the whole table; `None` if the whole table is kept.
    pub fn stretches(&self, flies: &Flying) -> Option<Stretches> {
        let times: Vec<f64> = self.rows.iter().map(|s| s.time_s).collect();
        self.whole.as_ref()?.stretches(period_s(&times), flies)
    }

    /// Sets the number of samples and the largest gap of `channel` to those of the whole table. `stretches` describes the kept
    /// part.
    pub fn of_all(&self, stretches: &Stretches, channel: &mut Channel) {
        let share = self.rows.len() as f64 / stretches.rows.max(1) as f64;
        channel.samples = (channel.samples as f64 / share).round() as usize;
        channel.largest_gap_s = self.whole.as_ref().map_or(0.0, |whole| whole.watch.largest_gap_s);
    }

    /// Intervals (from, to, s) of the whole table in which the column `column` is frozen (constant). Its kept values are `values`
    /// at the times `times` (s). `None` if the whole table is kept or there is no such column.
    pub fn frozen(&self, column: &str, times: &[f64], values: &[f64]) -> Option<Vec<(f64, f64)>> {
        let (whole, place) = (self.whole.as_ref()?, index(column)?);
        Some(frozen_of(column, times, values, whole.watch.stays(place)))
    }

    /// Splits the table into its successive recordings. A recording begins where the time jumps back and does not return.
    pub fn recordings(self) -> Vec<Raw> {
        let times: Vec<f64> = self.rows.iter().map(|s| s.time_s).collect();
        let back = (BACK_PERIODS * period_s(&times)).max(BACK_S);
        let mut bounds = vec![0];
        for i in 1..times.len() {
            let whole = i - bounds[bounds.len() - 1] >= RECORDING && times.len() - i >= RECORDING;
            let goes_back = times[i] < times[i - 1] - back;
            // a clock that is set right jumps back by some seconds, but a new recording starts near the first time
            let start = times[bounds[bounds.len() - 1]];
            let begins = times[i] < start + (BEGINS * (times[i - 1] - start)).max(back);
            let stays = || times[i..i + RECORDING].iter().all(|t| *t < times[i - 1] - 0.5 * back);
            if whole && goes_back && begins && stays() {
                bounds.push(i);
            }
        }
        if bounds.len() == 1 || !self.missing.is_empty() {
            return vec![self];
        }
        bounds.push(times.len());
        let last = bounds.len() - 2;
        let one = |k: usize| {
            let (from, to) = (bounds[k], bounds[k + 1]);
            let first = if k == 0 { 0 } else { self.places[from] };
            let end = if k == last { usize::MAX } else { self.places[to] };
            let unreadable = self.unreadable.iter().filter(|i| (first..end).contains(*i));
            Raw {
                rows: self.rows[from..to].to_vec(),
                places: self.places[from..to].to_vec(),
                unreadable: unreadable.copied().collect(),
                missing: Vec::new(),
                unknown_columns: self.unknown_columns.clone(),
                entries: self.entries.clone(),
                cut_short: self.cut_short && k == last,
                notes: self.notes.clone(),
                whole: None,
            }
        };
        (0..=last).map(one).collect()
    }
}

/// Reads all rows of the CSV text `bytes`. `mapping` may assign columns with other names or units.
pub(crate) fn raw(bytes: &[u8], path: &Path, mapping: &Mapping) -> Result<Raw, CsvError> {
    read(&mut &bytes[..], path, mapping, Keep::All)
}

/// Reads the rows of a CSV table, or only stretches of them, as `keep` states. `mapping` may assign columns with other names or
/// units.
pub(crate) fn read(
    source: &mut dyn BufRead,
    path: &Path,
    mapping: &Mapping,
    keep: Keep,
) -> Result<Raw, CsvError> {
    let text = |source| CsvError::Text { path: path.to_owned(), source };
    let mut records = Records::new(source);
    let header = records.next().map_err(text)?;
    let name = |i| header.and_then(|h| h.get(i)).map(|h| String::from_utf8_lossy(h).into_owned());
    let count = header.map_or(0, Fields::len);
    let names: Vec<String> = (0..count).filter_map(name).map(|n| n.trim().to_owned()).collect();
    let (head, mut out) = Head::of(&names, records.delimiter, path, mapping);
    let mut quaternions: Vec<[f64; 4]> = Vec::new();
    // stretches need gaps, which are found by times in seconds: a table whose time unit is not known yet is kept whole
    let mut thin = Thin::new(if head.dialect.time_by_steps { Keep::All } else { keep });
    let mut number = 0;
    while let Some(record) = records.next().map_err(text)? {
        let sample = head.sample(record);
        sample.iter().for_each(|sample| thin.take(number, sample));
        match sample {
            Some(sample) if thin.keeps(number) => {
                out.rows.push(sample);
                out.places.push(number);
                quaternions.extend(head.quaternion(record));
            }
            Some(_) => {}
            // a quote that is not closed makes the following lines part of its record: each of these lines is lost
            None => {
                let lines = record.lines();
                out.unreadable.extend(number..number + lines);
                number += lines - 1;
            }
        }
        number += 1;
        if thin.is_full(out.rows.len()) {
            thin.thin(&mut quaternions, &out.places);
            thin.thin(&mut out.rows, &out.places);
            let places = out.places.clone();
            thin.thin(&mut out.places, &places);
        }
    }
    out.cut_short = records.cut_short();
    out.whole = thin.whole();
    // times are converted first: the order of a quaternion's components follows from body rates in rad/s
    if head.dialect.time_by_steps {
        in_seconds(&mut out.rows);
    }
    if head.dialect.equivalent {
        out.notes.push(airspeed::make_true(&mut out.rows));
    }
    if head.dialect.quaternion.is_some() {
        let order = mapping.quaternion().and_then(|q| q.order);
        let order = order.unwrap_or_else(|| quaternion::order(&out.rows, &quaternions));
        quaternion::fill(&mut out.rows, &quaternions, order);
    }
    Ok(out)
}

/// Converts the times of `rows` to seconds. Their unit is guessed from the median step.
fn in_seconds(rows: &mut [Sample]) {
    let times: Vec<f64> = rows.iter().map(|s| s.time_s).collect();
    let unit = dialect::unit_of(period_s(&times));
    rows.iter_mut().for_each(|row| row.time_s *= unit);
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;

    fn table(text: &str) -> Raw {
        raw(text.as_bytes(), Path::new("t.csv"), &Mapping::default()).unwrap()
    }

    #[test]
    fn the_order_of_a_quaternion_is_found_by_the_rates_with_times_in_microseconds() {
        let mut text = String::from("timestamp,q[0],q[1],q[2],q[3],p_radps,q_radps,r_radps\n");
        for k in 0..200 {
            let turn = UnitQuaternion::from_euler_angles(0.3 + 0.002 * f64::from(k), 0.1, 0.5);
            let [x, y, z, w] = [turn.i, turn.j, turn.k, turn.w];
            text += &format!("{},{x},{y},{z},{w},0.2,0,0\n", 10_000 * k);
        }
        let row = table(&text).rows[100];
        assert!((row.time_s - 1.0).abs() < 1e-9, "{row:?}");
        assert!((row.attitude_rad[0] - 0.5).abs() < 1e-9, "{row:?}");
    }

    #[test]
    fn lines_behind_a_quote_that_is_not_closed_are_counted_as_lost() {
        let row = |k: i32| format!("{k},0.1,\"AUTO\"\n");
        let rows: Vec<String> = (0..10).map(row).collect();
        let text = format!("time_s,roll_rad,mode\n{}", rows.concat());
        assert_eq!(table(&text).rows.len(), 10);
        let spoiled =
            text.replacen("2,0.1,\"AUTO\"\n3", "2,\"0.1\n3", 1).replace("\"AUTO\"", "AUTO");
        let table = table(&spoiled);
        assert_eq!((table.rows.len(), table.unreadable), (2, (2..10).collect::<Vec<usize>>()));
    }
}
