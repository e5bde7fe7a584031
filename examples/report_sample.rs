//! Writes the report page of a synthetic flight: `cargo run --example report_sample -- OUT.html`.

#[path = "../tests/report/report_synthetic.rs"]
mod synthetic;

use std::path::PathBuf;

use anyhow::Context;

fn main() -> anyhow::Result<()> {
    let out = std::env::args_os().nth(1).context("say where to write: report_sample OUT.html")?;
    let flight = synthetic::flight();
    let page = synthetic::report(&flight).page().render();
    greylag::report::write_new(&PathBuf::from(out), &page)?;
    Ok(())
}
