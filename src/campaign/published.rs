//! Statistics over seeds that \[GSFM26\] (T. Guerin et al., 2026, see `src/lib.rs`) publishes. A campaign, a planned set of
//! runs of this program, is compared with them.
//!
//! `published.csv` contains Tables IV, VIII, IX, X (which includes Table III) and XI of \[GSFM26\] as printed. Its column
//! `row` names settings as campaign files do, such as `severe/trainable`, `parallel` and `hybrid`. Its column `targets`
//! names groups of target attitudes as `greylag evaluate` does.

use std::sync::LazyLock;

use super::statistics::Estimate;

/// A row of `published.csv`.
struct Line {
    table: &'static str,
    row: &'static str,
    targets: &'static str,
    statistic: &'static str,
    estimate: Estimate,
}

static LINES: LazyLock<Vec<Line>> =
    LazyLock::new(|| include_str!("published.csv").lines().skip(1).filter_map(line).collect());

fn line(text: &'static str) -> Option<Line> {
    let parts: Vec<&str> = text.split(',').collect();
    let [table, row, targets, statistic, value, low, high] = parts[..] else { return None };
    let number = |text: &str| text.parse::<f64>().ok();
    let estimate = Estimate { value: number(value)?, ci95: [number(low)?, number(high)?] };
    Some(Line { table, row, targets, statistic, estimate })
}

/// Numbers of the published tables, such as `IV`, in the order of the file.
pub fn tables() -> Vec<&'static str> {
    let mut tables: Vec<&str> = LINES.iter().map(|line| line.table).collect();
    tables.dedup();
    tables
}

/// Published median, interquartile mean and mean of the quantity `metric`, for the setting `row` in a table. A statistic
/// that is not published is `None`. `metric` is a target group and a quantity. The quantity `mean_deg` is an error in
/// degrees. The quantity `divergence_rate` is a fraction, of which only the mean is published.
pub fn published(table: &str, row: &str, metric: &str) -> [Option<Estimate>; 3] {
    let (targets, quantity) = metric.rsplit_once('.').unwrap_or(("", metric));
    let find = |statistic: &str| {
        let same = |l: &&Line| (l.table, l.row, l.targets) == (table, row, targets);
        Some(LINES.iter().filter(same).find(|l| l.statistic == statistic)?.estimate)
    };
    match quantity {
        "mean_deg" => ["median", "iqm", "mean"].map(find),
        "divergence_rate" => [None, None, find("divergence").map(part)],
        _ => [None; 3],
    }
}

/// Converts an estimate from percent to a fraction.
fn part(percent: Estimate) -> Estimate {
    Estimate { value: percent.value / 100.0, ci95: percent.ci95.map(|end| end / 100.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_is_read_and_lies_in_its_interval() {
        // Tables IV and XI have 15 entries each, X has 18 and IX has 9, all with three statistics; VIII has 15 with one statistic
        assert_eq!(LINES.len(), 3 * (15 + 15 + 18 + 9) + 15);
        assert_eq!(tables(), ["X", "IX", "XI", "IV", "VIII"]);
        for Line { table, row, estimate: Estimate { value, ci95: [low, high] }, .. } in LINES.iter()
        {
            assert!(low <= value && value <= high, "{table} {row} {value}");
        }
        let [_, _, mean] = published("X", "severe/trainable", "hard_corners.mean_deg");
        assert_eq!(mean, Some(Estimate { value: 1.94, ci95: [1.53, 2.40] }));
        let [_, _, lost] = published("VIII", "cem", "easy.divergence_rate");
        assert!((lost.unwrap().value - 0.071).abs() < 1e-12);
    }
}
