//! Writes the report page of a synthetic amendment: `cargo run --example amendment_sample -- OUT.html`.

#[path = "../tests/report/report_amendment.rs"]
mod report_amendment;

use std::path::PathBuf;

use anyhow::Context;
use greylag::report::{AmendmentReport, write_new};
use greylag::sysid::amend::Prior;

fn main() -> anyhow::Result<()> {
    let out = std::env::args_os().nth(1).context("say where: amendment_sample OUT.html")?;
    let report = AmendmentReport {
        title: "Synthetic amendment".into(),
        amendment: &report_amendment::amendment(),
        answer: None,
        held_out: None,
        model_files: vec!["params/x8/prior.toml".into(), "amended/model.toml".into()],
        log_files: vec!["train-1.csv".into(), "train-2.csv".into()],
        prior: Prior::File,
        command_line: "amendment_sample OUT.html".into(),
        versions: Vec::new(),
    };
    write_new(&PathBuf::from(out), &report.page().render())?;
    Ok(())
}
