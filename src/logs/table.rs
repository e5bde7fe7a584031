//! Resamples the fields of a log, which have different sample rates, onto one table.
//!
//! A topic is one type of message in a log. A rule states which topic and which of its fields fill which columns. The samples that
//! a rule selects form a channel.
//!
//! The table's times are those of attitude or body rates, whichever has more samples. Continuous channels are interpolated
//! linearly: angles after unwrapping, quaternions before their conversion to angles. Commands are held until the next sample. A
//! gap in a channel is filled only if it is at most 0.1 s long or, in a slower channel, at most three sample periods. Gaps in
//! the table's own times stay gaps.
//!
//! If a measured channel is much slower than the table (such as velocity over ground at 10 Hz), each sample fills only the row
//! that follows it. Interpolated rows would count as further measurements. The other rows stay empty; only in required columns
//! do they hold the last value.

mod absent;
mod clean;
mod whole;

use std::borrow::Cow;
use std::collections::BTreeMap;

use super::Sample;
use super::columns::{COLUMNS, EITHER, NEEDED, index};
use super::csv::make_true;
use super::finding::Finding;
use super::load::Channel;
use super::mapping::Entry;
use super::mapping::rule::Rule;
use super::quality::{self, Quality};
use super::resample::{Reader, SAME_S};
use super::sources::{Asked, Choice, Source};
use super::stretches::Watch;
use super::topics::{Topic, Topics, period_s};
use clean::cleaned;
pub(super) use whole::Whole;

/// Longest gap of a fast channel that is filled, s.
const GAP_S: f64 = 0.1;
/// Longest gap of a slow channel that is filled, in sample periods of the channel.
const GAP_PERIODS: f64 = 3.0;
/// A channel with at least this share of finite values replaces one with less.
const GOOD_SHARE: f64 = 0.5;
/// A channel that is slower than this value, Hz, is replaced by one that is more than five times as fast.
const SLOW_HZ: f64 = 10.0;
/// A measured channel whose sample rate is below this fraction of the table's fills only one row per sample. If its values were
/// held, more than a third of the rows would repeat the previous value. The flight-path reconstruction drops such repeats.
const SPARSE: f64 = 0.65;
/// Columns that are measurements in the flight-path reconstruction. The other columns are its inputs.
const MEASURED: [&str; 9] = [
    "roll_rad",
    "pitch_rad",
    "yaw_rad",
    "airspeed_mps",
    "alpha_rad",
    "beta_rad",
    "vn_mps",
    "ve_mps",
    "vd_mps",
];

/// A channel: a rule with the times of its usable samples. The values are computed for one channel at a time, because those of
/// all channels would take as much memory as the topics.
struct Track<'a> {
    rule: Rule,
    /// The instance of the rule's topic.
    instance: u16,
    origin: String,
    times: Cow<'a, [f64]>,
    /// Whether all samples have the same value.
    dead: bool,
    /// Share of the topic's samples that are usable.
    finite_share: f64,
    rate_hz: f64,
    topic: &'a Topic,
}

