//! Figure of states and curves over one time axis, as SVG that fits any width without a script.
//!
//! Horizontal positions are percentages of the width, so the text keeps its size. Colours are CSS classes, `tone-…` and `line-…`,
//! for the style sheet of the page.

use crate::kit::html::escape;
use crate::kit::numbers::number;

/// Height of a row of states and of a panel of curves, px.
const ROW_PX: f64 = 26.0;
const PANEL_PX: f64 = 84.0;
/// Widths of the figure on a telephone and on a desktop screen, px. A word is drawn on a screen if it fits there. A
/// letter has the width `LETTER_PX`, px, including its share of the margin.
const NARROW_PX: f64 = 330.0;
const WIDE_PX: f64 = 800.0;
const LETTER_PX: f64 = 8.0;
/// Smallest drawn width of a state, % of the figure. It keeps short states visible.
const SEEN: f64 = 0.6;
/// Approximate number of horizontal grid lines in a panel.
const LEVELS: f64 = 3.0;
/// Largest number of points of a drawn curve. A screen cannot resolve more.
const POINTS: usize = 800;

/// A figure of states and curves over time.
#[derive(Clone, Debug, Default)]
pub struct TimeLine {
    /// Title of the figure.
    pub title: String,
    /// Start and end of the time axis, s.
    pub span_s: [f64; 2],
    /// Rows of states, top to bottom.
    pub states: Vec<States>,
    /// Panels of curves below the states.
    pub traces: Vec<Traces>,
    /// Time interval that is shaded in the panels, s; `None` for no shading.
    pub shaded_s: Option<[f64; 2]>,
    /// Times that are marked in the panels, s.
    pub marks_s: Vec<f64>,
}

/// A row of consecutive states.
#[derive(Clone, Debug)]
pub struct States {
    /// Name of the system whose states the row shows.
    pub label: String,
    /// The states, in time order; gaps are allowed.
    pub spans: Vec<Span>,
}

/// One state with its duration.
#[derive(Clone, Debug, PartialEq)]
pub struct Span {
    /// Start and end, s.
    pub time_s: [f64; 2],
    /// Name of the state.
    pub word: String,
    /// Kind of the state.
    pub tone: Tone,
}

/// Kind of a state, which sets its colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tone {
    /// The system is not active.
    Idle,
    /// Transition to another state.
    Begins,
    /// The state that was commanded.
    Asked,
    /// A safe state instead of the commanded state.
    Safe,
    /// The system has failed.
    Wrong,
}

/// Curves on one pair of axes.
#[derive(Clone, Debug)]
pub struct Traces {
    /// Name of the vertical axis, with its unit.
    pub label: String,
    /// The curves, in drawing order.
    pub lines: Vec<TraceLine>,
}

/// A curve over time.
#[derive(Clone, Debug)]
pub struct TraceLine {
    /// Name of the curve.
    pub label: String,
    /// Colour and stroke of the curve.
    pub style: crate::Style,
    /// Time (s) and value of each point; a value that is not finite is a gap.
    pub points: Vec<[f64; 2]>,
}

impl Tone {
    fn name(self) -> &'static str {
        match self {
            Tone::Idle => "idle",
            Tone::Begins => "begins",
            Tone::Asked => "asked",
            Tone::Safe => "safe",
            Tone::Wrong => "wrong",
        }
    }
}

impl TimeLine {
    /// The figure as HTML, as wide as its container; empty if the time axis has no length.
    pub fn html(&self) -> String {
        if self.span_s[1] <= self.span_s[0] {
            return String::new();
        }
        let states: String = self.states.iter().map(|row| self.row(row)).collect();
        let traces: String = self.traces.iter().map(|panel| self.panel(panel)).collect();
        format!(
            "<figure class=\"timeline\"><figcaption>{}</figcaption>\n<div class=\"tracks\">\n{states}{traces}{}</div></figure>\n",
            escape(&self.title),
            self.axis()
        )
    }

