//! `greylag campaign report`: summarises the results of a campaign in tables and on a page. The runs of a campaign are
//! called cells.

use std::collections::{BTreeSet, HashSet};
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Result, bail};
use comfy_table::Table;

use super::Which;
use crate::campaign::gather::{gather, read_lines};
use crate::campaign::tables::{Finding, Summary, findings, said, summaries};
use crate::campaign::{Plan, Record, Store};
use crate::commands::files::{self, Overwrite, shipped};
use crate::commands::outputs;
use crate::commands::status::IN_DOUBT;
use crate::report::CampaignReport;

/// Options of `greylag campaign report`.
#[derive(clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    which: Which,
    /// Take the results from a file that `greylag campaign gather` wrote, not from the cells' folders.
    #[arg(long, value_name = "FILE.jsonl")]
    results: Option<PathBuf>,
    /// Write the tables and curves as an HTML page.
    #[arg(long, value_name = "OUT.html")]
    report: Option<PathBuf>,
    /// Write the tables as Markdown.
    #[arg(long, value_name = "OUT.md")]
    tables: Option<PathBuf>,
    /// Replace the files if they exist.
    #[arg(long)]
    force: bool,
}

/// Prints the tables, and writes the files that the options request. The exit status is 3 if a cell has no result.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    let overwrite: Overwrite = arguments.force.into();
    let written = arguments.report.iter().chain(&arguments.tables);
    let inputs = arguments.results.iter().cloned().chain([shipped(&arguments.which.file)]);
    outputs::check(written, inputs, overwrite)?;
    let (plan, store) = arguments.which.open()?;
    let records = arguments.records(&plan, &store)?;
    if records.is_empty() {
        bail!("no cell of campaign {} is done; run greylag campaign run first", plan.file.name);
    }
    let programs: BTreeSet<&str> = records.iter().map(|r| r.program.as_str()).collect();
    if programs.len() > 1 {
        let all: Vec<&str> = programs.into_iter().collect();
        println!(
            "the results come from several program versions: {}; run the cells again with one of them",
            all.join(", ")
        );
    }
    let summaries = summaries(&plan.file, &records);
    let findings = findings(&plan.file, &records).map_err(anyhow::Error::msg)?;
    print!("{}", text(&summaries, &findings, comfy_table::presets::UTF8_FULL_CONDENSED));
    if let Some(path) = &arguments.tables {
        let text = text(&summaries, &findings, comfy_table::presets::ASCII_MARKDOWN);
        files::write(path, &text, overwrite)?;
    }
    if let Some(path) = &arguments.report {
        let report = CampaignReport {
            file: &plan.file,
            cells: plan.cells.len(),
            records: &records,
            summaries: &summaries,
            findings: &findings,
            command: files::command_line(),
        };
        files::write(path, &report.page().render(), overwrite)?;
        println!("report in {}", path.display());
    }
    let whole = records.len() == plan.cells.len();
    Ok(if whole { ExitCode::SUCCESS } else { ExitCode::from(IN_DOUBT) })
}

impl Arguments {
    /// Returns the results of the plan's cells. Prints how many cells have no result, and how many results of the file belong
    /// to no cell.
    fn records(&self, plan: &Plan, store: &Store) -> Result<Vec<Record>> {
        let Some(path) = &self.results else {
            let all = gather(plan, store)?;
            super::gather::print_unfinished(&all);
            return Ok(all.records);
        };
        let mut records = read_lines(path)?;
        let all = records.len();
        // cells with the same command and inputs have the same identity, so the cell's name is compared too
        let planned: HashSet<(&str, &str)> =
            plan.cells.iter().map(|c| (c.id.as_str(), c.identity.as_str())).collect();
        records.retain(|r| planned.contains(&(r.cell.as_str(), r.identity.as_str())));
        if records.len() < all {
            println!(
                "{} of the {all} results in {} are stale (another command or input) and left out",
                all - records.len(),
                path.display()
            );
        }
        let mut known = HashSet::new();
        records.retain(|r| known.insert(r.cell.clone()));
        let missing = plan.cells.len() - records.len();
        if missing > 0 {
            println!("{missing} of {} cells are missing in {}", plan.cells.len(), path.display());
        }
        Ok(records)
    }
}

/// The tables as text, and whether the results support the claims that the campaign file states.
fn text(summaries: &[Summary], findings: &[Finding], preset: comfy_table::TableStyle) -> String {
    let mut text = String::new();
    for summary in summaries {
        let paper =
            summary.paper.as_ref().map_or(String::new(), |id| format!("; paper: Table {id}"));
        let unit = if summary.unit.is_empty() { "" } else { &format!(" ({})", summary.unit) };
        text += &format!("{}{unit}{paper}\n\n{}\n\n", summary.title, table(summary, preset));
        for sentence in summary.departures() {
            text += &format!("- {sentence}\n");
        }
        text.push('\n');
    }
    for Finding { says, outcome, because } in findings {
        text += &format!("- {says}: **{}**. {because}.\n", outcome.words());
    }
    text
}

fn table(summary: &Summary, preset: comfy_table::TableStyle) -> Table {
    let mut table = Table::new();
    table.load_style(preset);
    let mut head =
        vec!["row", "quantity", "runs", "median [95 %]", "IQM [95 %]", "mean [95 %]", "min", "max"];
    let papers = ["paper's median", "paper's IQM", "paper's mean"];
    let shown: Vec<usize> =
        (0..3).filter(|k| summary.rows.iter().any(|row| row.paper[*k].is_some())).collect();
    head.extend(shown.iter().map(|k| papers[*k]));
    table.set_header(head);
    for row in &summary.rows {
        let ours = &row.ours;
        let mut cells = vec![row.name.clone(), row.metric.clone(), ours.count.to_string()];
        cells.extend([ours.median, ours.iqm, ours.mean].iter().map(said));
        cells.extend([ours.min, ours.max].map(|x| format!("{x:.3}")));
        cells.extend(shown.iter().map(|k| row.paper[*k].as_ref().map_or("–".into(), said)));
        table.add_row(cells);
    }
    table
}