impl Track<'_> {
    /// The values of the usable samples: one series, or the four components of a quaternion.
    fn series(&self) -> Vec<Vec<f64>> {
        let all = self.rule.series(self.topic);
        all.map(|all| cleaned(&self.topic.time_s, all).1).unwrap_or_default()
    }

    fn limit_s(&self) -> f64 {
        if self.rate_hz > 0.0 { GAP_S.max(GAP_PERIODS / self.rate_hz) } else { GAP_S }
    }

    fn reader<'s>(&'s self, series: &'s [Vec<f64>]) -> Option<Reader<'s>> {
        Reader::new(&self.rule, &self.times, series, self.limit_s())
    }

    /// Whether the channel is a measurement whose sample period is much longer than the time between rows, `period` (s).
    fn is_sparse(&self, period: f64) -> bool {
        let measured = self.rule.columns().iter().all(|c| MEASURED.contains(c));
        measured && self.rate_hz > 0.0 && self.rate_hz * period < SPARSE
    }

    /// Statistics of all samples of the topic, if only some stretches (intervals of 30 s) are kept in memory; otherwise `None`.
    fn watch(&self) -> Option<&Watch> {
        self.topic.watch.as_deref().filter(|_| self.topic.level.thins())
    }

    /// Number of usable samples, including those that are not kept in memory.
    fn samples(&self) -> usize {
        match self.watch() {
            Some(watch) => (self.finite_share * watch.samples as f64).round() as usize,
            None => self.times.len(),
        }
    }

    /// The summary of this channel for the user. It includes the quality of the values, `series`.
    fn channel(&self, series: &[Vec<f64>]) -> Channel {
        let gap = self.times.windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max);
        let column = self.rule.columns()[0];
        let mut quality = match series {
            [one] => Quality::of(column, &self.times, one),
            _ => Quality::default(),
        };
        if let (Some(watch), [one]) = (self.watch(), series) {
            let field = self.rule.factor().and_then(|(field, _)| self.topic.place(field));
            let stays = field.map(|field| watch.stays(field)).unwrap_or_default();
            quality.frozen = quality::frozen_of(column, &self.times, one, stays);
        }
        Channel {
            columns: self.rule.columns().into_iter().map(str::to_owned).collect(),
            origin: self.origin.clone(),
            samples: self.samples(),
            rate_hz: self.rate_hz,
            largest_gap_s: self.watch().map_or(gap, |watch| watch.largest_gap_s),
            quality,
        }
    }
}

/// The table before unusable rows are dropped.
pub(super) struct Table {
    pub rows: Vec<Sample>,
    pub channels: Vec<Channel>,
    pub notes: Vec<String>,
    /// Required columns without data.
    pub missing: Vec<Missing>,
    /// All instances (such as sensors of the same kind) of each topic that has more than one.
    pub sources: Vec<Source>,
    /// Findings about unusual sources.
    pub findings: Vec<Finding>,
    /// For each column that a single field fills: the entry of a mapping file that fills it in the same way.
    pub entries: BTreeMap<String, Entry>,
    /// Statistics of the whole log, if only stretches of it are kept in memory.
    pub whole: Option<Whole>,
}

/// A required column for which the log has no data.
pub(super) struct Missing {
    pub column: &'static str,
    pub or: Option<&'static str>,
    /// Topics and fields that the rules looked for.
    pub looked_for: Vec<String>,
}

/// Resamples the fields that the rules select onto one table.
pub(super) fn build(topics: &Topics, rules: &[Rule], asked: &[Asked]) -> Table {
    let mut choice = Choice::of(topics, rules, asked);
    let (tracks, replaced) = choose(topics, rules, &choice);
    choice.findings.extend(replaced);
    let filled = |column: &str| tracks.iter().any(|t| t.rule.columns().contains(&column));
    let missing = lacking(rules, filled);
    let of = |column: &str| tracks.iter().find(|t| t.rule.columns().contains(&column));
    let base = [of("roll_rad"), of("p_radps")].into_iter().flatten().max_by_key(|t| t.samples());
    let whole = base.and_then(|base| Whole::of(base, topics, &tracks));
    let base = base.map(|t| t.times.to_vec()).unwrap_or_default();
    let mut rows: Vec<Sample> =
        base.iter().map(|t| Sample { time_s: *t, ..Sample::default() }).collect();
    let period = period_s(&base);
    let mut notes: Vec<String> = Vec::new();
    let (mut sparse, mut channels) = (Vec::new(), Vec::new());
    for track in &tracks {
        let series = track.series();
        if track.is_sparse(period) {
            sparse.push((track, fill_sparse(&mut rows, track, &series, period)));
        } else {
            fill(&mut rows, track, &series);
        }
        channels.push(track.channel(&series));
    }
    if !sparse.is_empty() {
        let slow = |(t, _): &(&Track<'_>, Vec<bool>)| {
            format!("{} ({:.1} Hz)", t.rule.columns().join(", "), t.rate_hz)
        };
        let slow: Vec<String> = sparse.iter().map(slow).collect();
        notes.push(format!(
            "measured more slowly than the table's rows, in the rows of their own samples only: {}",
            slow.join(", ")
        ));
    }
    for note in tracks.iter().filter_map(|t| t.rule.note.as_ref()) {
        if !notes.contains(note) {
            notes.push(note.clone());
        }
    }
    if of("airspeed_mps").is_some_and(|t| t.rule.equivalent) {
        notes.push(make_true(&mut rows));
    }
    sparse.iter().for_each(|(track, fresh)| hold(&mut rows, track, fresh));
    let entry =
        |t: &Track<'_>| Some((t.rule.columns()[0].to_owned(), Entry::of(&t.rule, t.instance)?));
    let entries = tracks.iter().filter_map(entry).collect();
    if missing.is_empty() {
        cut_ends(&mut rows, &mut notes);
    }
    Table {
        rows,
        channels,
        notes,
        missing,
        whole,
        sources: choice.sources,
        findings: choice.findings,
        entries,
    }
}