    /// Horizontal position of a time, % of the width.
    fn place(&self, time_s: f64) -> f64 {
        let [from, to] = self.span_s;
        (100.0 * (time_s - from) / (to - from)).clamp(0.0, 100.0)
    }

    fn row(&self, row: &States) -> String {
        let [from, to] = self.span_s;
        let inside = |s: &&Span| s.time_s[1] > from && s.time_s[0] < to;
        let seen: Vec<&Span> = row.spans.iter().filter(inside).collect();
        let said = |s: &&Span| {
            let [from, to] = s.time_s;
            format!("{} from {from:.1} to {to:.1} s", s.word)
        };
        let read: Vec<String> = seen.iter().map(said).collect();
        let label = escape(&row.label);
        let read = if read.is_empty() { "nothing".into() } else { read.join(", ") };
        let spans: String = seen.iter().map(|span| self.span(span)).collect();
        format!(
            "<span class=\"label\">{label}</span><svg class=\"states\" height=\"{ROW_PX}\" role=\"img\" aria-label=\"{label}: {}\">{spans}</svg>\n",
            escape(&read)
        )
    }

    fn span(&self, span: &Span) -> String {
        let [from, to] = span.time_s.map(|t| self.place(t));
        let width = (to - from).max(SEEN);
        let needed = LETTER_PX * (span.word.chars().count() as f64 + 1.0);
        let fits = |px: f64| 0.01 * width * px >= needed;
        let word = escape(&span.word);
        let text = match (fits(NARROW_PX), fits(WIDE_PX)) {
            (true, _) => format!("<text x=\"5\" y=\"17.5\">{word}</text>"),
            (false, true) => format!("<text class=\"roomy\" x=\"5\" y=\"17.5\">{word}</text>"),
            (false, false) => String::new(),
        };
        let [from_s, to_s] = span.time_s;
        format!(
            "<svg x=\"{from:.3}%\" width=\"{width:.3}%\" height=\"{ROW_PX}\" class=\"tone-{}\"><title>{word}, {from_s:.2} to {to_s:.2} s</title><rect width=\"100%\" height=\"100%\"/>{text}</svg>",
            span.tone.name()
        )
    }

