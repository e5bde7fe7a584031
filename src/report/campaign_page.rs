//! Page of a campaign: findings, tables with the paper's values, and the source of each number.
//!
//! A campaign is a planned set of runs over controllers, models and seeds. A cell is one of these runs. A stage is one command
//! with all its cells. The paper is T. Guerin et al., 2026.

use std::collections::BTreeMap;

use super::Align::{Left, Right};
use super::kit::numbers::number;
use super::{
    Curves, Figure, Finding, Findings, Page, Range, Row, Scale, Section, Series, Style, Table,
    Whisker, Whiskers,
};
use greylag_campaign::statistics::{Estimate, aggregate};
use greylag_campaign::tables::{self, Summary, SummaryRow};
use greylag_campaign::{CampaignFile, Record};

/// Names of the three statistics of each table row.
const STATISTICS: [&str; 3] = ["median", "interquartile mean", "mean"];

/// Results of a finished or unfinished campaign.
#[derive(Clone, Debug)]
pub struct CampaignReport<'a> {
    /// Definition of the campaign.
    pub file: &'a CampaignFile,
    /// Number of cells in the campaign.
    pub cells: usize,
    /// Results of the finished cells.
    pub records: &'a [Record],
    /// Summary tables over the cells.
    pub summaries: &'a [Summary],
    /// Verdict on each claim that the campaign file makes.
    pub findings: &'a [tables::Finding],
    /// The command that generated the page.
    pub command: String,
}