/// The required columns that are not `filled`.
fn lacking(rules: &[Rule], filled: impl Fn(&str) -> bool) -> Vec<Missing> {
    // the first required column is the time, which every channel has
    let missing = |column: &'static str, or: Option<&'static str>| {
        let of_column = rules.iter().filter(|r| r.columns().contains(&column));
        Missing { column, or, looked_for: of_column.map(Rule::origin).collect() }
    };
    let alone = NEEDED[1..].iter().filter(|c| !filled(c)).map(|c| missing(c, None));
    let either = EITHER.iter().filter(|(c, p)| !filled(c) && !filled(p));
    alone.chain(either.map(|(c, p)| missing(c, Some(p)))).collect()
}

/// Chooses for each column the best channel. Also returns findings about channels that were replaced because they never change,
/// and about absent fields.
fn choose<'a>(
    topics: &'a Topics,
    rules: &[Rule],
    choice: &Choice,
) -> (Vec<Track<'a>>, Vec<Finding>) {
    let (mut chosen, mut findings): (Vec<Track<'a>>, Vec<Finding>) = (Vec::new(), Vec::new());
    let mut absent: Vec<&Rule> = Vec::new();
    for rule in rules {
        let Some(track) = track(topics, rule, choice.instance(rule)) else {
            absent.push(rule);
            continue;
        };
        let same = |t: &&mut Track<'a>| t.rule.columns()[0] == rule.columns()[0];
        let filled = |t: &Track<'a>| t.rule.columns().iter().any(|c| rule.columns().contains(c));
        let taken = chosen.iter().any(filled);
        match chosen.iter_mut().find(same) {
            // A quaternion fills roll, pitch and yaw, and rules for single angles are then skipped here. If a roll angle replaces
            // the quaternion, pitch and yaw are no longer filled, and their rules are chosen next.
            None if taken => {}
            None => chosen.push(track),
            Some(old) => {
                let better = old.finite_share < GOOD_SHARE && track.finite_share >= GOOD_SHARE;
                let much_faster = old.rate_hz < SLOW_HZ
                    && track.rate_hz > 5.0 * old.rate_hz
                    && track.finite_share >= GOOD_SHARE;
                let rests = rule.columns()[0].ends_with("_cmd");
                let alive = !rests && old.dead && !track.dead && track.finite_share >= GOOD_SHARE;
                if alive {
                    findings.push(Finding::warning(format!(
                        "{}: {} is read, for {} never changes",
                        rule.columns().join(", "),
                        track.origin,
                        old.origin
                    )));
                }
                if better || much_faster || alive {
                    *old = track;
                }
            }
        }
    }
    findings.extend(absent::finding(&absent));
    (chosen, findings)
}

/// The channel of `rule` in the chosen `instance` of its topic; `None` if there is no instance or no usable sample. A sample is
/// usable if its values are finite and its time is later than that of the sample before.
fn track<'a>(topics: &'a Topics, rule: &Rule, instance: Option<u16>) -> Option<Track<'a>> {
    let instance = instance?;
    let topic = topics.topics.get(&(rule.topic.clone(), instance))?;
    track_of(topics, topic, rule, instance)
}

