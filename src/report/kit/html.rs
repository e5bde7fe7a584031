//! Escapes text and data for an HTML page.

#[cfg(feature = "study")]
use std::path::Path;

use serde::{Serialize, Serializer};

/// Largest number of file names in a line.
#[cfg(feature = "study")]
const NAMED: usize = 6;

/// Escapes the five special characters of HTML in `text` and replaces control characters. The result is safe as the text of an
/// element and inside a quoted attribute.
pub fn escape(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            // HTML text must not contain control characters, but logs may.
            c if c.is_control() && !matches!(c, '\n' | '\t') => safe.push('\u{fffd}'),
            c => safe.push(c),
        }
    }
    safe
}

/// Lists the file names of `paths` without their folders, at most `NAMED` of them. A page's section on provenance has the full
/// paths.
#[cfg(feature = "study")]
pub(crate) fn file_names(paths: &[String]) -> String {
    let name = |path: &String| {
        Path::new(path).file_name().map_or(path.clone(), |name| name.to_string_lossy().into_owned())
    };
    let mut names: Vec<String> = paths.iter().take(NAMED).map(name).collect();
    if paths.len() > NAMED {
        names.push(format!("{} more", paths.len() - NAMED));
    }
    names.join(", ")
}

/// Serialises `data` as JSON for a `<script>` element. The JSON contains no `<`, so neither `</script>` nor `<!--` can end the
/// element.
pub(crate) fn script_json<T: Serialize>(data: &T) -> String {
    serde_json::to_string(data)
        .expect("figures are structs of strings and numbers, which JSON can hold")
        .replace('<', "\\u003c")
}

/// Serialises values with six significant digits: finer than a screen resolves, and within the precision of an f32. A value that
/// is not finite becomes `null`.
pub(crate) fn compact<S: Serializer>(values: &[f64], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(values.iter().map(|&v| six_digits(v)))
}

/// Serialises times, s, with a resolution of 0.1 ms. Six significant digits would not suffice after 1000 s.
pub(crate) fn compact_time<S: Serializer>(times: &[f64], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(times.iter().map(|t| (t * 1e4).round() / 1e4))
}

fn six_digits(value: f64) -> f32 {
    if value == 0.0 || !value.is_finite() {
        return value as f32;
    }
    let unit = 10f64.powi(5 - value.abs().log10().floor() as i32);
    let rounded = (value * unit).round() / unit;
    if rounded.is_finite() { rounded as f32 } else { value as f32 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn escapes_every_special_character() {
        assert_eq!(escape("<a b='\"&'>\u{7}"), "&lt;a b=&#39;&quot;&amp;&#39;&gt;\u{fffd}");
    }

    #[test]
    fn json_cannot_end_its_script_element() {
        let json = script_json(&["</script><!--"]);
        assert!(!json.contains('<'));
        let back: Vec<String> = serde_json::from_str(&json).unwrap();
        assert_eq!(back, ["</script><!--"]);
    }

    #[test]
    fn numbers_keep_six_digits_and_lose_nan() {
        #[derive(Serialize)]
        struct Values(#[serde(serialize_with = "compact")] Vec<f64>);
        let values =
            Values(vec![std::f64::consts::PI, -0.000_123_456_78, 1e300, f64::NAN, 0.0, 1e-320]);
        // 1e300 exceeds the range of f32 and becomes null.
        assert_eq!(script_json(&values), "[3.14159,-0.000123457,null,null,0.0,0.0]");
    }
}
