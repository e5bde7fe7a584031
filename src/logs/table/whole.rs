//! Statistics of a whole log. If a log is only inspected, stretches of 30 s are kept in memory of topics with many samples.

use super::{Track, fill, make_true, track_of};
use crate::Sample;
use crate::stretches::{LENGTH_S, Stretches};
use crate::topics::Topics;

/// Statistics of all samples of a log, although the table holds only stretches of it.
pub(crate) struct Whole {
    /// Statistics of the stretches. Their `phases` are still empty.
    pub stretches: Stretches,
    /// Airspeed, air density and altitude of the whole log. There is one row a second if only stretches of the airspeed are
    /// kept, else one row for each airspeed sample.
    pub air: Vec<Sample>,
}

impl Whole {
    /// Statistics of the whole log. A track is the data of one column. `base` is the track whose times are the times of the
    /// table. `None` if all samples of `base` are kept.
    pub(super) fn of(base: &Track<'_>, topics: &Topics, tracks: &[Track<'_>]) -> Option<Whole> {
        let watch = base.watch()?;
        let stretches = Stretches {
            every: base.topic.level.every(),
            length_s: LENGTH_S,
            rows: base.samples(),
            span_s: watch.span_s?,
            gaps: watch.gaps.clone(),
            phases: Vec::new(),
        };
        let of = |column: &str| tracks.iter().find(|t| t.rule.columns().contains(&column));
        let mut air: Vec<Sample> = Vec::new();
        for column in ["airspeed_mps", "air_density_kgpm3", "altitude_m"] {
            let Some(track) = of(column) else { continue };
            let coarse = track.topic.coarse();
            let slow = coarse.as_ref().and_then(|topic| track_of(topics, topic, &track.rule, 0));
            let track = slow.as_ref().unwrap_or(track);
            if column == "airspeed_mps" {
                let row = |t: &f64| Sample { time_s: *t, ..Sample::default() };
                air = track.times.iter().map(row).collect();
            }
            fill(&mut air, track, &track.series());
        }
        if of("airspeed_mps").is_some_and(|t| t.rule.equivalent) {
            make_true(&mut air);
        }
        Some(Whole { stretches, air })
    }
}
