//! The tasks in PyTorch: a process that receives requests on its standard input.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use anyhow::{Context, Result};

use crate::Timed;

/// The process. It ends when its standard input is closed.
pub struct Torch {
    child: Child,
    ask: ChildStdin,
    answers: BufReader<ChildStdout>,
    _problem: tempfile::NamedTempFile,
}

impl Torch {
    /// Starts the PyTorch script with the interpreter `python` and the description `problem`.
    pub fn start(python: &Path, problem: &serde_json::Value) -> Result<Torch> {
        let mut file = tempfile::NamedTempFile::new()?;
        serde_json::to_writer(&mut file, problem)?;
        file.flush()?;
        let script =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/side_by_side/torch_side.py");
        let mut child = Command::new(python)
            .arg(script)
            .arg(file.path())
            // the libraries below PyTorch also use one thread
            .envs(["OMP_NUM_THREADS", "MKL_NUM_THREADS"].map(|name| (name, "1")))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .with_context(|| {
                format!("starting {}; name a Python with PyTorch", python.display())
            })?;
        let ask = child.stdin.take().context("the child's input")?;
        let answers = BufReader::new(child.stdout.take().context("the child's output")?);
        Ok(Torch { child, ask, answers, _problem: file })
    }

    /// Times `calls` calls of `task`.
    pub fn time(&mut self, task: &str, calls: usize) -> Result<Timed> {
        writeln!(self.ask, "{task} {calls}")?;
        let mut line = String::new();
        self.answers.read_line(&mut line)?;
        serde_json::from_str(&line).with_context(|| {
            format!("{task}: PyTorch answered {line:?}; what it said stands above")
        })
    }
}

impl Drop for Torch {
    fn drop(&mut self) {
        // the process is no longer needed, and an error cannot be handled here
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