impl CampaignReport<'_> {
    /// Builds the page of the campaign.
    pub fn page(&self) -> Page {
        let mut sections = vec![self.said()];
        sections.extend(self.summaries.iter().enumerate().map(|(t, s)| summary(t, s)));
        sections.extend(self.curves());
        sections.extend([self.runs(), self.done(), self.provenance()]);
        let subtitle =
            format!("{} {} of {} cells are done.", self.file.about, self.records.len(), self.cells);
        Page { title: format!("Campaign {}", self.file.name), subtitle, sections }
    }

    /// Section with the verdicts on the claims, and with the differences between the tables and those of the paper.
    fn said(&self) -> Section {
        let sentence = |sentence: String| Finding { sentence, link: None };
        let claims = self
            .findings
            .iter()
            .map(|f| sentence(format!("{}: {}. {}.", f.says, f.outcome.words(), f.because)));
        let departures = self.summaries.iter().flat_map(Summary::departures).map(sentence);
        let note = "A claim holds if the 95 % interval of the difference of means, resampled over seeds, lies above \
                    zero. With three seeds such an interval is too narrow; ten are the paper's.";
        let (lead, rest) = (claims.collect(), departures.collect());
        let findings = Findings { lead, rest, ..Findings::default() };
        Section::new("Findings", note, vec![Figure::Findings(findings)])
    }

    /// Section with the learning curves of each stage; `None` if no stage has any.
    fn curves(&self) -> Option<Section> {
        let mut stages: Vec<&str> = Vec::new();
        // the records of several machines may be interleaved
        for record in self.records.iter().filter(|r| !r.curve.is_empty()) {
            if !stages.contains(&record.stage.as_str()) {
                stages.push(&record.stage);
            }
        }
        let quantities = [
            ("easy_deg", "settled error, easy targets (°)"),
            ("hard_deg", "settled error, hard targets (°)"),
            ("reward", "reward of a step"),
        ];
        let figures: Vec<Figure> = stages
            .iter()
            .flat_map(|stage| quantities.map(|(column, label)| self.curve(stage, column, label)))
            .map(Figure::Curves)
            .collect();
        let note = "Lines: interquartile mean of the seeds. Shaded: its 95 % bootstrap interval over seeds. Flown in what \
                    the policy is trained in.";
        (!figures.is_empty()).then(|| Section::new("Learning curves", note, figures))
    }

    fn curve(&self, stage: &str, column: &str, label: &str) -> Curves {
        let mut groups: BTreeMap<String, Vec<&Record>> = BTreeMap::new();
        for record in self.records.iter().filter(|r| r.stage == stage && !r.curve.is_empty()) {
            let levels = record.levels.iter().filter(|(axis, _)| *axis != "seed");
            let name = levels.map(|(_, level)| level.as_str()).collect::<Vec<_>>().join("/");
            groups.entry(name).or_default().push(record);
        }
        let steps = |r: &&Record| r.curve.get("steps").cloned().unwrap_or_default();
        let mut x: Vec<f64> = groups.values().flatten().flat_map(steps).collect();
        x.sort_by(f64::total_cmp);
        x.dedup();
        let mut figure = Curves {
            title: format!("{stage}: {label}"),
            x_label: "steps".into(),
            y_label: label.into(),
            x: x.clone(),
            linear: column == "reward",
            ..Curves::default()
        };
        for (k, (name, records)) in groups.iter().enumerate() {
            let at = |steps: &f64| middle(records, column, *steps);
            let estimates: Vec<Option<Estimate>> = x.iter().map(at).collect();
            let get = |f: &dyn Fn(&Estimate) -> f64| {
                estimates.iter().map(|e| e.as_ref().map_or(f64::NAN, f)).collect::<Vec<f64>>()
            };
            let name = if name.is_empty() { stage } else { name };
            figure.series.push(Series::new(name, Style::nth(k), get(&|e| e.value)));
            figure.ranges.push(Range {
                of: k,
                low: get(&|e| e.ci95[0]),
                high: get(&|e| e.ci95[1]),
            });
        }
        figure
    }

    /// Section with the numbers behind the tables, each with its seed and a link to the command of its cell.
    fn runs(&self) -> Section {
        let columns =
            [("Cell", Left), ("Seed", Right), ("Row", Left), ("Quantity", Left), ("Value", Right)];
        let mut table = Table::new("Numbers", &columns);
        for (t, summary) in self.summaries.iter().enumerate() {
            for (r, row) in summary.rows.iter().enumerate() {
                for (k, run) in row.runs.iter().enumerate() {
                    let cells = vec![
                        run.cell.clone(),
                        run.seed.map_or("–".into(), |seed| seed.to_string()),
                        row.name.clone(),
                        row.metric.clone(),
                        number(run.value),
                    ];
                    let anchor = (k == 0).then(|| numbers_of(t, r));
                    let link = Some(anchor_of(&run.cell));
                    table.rows.push(Row { cells, anchor, link, span_s: None });
                }
            }
        }
        let note =
            "The numbers that each row of the tables sums up. A cell's name leads to its command.";
        Section::new("Numbers", note, vec![Figure::Table(table)])
    }

    /// Section with the cells that have a result, and their commands.
    fn done(&self) -> Section {
        let columns = [
            ("Cell", Left),
            ("Seed", Right),
            ("Identity", Left),
            ("Build", Left),
            ("Command", Left),
        ];
        let mut table = Table::new("Cells", &columns);
        for r in self.records {
            let cells = vec![
                r.cell.clone(),
                r.seed.map_or("–".into(), |seed| seed.to_string()),
                r.identity.chars().take(12).collect(),
                r.program.clone(),
                r.command.clone(),
            ];
            table.rows.push(Row { cells, anchor: Some(anchor_of(&r.cell)), ..Row::default() });
        }
        let note = "The command of each cell; $OUT is the campaign's folder. The same identity gives the same numbers.";
        Section::new("Cells", note, vec![Figure::Table(table)])
    }

    fn provenance(&self) -> Section {
        let mut table = Table::new("Provenance", &[("Item", Left), ("Value", Left)]);
        let mut builds: Vec<&str> = self.records.iter().map(|r| r.program.as_str()).collect();
        builds.sort_unstable();
        builds.dedup();
        for (item, value) in [
            ("Campaign file", format!("SHA-256 {}", self.file.sha256)),
            ("Seeds", format!("{:?}", self.file.seeds)),
            ("Builds", builds.join("; ")),
            ("Command line", self.command.clone()),
            ("Plots", "uPlot 1.6.32 (MIT)".into()),
        ] {
            table.push([item.into(), value]);
        }
        Section::new("Provenance", "", vec![Figure::Table(table)])
    }
}

/// The interquartile mean of the learning curves at training step `steps`. `records` holds one learning curve per seed, and
/// `column` is the plotted quantity. `None` unless every curve has a value at this step.
fn middle(records: &[&Record], column: &str, steps: f64) -> Option<Estimate> {
    let value = |record: &&Record| {
        let at = record.curve.get("steps")?.iter().position(|s| *s == steps)?;
        record.curve.get(column)?.get(at).copied()
    };
    let values: Vec<f64> = records.iter().map(value).collect::<Option<_>>()?;
    Some(aggregate(&[values])?.iqm)
}

