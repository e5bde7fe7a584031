//! Tables of a campaign: statistics over seeds next to published values, and tests of claims.
//!
//! A campaign runs the commands of its stages with all combinations of seeds and levels. A level is one setting of an axis,
//! such as one controller of the axis "controller". Each run is a cell and has a record with its measured quantities. A
//! claim states that a quantity is smaller in the cells `less` than in the cells `than`.

use std::collections::{BTreeMap, BTreeSet};

use super::cell::Record;
use super::file::{CampaignFile, ClaimFile, SEED, TableFile};
use super::published::published;
use super::statistics::{Aggregate, Estimate, aggregate, difference, paired_difference};

/// A table of summary statistics.
#[derive(Clone, Debug)]
pub struct Summary {
    /// Title of the table.
    pub title: String,
    /// Unit of its quantities.
    pub unit: String,
    /// Number of the published table that the rows are compared with; `None` without comparison.
    pub paper: Option<String>,
    /// Rows of the table.
    pub rows: Vec<SummaryRow>,
}

/// One quantity, summarised over the cells that have the levels of the row.
#[derive(Clone, Debug)]
pub struct SummaryRow {
    /// The levels of the row's axes, joined by `/`.
    pub name: String,
    /// Name of the quantity.
    pub metric: String,
    /// Statistics of the quantity over the row's cells. Cells that differ in more than the seed belong to different strata:
    /// the bootstrap for the intervals resamples each stratum separately.
    pub ours: Aggregate,
    /// The values of the individual cells.
    pub runs: Vec<Run>,
    /// The published median, interquartile mean and mean; `None` where a statistic is not published.
    pub paper: [Option<Estimate>; 3],
}

/// One value of one cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// Id of the cell.
    pub cell: String,
    /// Random seed of the cell; `None` if its stage does not vary the seed.
    pub seed: Option<u64>,
    /// Value of the quantity.
    pub value: f64,
}

/// Test of a claim.
#[derive(Clone, Debug)]
pub struct Finding {
    /// The claim under test.
    pub says: String,
    /// Result of the test.
    pub outcome: Outcome,
    /// The values of both sides and their difference, as a sentence.
    pub because: String,
}

/// Result of a claim's test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Confirmed: the 95 % interval of the difference (mean of `than` minus mean of `less`) is above zero.
    Holds,
    /// Refuted: the 95 % interval of the difference is below zero.
    Contradicted,
    /// Undecided: the 95 % interval of the difference contains zero, or the cells of one side have fewer than three seeds.
    Undecided,
    /// Not tested: at least one side has no cell with the quantity.
    NoData,
}

impl Outcome {
    /// The result as text.
    pub fn words(self) -> &'static str {
        match self {
            Outcome::Holds => "holds",
            Outcome::Contradicted => "contradicted",
            Outcome::Undecided => "undecided",
            Outcome::NoData => "no data",
        }
    }
}

/// The tables of a campaign file, summarised over `records`.
pub fn summaries(file: &CampaignFile, records: &[Record]) -> Vec<Summary> {
    file.tables.iter().map(|table| summary(file, table, records)).collect()
}

fn summary(file: &CampaignFile, table: &TableFile, records: &[Record]) -> Summary {
    let mut rows = Vec::new();
    // the choices were checked when the file was read
    if let Ok((stage, fixed)) = file.choice(&table.stage) {
        let of_stage: Vec<&Record> = records.iter().filter(|r| r.has(&stage, &fixed)).collect();
        for metric in &table.metrics {
            for levels in row_levels(file, table) {
                rows.extend(row(table, metric, &levels, &of_stage));
            }
        }
    }
    Summary {
        title: table.title.clone(),
        unit: table.unit.clone(),
        paper: table.paper.clone(),
        rows,
    }
}

/// The combinations of levels of the table's row axes, in the order of the campaign file. Each combination forms a row.
fn row_levels(file: &CampaignFile, table: &TableFile) -> Vec<Vec<(String, String)>> {
    table.rows.iter().fold(vec![Vec::new()], |all, axis| {
        let levels = file.levels(axis);
        let with = |start: &Vec<(String, String)>| {
            let add = |l: &super::file::Level| {
                [start.clone(), vec![(axis.clone(), l.name.clone())]].concat()
            };
            levels.iter().map(add).collect::<Vec<_>>()
        };
        all.iter().flat_map(with).collect()
    })
}

