//! Plots over time with a common zoom and cursor. Panels with the same sample times form a track.

use serde::Serialize;

use crate::kit::decimate;
use crate::kit::html::{compact, compact_time, escape};
use crate::{Rule, Style};

/// Number of rows above which a track is thinned.
const DRAWN_ROWS: usize = 20_000;

/// Panels over time; all time figures of a page have the same time axis.
#[derive(Clone, Debug, Default, Serialize)]
pub struct TimeFigure {
    /// The tracks, one for each set of sample times.
    pub tracks: Vec<Track>,
    /// Times marked in every panel.
    pub marks: Vec<Mark>,
    /// Notes under the panels about omitted or thinned data.
    #[serde(skip)]
    pub notes: Vec<String>,
}

/// Panels whose series have the same sample times.
#[derive(Clone, Debug, Serialize)]
pub struct Track {
    #[serde(serialize_with = "compact_time")]
    time_s: Vec<f64>,
    panels: Vec<Panel>,
}

/// One pair of axes over time.
#[derive(Clone, Debug, Serialize)]
pub struct Panel {
    /// Title of the panel.
    pub title: String,
    /// Unit of the values; empty for dimensionless values.
    pub unit: String,
    /// Scale of the vertical axis.
    pub scale: Scale,
    /// Lines, in drawing order.
    pub series: Vec<Series>,
    /// Shaded bands behind the lines.
    pub bands: Vec<Band>,
    /// Horizontal lines at fixed levels.
    pub rules: Vec<Rule>,
}

impl Panel {
    /// A panel of lines on a linear scale, without bands and rules.
    pub fn new(title: &str, unit: &str, series: Vec<Series>) -> Self {
        Panel {
            title: title.into(),
            unit: unit.into(),
            scale: Scale::Linear,
            series,
            bands: Vec::new(),
            rules: Vec::new(),
        }
    }
}

/// Scale of the vertical axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Scale {
    /// Linear axis.
    Linear,
    /// Logarithmic axis from `floor` upward; smaller values are drawn at `floor`.
    Log {
        /// The smallest displayed value, in the unit of the panel; positive.
        floor: f64,
    },
}

/// One line of a panel.
#[derive(Clone, Debug, Serialize)]
pub struct Series {
    /// Name of the series in the legend.
    pub label: String,
    /// Meaning of the series, which sets its colour.
    pub style: Style,
    /// One value per time of the track; a value that is not finite is a gap.
    #[serde(serialize_with = "compact")]
    pub values: Vec<f64>,
}

impl Series {
    /// A line with one value per time of its track.
    pub fn new(label: &str, style: Style, values: Vec<f64>) -> Self {
        Series { label: label.into(), style, values }
    }

    fn is_missing(&self) -> bool {
        !self.values.iter().any(|v| v.is_finite())
    }
}

/// A shaded band around one line of the panel.
#[derive(Clone, Debug, Serialize)]
pub struct Band {
    /// Index of the line in the panel's series.
    pub around: usize,
    /// Distance from the line to either edge, in the unit of the panel.
    pub half_width: f64,
    /// Name of the band in the legend.
    pub label: String,
}

/// A marked time.
#[derive(Clone, Debug, Serialize)]
pub struct Mark {
    /// Marked time, s, on the page's time axis.
    pub time_s: f64,
    /// Short label that a table of the page explains.
    pub label: String,
}

impl TimeFigure {
    /// Adds a track of panels with the sample times `time_s`, s, which should ascend. Rows out of time order are omitted.
    ///
    /// Series without a finite value and panels without a series are omitted. A gap longer than `gap_s`, s, interrupts the lines.
    /// More than 20,000 rows are thinned: the rows are divided into equal groups, and the extremes of each group are kept. The
    /// notes state which data were omitted or thinned.
    pub fn add_track(&mut self, time_s: &[f64], gap_s: f64, panels: Vec<Panel>) {
        let mut panels = self.without_missing(panels);
        if panels.is_empty() {
            return;
        }
        let rows = decimate::rows_in_order(time_s, gap_s);
        let kept = rows.iter().flatten().count();
        if kept < time_s.len() {
            let lost = time_s.len() - kept;
            self.notes.push(format!("{lost} rows out of time order are not drawn."));
        }
        let mut time = decimate::times_of(&rows, time_s);
        for series in panels.iter_mut().flat_map(|p| &mut p.series) {
            series.values = decimate::values_of(&rows, &series.values);
        }
        if time.len() > DRAWN_ROWS {
            let group = (2 * time.len()).div_ceil(DRAWN_ROWS);
            let groups = decimate::groups(&rows, group);
            self.notes.push(format!(
                "Drawn from the smallest and largest of every {group} samples; \
                 the flight log holds all {kept}."
            ));
            for series in panels.iter_mut().flat_map(|p| &mut p.series) {
                series.values = decimate::extremes(&series.values, &groups);
            }
            time = decimate::pair_times(&time, &groups);
        }
        self.tracks.push(Track { time_s: time, panels });
    }

    fn without_missing(&mut self, panels: Vec<Panel>) -> Vec<Panel> {
        let mut missing = Vec::new();
        let mut kept = Vec::new();
        for mut panel in panels {
            for (i, series) in panel.series.iter().enumerate() {
                if series.is_missing() {
                    missing.push(format!("{} ({})", panel.title, series.label));
                    panel.bands.retain(|b| b.around != i);
                }
            }
            // A band refers to its line by an index. The index decreases when an earlier line is removed.
            for band in &mut panel.bands {
                let before = &panel.series[..band.around.min(panel.series.len())];
                band.around -= before.iter().filter(|s| s.is_missing()).count();
            }
            panel.series.retain(|s| !s.is_missing());
            if !panel.series.is_empty() {
                kept.push(panel);
            }
        }
        if !missing.is_empty() {
            self.notes.push(format!("Not in this log: {}.", missing.join(", ")));
        }
        kept
    }

    pub(crate) fn html(&self, index: usize) -> String {
        let columns = match self.tracks.iter().map(|t| t.panels.len()).sum::<usize>() {
            0 | 1 => "one",
            n if n % 3 == 0 => "three",
            _ => "two",
        };
        let mut html = format!("<div class=\"time\"><div class=\"panels {columns}\">\n");
        for (t, track) in self.tracks.iter().enumerate() {
            for (p, panel) in track.panels.iter().enumerate() {
                let (title, unit) = (escape(&panel.title), escape(&panel.unit));
                html.push_str(&format!(
                    "<figure class=\"panel\"><figcaption><h3>{title}</h3>\
                     <span class=\"unit\">{unit}</span></figcaption>\
                     <div class=\"plot\" data-figure=\"{index}\" data-track=\"{t}\" \
                     data-panel=\"{p}\" tabindex=\"0\" role=\"img\" \
                     aria-label=\"{title} over time\"></div></figure>\n"
                ));
            }
        }
        html.push_str("</div>\n");
        for note in &self.notes {
            html.push_str(&format!("<p class=\"note\">{}</p>\n", escape(note)));
        }
        html.push_str("</div>\n");
        html
    }
}