fn anchor_of(cell: &str) -> String {
    format!("cell-{}", cell.replace('/', "-"))
}

fn numbers_of(table: usize, row: usize) -> String {
    format!("numbers-{table}-{row}")
}

fn summary(index: usize, summary: &Summary) -> Section {
    let mut metrics: Vec<&str> = summary.rows.iter().map(|r| r.metric.as_str()).collect();
    metrics.dedup();
    let mut figures: Vec<Figure> =
        metrics.iter().map(|metric| Figure::Whiskers(intervals(summary, metric))).collect();
    figures.push(Figure::Table(table(index, summary)));
    let beside = match &summary.paper {
        Some(id) => format!(" Grey: Table {id} of the paper."),
        None => String::new(),
    };
    let note = format!(
        "Median, interquartile mean and mean over the runs, with 95 % percentile bootstrap intervals over seeds, \
         each stratum resampled separately. A row's name leads to its numbers.{beside}"
    );
    Section::new(&summary.title, &note, figures)
}

/// The three statistics of each row for the quantity `metric`, each followed by the paper's value.
fn intervals(summary: &Summary, metric: &str) -> Whiskers {
    let mut rows = Vec::new();
    for row in summary.rows.iter().filter(|r| r.metric == metric) {
        let ours = [row.ours.median, row.ours.iqm, row.ours.mean];
        for (k, name) in STATISTICS.iter().enumerate() {
            rows.push(whisker(format!("{}, {name}", row.name), Style::Actual, ours[k]));
            if let Some(theirs) = row.paper[k] {
                rows.push(whisker(format!("{}, {name}, paper", row.name), Style::Measured, theirs));
            }
        }
    }
    let positive = rows.iter().all(|r: &Whisker| r.value > 0.0);
    Whiskers {
        title: metric.into(),
        unit: summary.unit.clone(),
        scale: if positive { Scale::Log { floor: 1e-4 } } else { Scale::Linear },
        lines: Vec::new(),
        legend: String::new(),
        rows,
    }
}

fn whisker(label: String, style: Style, estimate: Estimate) -> Whisker {
    Whisker { label, style, value: estimate.value, interval: estimate.ci95, text: text(&estimate) }
}

fn text(Estimate { value, ci95: [low, high] }: &Estimate) -> String {
    format!("{} [{}, {}]", number(*value), number(*low), number(*high))
}

fn table(index: usize, summary: &Summary) -> Table {
    let columns = [
        ("Row", Left),
        ("Quantity", Left),
        ("Runs", Right),
        ("Median", Right),
        ("IQM", Right),
        ("Mean", Right),
        ("Least, most", Right),
        ("Paper's median", Right),
        ("Paper's IQM", Right),
        ("Paper's mean", Right),
    ];
    let mut table = Table::new(&summary.title, &columns);
    for (k, row) in summary.rows.iter().enumerate() {
        let link = Some(numbers_of(index, k));
        table.rows.push(Row { cells: cells(row), link, ..Row::default() });
    }
    table
}

fn cells(row: &SummaryRow) -> Vec<String> {
    let ours = &row.ours;
    let mut cells = vec![row.name.clone(), row.metric.clone(), ours.count.to_string()];
    cells.extend([ours.median, ours.iqm, ours.mean].iter().map(text));
    cells.push(format!("{}, {}", number(ours.min), number(ours.max)));
    cells.extend(row.paper.iter().map(|p| p.as_ref().map_or("–".into(), text)));
    cells
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_without_steps_has_no_mean() {
        let record = |column: &str| Record {
            schema: Record::SCHEMA.into(),
            campaign: "c".into(),
            cell: "cell".into(),
            stage: "train".into(),
            levels: BTreeMap::new(),
            seed: Some(1),
            identity: String::new(),
            program: String::new(),
            command: String::new(),
            inputs: BTreeMap::new(),
            files: BTreeMap::new(),
            metrics: BTreeMap::new(),
            curve: BTreeMap::from([(column.to_owned(), vec![1.0])]),
        };
        assert!(middle(&[&record("easy_deg")], "easy_deg", 1.0).is_none());
        assert!(middle(&[&record("steps")], "steps", 1.0).is_some());
    }
}