fn row(
    table: &TableFile,
    metric: &str,
    levels: &[(String, String)],
    of_stage: &[&Record],
) -> Option<SummaryRow> {
    let wanted: BTreeMap<String, String> = levels.iter().cloned().collect();
    let mut strata: BTreeMap<Vec<&String>, Vec<f64>> = BTreeMap::new();
    let mut runs = Vec::new();
    let has = |r: &Record| wanted.iter().all(|(axis, level)| r.levels.get(axis) == Some(level));
    for record in of_stage.iter().filter(|r| has(r)) {
        let Some(value) = record.metrics.get(metric) else { continue };
        let others =
            record.levels.iter().filter(|(axis, _)| *axis != SEED && !wanted.contains_key(*axis));
        strata.entry(others.map(|(_, level)| level).collect()).or_default().push(*value);
        runs.push(Run { cell: record.cell.clone(), seed: record.seed, value: *value });
    }
    let ours = aggregate(&strata.into_values().collect::<Vec<_>>())?;
    let name = levels.iter().map(|(_, level)| level.as_str()).collect::<Vec<_>>().join("/");
    let paper = table.paper.as_ref().map_or([None; 3], |id| published(id, &name, metric));
    Some(SummaryRow { name, metric: metric.into(), ours, runs, paper })
}

/// Smallest number of seeds for which an interval over seeds is used. The runs of one or two seeds do not show the spread
/// over seeds, however many they are.
const FEWEST: usize = 3;

impl Summary {
    /// One sentence for each row whose 95 % interval of the mean is disjoint from the published one. Rows with fewer than
    /// three seeds are omitted.
    pub fn departures(&self) -> Vec<String> {
        self.rows.iter().filter_map(SummaryRow::departure).collect()
    }
}

impl SummaryRow {
    fn departure(&self) -> Option<String> {
        if self.runs.iter().map(|run| run.seed).collect::<BTreeSet<_>>().len() < FEWEST {
            return None;
        }
        let (ours, theirs) = (self.ours.mean, self.paper[2]?);
        let [[a, b], [c, d]] = [ours.ci95, theirs.ci95];
        let word = if b < c { "less" } else { "more" };
        (b < c || d < a).then(|| {
            format!(
                "{}, {}: mean {} here ({} runs), {} in the paper: {word}, the intervals are disjoint.",
                self.name,
                self.metric,
                said(&ours),
                self.ours.count,
                said(&theirs)
            )
        })
    }
}

/// The value and its 95 % interval as text, with three decimals.
pub fn said(estimate: &Estimate) -> String {
    let Estimate { value, ci95: [low, high] } = estimate;
    format!("{value:.3} [{low:.3}, {high:.3}]")
}

/// Tests the claims of a campaign file against `records`.
///
/// # Errors
///
/// If a claim names a stage, axis or level that does not exist.
pub fn findings(file: &CampaignFile, records: &[Record]) -> Result<Vec<Finding>, String> {
    file.claims.iter().map(|claim| finding(file, claim, records)).collect()
}

/// The levels of a cell on the axes that a claim does not fix. They usually include the seed.
type Levels = BTreeMap<String, String>;

fn finding(file: &CampaignFile, claim: &ClaimFile, records: &[Record]) -> Result<Finding, String> {
    let (stage_a, levels_a) = file.choice(&claim.less)?;
    let (stage_b, levels_b) = file.choice(&claim.than)?;
    let fixed = |axis: &str| levels_a.contains_key(axis) || levels_b.contains_key(axis);
    let side = |stage: &str, levels: &BTreeMap<String, String>| -> Vec<(Levels, f64)> {
        let cells = records.iter().filter(|r| r.has(stage, levels));
        let of = |r: &Record| Some((left(r, &fixed), *r.metrics.get(&claim.metric)?));
        cells.filter_map(of).collect()
    };
    let (less, than) = (side(&stage_a, &levels_a), side(&stage_b, &levels_b));
    let seeds = |stage: &str, levels: &BTreeMap<String, String>| {
        let cells = records.iter().filter(|r| r.has(stage, levels));
        let cells = cells.filter(|r| r.metrics.contains_key(&claim.metric));
        cells.map(|r| r.seed).collect::<BTreeSet<_>>().len()
    };
    let fewest = seeds(&stage_a, &levels_a).min(seeds(&stage_b, &levels_b));
    let says = claim.says.clone();
    let values = |of: &[(Levels, f64)]| of.iter().map(|(_, v)| *v).collect::<Vec<_>>();
    let (a, b) = (values(&less), values(&than));
    let pairs = pairs(&less, &than);
    let gap = match &pairs {
        Some(pairs) => paired_difference(pairs),
        None => difference(&a, &b),
    };
    let Some(gap) = gap else {
        let empty = if a.is_empty() { &claim.less } else { &claim.than };
        let because = format!("no cell of {empty} has {}", claim.metric);
        return Ok(Finding { says, outcome: Outcome::NoData, because });
    };
    let outcome = match gap.ci95 {
        _ if fewest < FEWEST => Outcome::Undecided,
        [low, _] if low > 0.0 => Outcome::Holds,
        [_, high] if high < 0.0 => Outcome::Contradicted,
        _ => Outcome::Undecided,
    };
    let mean = greylag_num::statistics::mean;
    let because = format!(
        "{}: {} has {:.3} (n = {}), {} has {:.3} (n = {}); difference{} {}",
        claim.metric,
        claim.less,
        mean(&a),
        a.len(),
        claim.than,
        mean(&b),
        b.len(),
        if pairs.is_some() { ", paired by seed," } else { "" },
        said(&gap)
    );
    Ok(Finding { says, outcome, because })
}

