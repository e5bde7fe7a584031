//! Record of the progress of `greylag learn` on disk. An interrupted run resumes from the record.
//!
//! `greylag learn` works in stages; each stage is one command line, such as the training of a policy.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use serde::{Deserialize, Serialize};

use super::plan::{FLIGHTS, Stage};
use crate::commands::files::{self, Overwrite};
use crate::model::residual::hash;

/// Name of the record's file.
pub const RECORD: &str = "learn.json";
/// Schema of the record's file.
const SCHEMA: &str = "greylag.learn/1";

/// Content of the record's file.
#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct File {
    schema: String,
    program: String,
    /// SHA-256 of prior model, airframe, logs, commands and program version.
    identity: String,
    stages: Vec<Done>,
}

/// A stage that is completed.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Done {
    /// Description of the stage's result.
    pub what: String,
    /// Command line of the stage.
    pub command: String,
    /// Duration of the process that completed the stage, s.
    pub seconds: f64,
}

/// The record in the output folder of `greylag learn`.
#[derive(Debug)]
pub struct Record {
    path: PathBuf,
    file: File,
}

impl Record {
    /// Opens the record in `folder` and checks that it belongs to a run with these `stages` and `inputs` (hashes of its input
    /// files). If there is no record, an empty one is written.
    ///
    /// # Errors
    /// If the folder holds the record of another run or flights without a record, or cannot be read or written.
    pub fn open(folder: &Path, stages: &[Stage], inputs: &[String]) -> Result<Record> {
        let path = folder.join(RECORD);
        let lines = stages.iter().map(|s| s.command() + "\n").collect::<String>();
        let program = concat!("greylag ", env!("CARGO_PKG_VERSION")).to_owned();
        let identity = hash(format!("{program}\n{}\n{lines}", inputs.join("\n")).as_bytes());
        let empty = File { schema: SCHEMA.into(), program, identity, stages: Vec::new() };
        if !path.exists() {
            if folder.join(FLIGHTS).exists() {
                bail!(
                    "{} holds flights without a record of the learning that they belong to; give another --out",
                    folder.display()
                );
            }
            let record = Record { path, file: empty };
            record.save()?;
            return Ok(record);
        }
        let text = std::fs::read_to_string(&path)
            .with_context(|| format!("cannot read {}", path.display()))?;
        let file: File = serde_json::from_str(&text).with_context(|| {
            format!("{} is no record of a learning; give another --out", path.display())
        })?;
        if (&file.schema, &file.identity) != (&empty.schema, &empty.identity) {
            bail!(
                "{} holds a learning with other options, another prior or another version of this program; \
                 give the same ones, or another --out",
                folder.display()
            );
        }
        Ok(Record { path, file })
    }

    /// The completed stages in their order.
    pub fn done(&self) -> &[Done] {
        &self.file.stages
    }

    /// Records that a further stage is completed.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn add(&mut self, stage: &Stage, seconds: f64) -> Result<()> {
        let (what, command) = (stage.what.clone(), stage.command());
        self.file.stages.push(Done { what, command, seconds });
        self.save()
    }

    fn save(&self) -> Result<()> {
        let text = serde_json::to_string_pretty(&self.file)? + "\n";
        files::write(&self.path, &text, Overwrite::Force)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stage(line: &str) -> Stage {
        Stage { what: "flights".into(), line: vec![line.into()] }
    }

    #[test]
    fn a_learning_goes_on_and_another_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let stages = [stage("one"), stage("two")];
        let open =
            |stages: &[Stage], prior: &str| Record::open(folder.path(), stages, &[prior.into()]);
        // a run that was interrupted in its first stage has an empty record
        open(&stages, "p").unwrap();
        assert!(open(&stages, "q").unwrap_err().to_string().contains("another --out"));
        open(&stages, "p").unwrap().add(&stages[0], 1.5).unwrap();
        let again = open(&stages, "p").unwrap();
        assert_eq!(again.done().len(), 1);
        assert_eq!(again.done()[0].command, "greylag one");
        for other in [open(&stages[..1], "p"), open(&stages, "q")] {
            assert!(other.unwrap_err().to_string().contains("another --out"));
        }
        std::fs::write(folder.path().join(RECORD), "{").unwrap();
        assert!(open(&stages, "p").unwrap_err().to_string().contains(RECORD));
    }
}
