//! Values with their intervals, one per row, on one horizontal scale.

use crate::kit::html::escape;
use crate::kit::numbers::number;
use crate::{Scale, Style};

/// Margin beyond the outermost intervals, as a fraction of the range that all intervals cover.
const ROOM: f64 = 0.06;

/// A figure of values with intervals, one per row.
#[derive(Clone, Debug)]
pub struct Whiskers {
    /// Title of the figure.
    pub title: String,
    /// Unit of the scale.
    pub unit: String,
    /// Scale of the horizontal axis. On a logarithmic scale, values below the floor are drawn at the floor.
    pub scale: Scale,
    /// Positions of vertical lines behind the values, in the unit of the scale.
    pub lines: Vec<f64>,
    /// Explanation of the vertical lines, shown below the figure.
    pub legend: String,
    /// The values, top to bottom.
    pub rows: Vec<Whisker>,
}

/// A value with its interval.
#[derive(Clone, Debug)]
pub struct Whisker {
    /// Name of the value.
    pub label: String,
    /// Style of the mark.
    pub style: Style,
    /// The value, in the unit of the scale; NaN if there is none.
    pub value: f64,
    /// Ends of the 95 % interval, in the unit of the scale.
    pub interval: [f64; 2],
    /// Text that states the value and its interval.
    pub text: String,
}

impl Whiskers {
    /// Position of a value on the scale: the value itself, or its decimal logarithm.
    fn on_scale(&self, x: f64) -> f64 {
        match self.scale {
            Scale::Linear => x,
            Scale::Log { .. } if x.is_nan() => x,
            Scale::Log { floor } => x.max(floor).log10(),
        }
    }

    /// Ends of the horizontal scale; `None` if no value is finite.
    fn ends(&self) -> Option<[f64; 2]> {
        let values = self.rows.iter().flat_map(|r| [r.value, r.interval[0], r.interval[1]]);
        let all = values.chain(self.lines.iter().copied()).map(|v| self.on_scale(v));
        let all = all.filter(|v| v.is_finite());
        let [low, high] =
            all.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(v), b.max(v)]);
        let width = high - low;
        let room = if width > 0.0 { ROOM * width } else { low.abs().max(1.0) };
        (low <= high && width.is_finite()).then_some([low - room, high + room])
    }

    pub(crate) fn html(&self) -> String {
        let [low, high] = self.ends().unwrap_or([0.0, 1.0]);
        let place = |x: f64| (100.0 * (self.on_scale(x) - low) / (high - low)).clamp(0.0, 100.0);
        let shown = |x: f64| match self.scale {
            Scale::Linear => number(x),
            Scale::Log { .. } => number(10f64.powf(x)),
        };
        let lines: String = self
            .lines
            .iter()
            .filter(|at| at.is_finite())
            .map(|at| format!("<i class=\"tick\" style=\"left:{:.2}%\"></i>", place(*at)))
            .collect();
        let rows: String = self.rows.iter().map(|r| r.html(&place, &lines)).collect();
        format!(
            "<figure class=\"panel whiskers\"><figcaption><h3>{}</h3><span class=\"unit\">{}</span>\
             </figcaption>\n<dl>\n{rows}<dt class=\"ends\"></dt><dd class=\"ends\">\
             <span class=\"track\"><span>{}</span><span>{}</span><span>{}</span></span>\
             <span class=\"value\"></span></dd></dl></figure>\n",
            escape(&self.title),
            escape(&self.unit),
            shown(low),
            escape(&self.legend),
            shown(high)
        )
    }
}

impl Whisker {
    fn html(&self, place: &dyn Fn(f64) -> f64, lines: &str) -> String {
        let ink = self.style.name();
        let mut marks = String::new();
        if let [a, b] = self.interval
            && a.is_finite()
            && b.is_finite()
        {
            let (left, right) = (place(a.min(b)), place(a.max(b)));
            marks.push_str(&format!(
                "<i class=\"whisker\" style=\"left:{left:.2}%;width:{:.2}%;background:var(--{ink})\"></i>",
                right - left
            ));
        }
        if self.value.is_finite() {
            marks.push_str(&format!(
                "<i class=\"point\" style=\"left:{:.2}%;background:var(--{ink})\"></i>",
                place(self.value)
            ));
        }
        format!(
            "<dt>{}</dt><dd><span class=\"track\">{lines}{marks}</span>\
             <span class=\"value\">{}</span></dd>\n",
            escape(&self.label),
            escape(&self.text)
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(value: f64, interval: [f64; 2]) -> Whisker {
        Whisker { label: "a".into(), style: Style::Actual, value, interval, text: "t".into() }
    }

    #[test]
    fn whiskers_stay_within_their_track_whatever_they_are() {
        let rows = vec![
            row(1.0, [0.0, 2.0]),
            row(f64::NAN, [f64::NEG_INFINITY, 1.0]),
            row(1e300, [-1e300, 1e308]),
        ];
        let scales = [Scale::Linear, Scale::Log { floor: 1e-3 }];
        let all = [rows.clone(), rows[1..2].to_vec(), Vec::new()];
        for (rows, scale) in all.into_iter().flat_map(|r| scales.map(|s| (r.clone(), s))) {
            let (lines, legend) = (vec![0.0, f64::NAN], "none".into());
            let (title, unit) = ("t".into(), "u".into());
            let figure = Whiskers { title, unit, scale, lines, legend, rows };
            let html = figure.html();
            assert!(!html.contains("NaN") && !html.contains("inf"), "{html}");
            for part in html.split("left:").skip(1) {
                let left: f64 = part.split('%').next().unwrap().parse().unwrap();
                assert!((0.0..=100.0).contains(&left));
            }
        }
    }

    #[test]
    fn one_value_stands_in_the_middle() {
        let figure = Whiskers {
            title: "t".into(),
            unit: String::new(),
            scale: Scale::Linear,
            lines: Vec::new(),
            legend: String::new(),
            rows: vec![row(3.0, [3.0, 3.0])],
        };
        assert!(figure.html().contains("class=\"point\" style=\"left:50.00%"));
    }
}