    fn panel(&self, panel: &Traces) -> String {
        let [from, to] = self.span_s;
        let seen = |[t, x]: &&[f64; 2]| (from..=to).contains(t) && x.is_finite();
        let values = panel.lines.iter().flat_map(|l| l.points.iter().filter(seen));
        let [low, high] = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], [_, x]| {
            [low.min(*x), high.max(*x)]
        });
        if low > high {
            return String::new();
        }
        // The margin also depends on the size of the values, because the range of a large constant would vanish in rounding.
        let room = 0.08 * (high - low).max(1.0).max(1e-6 * low.abs().max(high.abs()));
        let range = [low - room, high + room];
        let key: String = match panel.lines.len() {
            1 => String::new(),
            _ => panel.lines.iter().map(key).collect(),
        };
        let lines: String = panel.lines.iter().map(|line| self.line(line, range)).collect();
        let levels: String = levels(range).map(|x| level(x, range)).collect();
        let label = escape(&panel.label);
        format!(
            "<span class=\"label\">{label}{key}</span><svg class=\"traces\" height=\"{PANEL_PX}\" role=\"img\" \
             aria-label=\"{label} over time, from {} to {}\">{}{levels}<svg viewBox=\"0 0 1000 100\" width=\"100%\" height=\"100%\" \
             preserveAspectRatio=\"none\">{lines}</svg></svg>\n",
            number(low),
            number(high),
            self.behind()
        )
    }

    /// SVG of the shaded interval and the marks behind the curves.
    fn behind(&self) -> String {
        let shaded = self.shaded_s.map_or_else(String::new, |[from, to]| {
            let [from, to] = [from, to].map(|t| self.place(t));
            let width = (to - from).max(0.25);
            format!(
                "<rect class=\"shaded\" x=\"{from:.3}%\" width=\"{width:.3}%\" height=\"100%\"/>"
            )
        });
        let [from, to] = self.span_s;
        let mark = |t: &f64| {
            let x = self.place(*t);
            format!("<line class=\"mark\" x1=\"{x:.3}%\" x2=\"{x:.3}%\" y1=\"0\" y2=\"100%\"/>")
        };
        let inside = self.marks_s.iter().filter(|t| (from..=to).contains(*t));
        shaded + &inside.map(mark).collect::<String>()
    }

    fn line(&self, line: &TraceLine, [low, high]: [f64; 2]) -> String {
        let every = line.points.len().div_ceil(POINTS).max(1);
        let mut pieces: Vec<Vec<String>> = vec![Vec::new()];
        let [from, to] = self.span_s;
        let seen = |[t, _]: &&[f64; 2]| (from..=to).contains(t);
        for [t, x] in line.points.iter().step_by(every).filter(seen) {
            match (x.is_finite(), pieces.last_mut()) {
                (true, Some(piece)) => {
                    let y = 100.0 * (high - x) / (high - low);
                    piece.push(format!("{:.1},{y:.1}", 10.0 * self.place(*t)));
                }
                _ => pieces.push(Vec::new()),
            }
        }
        let style = line.style.name();
        let drawn = |piece: &Vec<String>| {
            format!("<polyline class=\"line-{style}\" points=\"{}\"/>", piece.join(" "))
        };
        pieces.iter().filter(|piece| piece.len() > 1).map(drawn).collect()
    }

    fn axis(&self) -> String {
        let [from, to] = self.span_s;
        let step = step(to - from, 6.0);
        let first = (from / step).ceil() as i64;
        let ticks = (first..).map(|k| k as f64 * step).take_while(|t| *t <= to + 1e-9);
        let tick = |t: f64| {
            let x = self.place(t);
            let anchor = match x {
                x if x < 3.0 => "start",
                x if x > 97.0 => "end",
                _ => "middle",
            };
            format!(
                "<text x=\"{x:.3}%\" y=\"12\" text-anchor=\"{anchor}\">{}</text>",
                rounded(t, step)
            )
        };
        let ticks: String = ticks.map(tick).collect();
        format!(
            "<span class=\"label\">time (s)</span><svg class=\"axis\" height=\"16\" aria-hidden=\"true\">{ticks}</svg>\n"
        )
    }
}

/// Legend entry of a curve.
fn key(line: &TraceLine) -> String {
    let (style, label) = (line.style.name(), escape(&line.label));
    format!(
        "<span class=\"key\"><svg width=\"16\" height=\"8\" aria-hidden=\"true\"><line class=\"line-{style}\" x1=\"0\" x2=\"16\" y1=\"4\" y2=\"4\"/></svg>{label}</span>"
    )
}

/// The smallest step of 1, 2 or 5 times a power of ten that divides `length` into at most about `count` parts.
fn step(length: f64, count: f64) -> f64 {
    let wanted = (length / count).max(f64::MIN_POSITIVE);
    let power = 10f64.powf(wanted.log10().floor());
    let times = [1.0, 2.0, 5.0].into_iter().find(|t| t * power >= 0.999 * wanted);
    times.unwrap_or(10.0) * power
}

/// `value` with the decimals that a scale with the step `step` needs.
fn rounded(value: f64, step: f64) -> String {
    let decimals = (-step.log10().floor()).clamp(0.0, 6.0) as usize;
    format!("{value:.decimals$}").replace('-', "−")
}

/// Multiples of a round step within the range `low` to `high`.
fn levels([low, high]: [f64; 2]) -> impl Iterator<Item = f64> {
    let step = step(high - low, LEVELS);
    let first = (low / step).ceil() as i64;
    (first..).map(move |k| k as f64 * step).take_while(move |x| *x <= high)
}

