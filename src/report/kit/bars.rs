//! Bar chart: one quantity for several items, with horizontal bars. Each item has one bar per model, one below the other.

use crate::Style;
use crate::kit::html::escape;
use greylag_sysid::compare::answer::multiple;

/// Groups of horizontal bars that begin at zero.
#[derive(Clone, Debug)]
pub struct Bars {
    /// Title of the figure.
    pub title: String,
    /// Unit of the values. Values in `%` are shares of a variance.
    pub unit: String,
    /// Name and style of each bar of a group (for example, of each model), in order.
    pub keys: Vec<(String, Style)>,
    /// The groups, top to bottom.
    pub groups: Vec<BarGroup>,
    /// Value at which a bar has its full length. The bar of a larger value has full length too, and is marked.
    pub full: f64,
}

/// Bars of one item: one for each of [`Bars::keys`].
#[derive(Clone, Debug)]
pub struct BarGroup {
    /// Name of the item.
    pub label: String,
    /// One value per key, in the unit of the figure; NaN if it cannot be determined.
    pub values: Vec<f64>,
}

impl Bars {
    pub(crate) fn html(&self) -> String {
        let groups: String = self.groups.iter().map(|g| self.group_html(g)).collect();
        format!(
            "<figure class=\"panel bars\"><figcaption><h3>{}</h3><span class=\"unit\">{}</span>{}\
             </figcaption>\n<dl>\n{groups}</dl></figure>\n",
            escape(&self.title),
            escape(&self.unit),
            keys_html(&self.keys)
        )
    }

    fn group_html(&self, group: &BarGroup) -> String {
        let mut html = format!("<dt>{}</dt>", escape(&group.label));
        for (value, (name, style)) in group.values.iter().zip(&self.keys) {
            let share = if value.is_finite() { 100.0 * value / self.full } else { 0.0 };
            let share = share.clamp(0.0, 100.0);
            let cut = if value.is_finite() && *value > self.full { " cut" } else { "" };
            html.push_str(&format!(
                "<dd title=\"{}\"><span class=\"track\"><i class=\"bar-fill{cut}\" \
                 style=\"width:{share:.2}%;background:var(--{})\"></i></span>\
                 <span class=\"value\">{}</span></dd>",
                escape(name),
                style.name(),
                escape(&value_text(*value, &self.unit))
            ));
        }
        html + "\n"
    }
}

/// Text of a bar's value with its unit. A large share of a variance has the form that sentences have.
pub(crate) fn value_text(value: f64, unit: &str) -> String {
    if unit == "%"
        && let Some(times) = multiple(value / 100.0)
    {
        return times;
    }
    match value {
        v if !v.is_finite() => "cannot be determined".into(),
        v if v.abs() >= 1e4 => format!("{v:.1e} {unit}"),
        v if v.abs() < 0.005 => format!("< 0.01 {unit}"),
        v if v.abs() < 0.095 => format!("{v:.2} {unit}"),
        v if v.abs() < 9.95 => format!("{v:.1} {unit}"),
        v => format!("{v:.0} {unit}"),
    }
}

/// HTML of the legend for the keys; empty for fewer than two keys.
pub(crate) fn keys_html(keys: &[(String, Style)]) -> String {
    if keys.len() < 2 {
        return String::new();
    }
    let entry = |(name, style): &(String, Style)| {
        format!(
            "<span class=\"entry\"><i class=\"swatch\" style=\"background:var(--{})\"></i>{}</span>",
            style.name(),
            escape(name)
        )
    };
    format!("<div class=\"legend\">{}</div>", keys.iter().map(entry).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bar_stays_within_its_track_whatever_its_value() {
        assert_eq!(value_text(36_600.0, "%"), "366 times its variance");
        let values = vec![250.0, f64::NAN, -3.0, f64::INFINITY];
        let keys = ["a", "b", "c", "d"].map(|k| (k.to_string(), Style::Actual)).to_vec();
        let groups = vec![BarGroup { label: "lift".into(), values }];
        let bars = Bars { title: "t".into(), unit: "%".into(), keys, groups, full: 100.0 };
        let html = bars.html();
        let widths: Vec<&str> =
            html.split("width:").skip(1).map(|w| w.split('%').next().unwrap()).collect();
        // the bar of 250 is cut off at 100; NaN, negative and infinite values give no bar
        assert_eq!(widths, ["100.00", "0.00", "0.00", "0.00"]);
        assert!(html.contains("250 %") && html.contains("cannot be determined"));
    }

    #[test]
    fn a_long_text_takes_no_width_from_its_bar() {
        let css = include_str!("assets/page.css");
        assert!(css.contains("\n.bars .value { flex: none; width: "));
        assert!(
            !css.contains(".bars .value { min-width") && css.contains(".bars .track { flex: 1;")
        );
    }
}
