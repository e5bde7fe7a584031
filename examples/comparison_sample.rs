//! Writes the report page of a synthetic comparison: `cargo run --example comparison_sample -- OUT.html`.

#[path = "../tests/report/report_comparison.rs"]
mod synthetic;

use std::path::PathBuf;

use anyhow::Context;
use greylag::report::{ComparisonReport, write_new};

fn main() -> anyhow::Result<()> {
    let out = std::env::args_os().nth(1).context("say where: comparison_sample OUT.html")?;
    // two flights of together ten minutes, the duration for which the page is designed
    let comparison = synthetic::comparison(300.0);
    let report = ComparisonReport {
        title: "Synthetic comparison".into(),
        comparison: &comparison,
        model_files: vec!["params/x8/prior-as-printed.toml".into(), "amended.toml".into()],
        log_files: vec!["flight-a.csv".into(), "flight-b.ulg".into()],
        command_line: "comparison_sample OUT.html".into(),
        versions: Vec::new(),
    };
    write_new(&PathBuf::from(out), &report.page().render())?;
    Ok(())
}