fn level(value: f64, [low, high]: [f64; 2]) -> String {
    let y = 100.0 * (high - value) / (high - low);
    let line =
        format!("<line class=\"level\" x1=\"0\" x2=\"100%\" y1=\"{y:.2}%\" y2=\"{y:.2}%\"/>");
    // there is no space for text above the topmost grid line
    let above = if y > 16.0 {
        format!(
            "<text x=\"3\" y=\"{y:.2}%\" dy=\"-3\">{}</text>",
            rounded(value, step(high - low, LEVELS))
        )
    } else {
        String::new()
    };
    line + &above
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Style;

    fn time_line() -> TimeLine {
        let span =
            |from, to, word: &str, tone| Span { time_s: [from, to], word: word.into(), tone };
        let spans = vec![
            span(0.0, 30.0, "OFF<BOARD", Tone::Asked),
            span(30.0, 30.02, "HOLD", Tone::Safe),
            span(70.0, 80.0, "LATE", Tone::Idle),
        ];
        let points = (0..7000)
            .map(|k| [0.01 * k as f64, if (3000..3100).contains(&k) { f64::NAN } else { 600.0 }]);
        let line = TraceLine { label: "h".into(), style: Style::Actual, points: points.collect() };
        TimeLine {
            title: "a flight".into(),
            span_s: [0.0, 60.0],
            states: vec![States { label: "companion".into(), spans }],
            traces: vec![Traces { label: "altitude (m)".into(), lines: vec![line] }],
            shaded_s: Some([12.0, 15.0]),
            marks_s: vec![20.0, 90.0],
        }
    }

    #[test]
    fn states_stand_where_their_time_is_and_are_read_out() {
        let html = time_line().html();
        assert!(html.contains("x=\"0.000%\" width=\"50.000%\""), "{html}");
        // A state that is too short for its word is drawn with the smallest width. Its word appears only in the title.
        assert!(html.contains("x=\"50.000%\" width=\"0.600%\""), "{html}");
        assert!(
            html.contains("OFF&lt;BOARD from 0.0 to 30.0 s, HOLD from 30.0 to 30.0 s\""),
            "{html}"
        );
        assert!(!html.contains("LATE") && !html.contains(">HOLD</text>"), "{html}");
        assert!(html.contains("class=\"shaded\" x=\"20.000%\" width=\"5.000%\""), "{html}");
        assert_eq!(html.matches("class=\"mark\"").count(), 1);
    }

    #[test]
    fn a_line_is_thinned_and_broken_at_a_gap() {
        let html = time_line().html();
        let drawn = html.split("points=\"").nth(1).unwrap().split('"').next().unwrap();
        assert!(drawn.split(' ').count() <= POINTS, "{drawn}");
        assert_eq!(html.matches("<polyline").count(), 2);
        let empty = Traces { label: "h".into(), lines: Vec::new() };
        assert!(!TimeLine { traces: vec![empty], ..time_line() }.html().contains("polyline"));
    }

    #[test]
    fn a_large_constant_has_a_range_and_points_before_the_axis_are_left_out() {
        let points = [[-5.0, 0.0], [0.0, 1e20], [60.0, 1e20]].to_vec();
        let line = TraceLine { label: "h".into(), style: Style::Actual, points };
        let traces = vec![Traces { label: "h".into(), lines: vec![line] }];
        let html = TimeLine { traces, ..time_line() }.html();
        assert!(html.contains("points=\"0.0,50.0 1000.0,50.0\""), "{html}");
        assert!(html.matches("class=\"level\"").count() < 10, "{html}");
    }

    #[test]
    fn steps_are_round() {
        assert_eq!([step(60.0, 6.0), step(7.0, 6.0), step(0.5, LEVELS)], [10.0, 2.0, 0.2]);
        assert_eq!(levels([-3.0, 12.0]).collect::<Vec<_>>(), [0.0, 5.0, 10.0]);
    }
}