/// The channel of `rule` in `topic`, which is one instance of the rule's topic; `None` if it has no usable sample.
fn track_of<'a>(
    topics: &Topics,
    topic: &'a Topic,
    rule: &Rule,
    instance: u16,
) -> Option<Track<'a>> {
    let all = rule.series(topic)?;
    let (times, series) = cleaned(&topic.time_s, all);
    if times.is_empty() {
        return None;
    }
    let finite_share = times.len() as f64 / topic.time_s.len() as f64;
    let origin = match instance {
        0 => rule.origin(),
        i => format!("{} [{}]", rule.origin(), topics.naming.written(i)),
    };
    let period = period_s(&times);
    let rate_hz = if period > 0.0 { 1.0 / period } else { 0.0 };
    let dead = series.iter().all(|s| s.iter().all(|x| *x == s[0]));
    Some(Track { rule: rule.clone(), instance, origin, times, dead, finite_share, rate_hz, topic })
}

fn fill(rows: &mut [Sample], track: &Track<'_>, series: &[Vec<f64>]) {
    let Some(reader) = track.reader(series) else { return };
    rows.iter_mut().for_each(|row| reader.put(row));
}

/// Fills the first row at or after each sample of `track`. `period` (s) is the time between rows. The result is
/// `true` for each row that was filled.
fn fill_sparse(
    rows: &mut [Sample],
    track: &Track<'_>,
    series: &[Vec<f64>],
    period: f64,
) -> Vec<bool> {
    let mut fresh = vec![false; rows.len()];
    let Some(reader) = track.reader(series) else { return fresh };
    let mut next = 0;
    for t in track.times.iter() {
        // `next` becomes the first row at or after the sample; rows and samples are in order of time
        next += rows[next..].iter().take_while(|row| row.time_s < t - SAME_S).count();
        if rows.get(next).is_some_and(|row| row.time_s - t <= period) {
            fresh[next] = true;
        }
    }
    rows.iter_mut().zip(&fresh).filter(|(_, fresh)| **fresh).for_each(|(row, _)| reader.put(row));
    fresh
}

/// If the channel fills a required column: fills its columns in the rows that are not `fresh` with their last values.
fn hold(rows: &mut [Sample], track: &Track<'_>, fresh: &[bool]) {
    if !track.rule.columns().iter().any(|c| NEEDED.contains(c)) {
        return;
    }
    let places: Vec<usize> = track.rule.columns().into_iter().filter_map(index).collect();
    let mut last: Option<Sample> = None;
    for (row, fresh) in rows.iter_mut().zip(fresh) {
        let held = last.filter(|l| row.time_s - l.time_s <= track.limit_s());
        if *fresh {
            let whole = places.iter().all(|i| COLUMNS[*i].1(row).is_finite());
            last = if whole { Some(*row) } else { last };
        } else if let Some(held) = held {
            places.iter().for_each(|i| *COLUMNS[*i].2(row) = COLUMNS[*i].1(&held));
        }
    }
}

/// Removes the rows before the first one in which all required columns are filled, and those after the last such row.
fn cut_ends(rows: &mut Vec<Sample>, notes: &mut Vec<String>) {
    let whole =
        |s: &Sample| NEEDED.iter().all(|c| index(c).is_none_or(|i| COLUMNS[i].1(s).is_finite()));
    let first = rows.iter().position(whole).unwrap_or(0);
    let end = rows.iter().rposition(whole).map_or(rows.len(), |i| i + 1);
    let cut = rows.len() - (end - first);
    if cut > 0 {
        notes.push(format!(
            "{cut} rows before all needed channels have begun or after one has ended are left out"
        ));
        rows.truncate(end);
        rows.drain(..first);
    }
}

#[cfg(test)]
mod tests;
