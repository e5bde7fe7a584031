//! Writes the report page of a synthetic diagnosis: `cargo run --example diagnosis_sample -- OUT.html`.

#[path = "../tests/report/report_comparison.rs"]
mod report_comparison;
#[path = "../tests/report/report_diagnosis.rs"]
mod report_diagnosis;

use std::path::PathBuf;

use anyhow::Context;
use greylag::report::{DiagnosisReport, write_new};

fn main() -> anyhow::Result<()> {
    let out = std::env::args_os().nth(1).context("say where: diagnosis_sample OUT.html")?;
    let failing = report_comparison::comparison(180.0);
    let held_out = report_diagnosis::held_out(report_comparison::comparison(60.0));
    let answer = held_out.answer.clone().then("greylag amend --accept".into());
    let report = DiagnosisReport {
        title: "Synthetic diagnosis".into(),
        diagnosis: &report_diagnosis::diagnosis(),
        answer: Some(&answer),
        failing: Some(&failing),
        held_out: Some(&held_out),
        effect_files: std::collections::BTreeMap::new(),
        model_file: "params/x8/prior.toml".into(),
        log_files: vec!["train-1.csv".into(), "train-2.csv".into(), "train-3.ulg".into()],
        command_line: "diagnosis_sample OUT.html".into(),
        versions: Vec::new(),
    };
    write_new(&PathBuf::from(out), &report.page().render())?;
    Ok(())
}