fn left(record: &Record, fixed: &dyn Fn(&str) -> bool) -> Levels {
    let open = record.levels.iter().filter(|(axis, _)| !fixed(axis));
    open.map(|(axis, level)| (axis.clone(), level.clone())).collect()
}

/// Differences of the quantity between paired cells, `than` minus `less`, with one vector for each stratum. Two cells form a
/// pair if they agree in all levels that the claim does not fix. These levels without the seed name the stratum. `None`
/// unless every cell of both sides has exactly one partner.
fn pairs(less: &[(Levels, f64)], than: &[(Levels, f64)]) -> Option<Vec<Vec<f64>>> {
    let of: BTreeMap<&Levels, f64> = than.iter().map(|(key, value)| (key, *value)).collect();
    let own: BTreeSet<&Levels> = less.iter().map(|(key, _)| key).collect();
    if own.len() != less.len() || of.len() != than.len() || own.len() != of.len() {
        return None;
    }
    let mut strata: BTreeMap<Levels, Vec<f64>> = BTreeMap::new();
    for (key, value) in less {
        let gap = of.get(key)? - value;
        let stratum = key.iter().filter(|(axis, _)| *axis != SEED);
        strata.entry(stratum.map(|(a, l)| (a.clone(), l.clone())).collect()).or_default().push(gap);
    }
    Some(strata.into_values().collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cell(prior: &str, seed: u64) -> Levels {
        [("prior", prior.to_owned()), (SEED, seed.to_string())].map(|(a, l)| (a.into(), l)).into()
    }

    /// Three cells of two seeds are too few for a comparison with the paper; three cells of three seeds suffice.
    #[test]
    fn many_cells_of_few_seeds_do_not_depart_from_the_paper() {
        let run = |k: u64, seed: u64| Run { cell: k.to_string(), seed: Some(seed), value: 1.0 };
        let row = |seeds: [u64; 3]| SummaryRow {
            name: "x".into(),
            metric: "easy.mean_deg".into(),
            ours: aggregate(&[vec![1.0; 3]]).unwrap(),
            runs: seeds.into_iter().enumerate().map(|(k, seed)| run(k as u64, seed)).collect(),
            paper: [None, None, Some(Estimate { value: 3.0, ci95: [2.0, 4.0] })],
        };
        assert_eq!(row([1, 1, 2]).departure(), None);
        assert!(row([1, 2, 3]).departure().is_some());
    }

    /// The values of different seeds differ by 10, those of the two sides by 1. Only the paired test can detect the
    /// difference between the sides.
    #[test]
    fn cells_of_one_seed_are_compared_with_each_other() {
        let side = |more: f64| -> Vec<(Levels, f64)> {
            (1..=4).map(|seed| (cell("mild", seed), 10.0 * seed as f64 + more)).collect()
        };
        let (less, than) = (side(0.0), side(1.0));
        let gap = paired_difference(&pairs(&less, &than).unwrap()).unwrap();
        assert_eq!((gap.value, gap.ci95), (1.0, [1.0, 1.0]));
        let values = |side: &[(Levels, f64)]| side.iter().map(|(_, v)| *v).collect::<Vec<_>>();
        let apart = difference(&values(&less), &values(&than)).unwrap();
        assert!(apart.ci95[0] < 0.0 && apart.ci95[1] > 2.0, "{apart:?}");
        assert!(pairs(&less[1..], &than).is_none());
        assert!(pairs(&[(cell("true", 1), 0.0)], &[(cell("mild", 1), 0.0)]).is_none());
    }
}
