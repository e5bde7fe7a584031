//! Ctrl-C during a long task. It sets a flag, and the task ends where it next checks the flag and can be resumed.

use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

#[cfg(any(feature = "demo", feature = "study"))]
use anyhow::{Context, Result};

use crate::commands::status;

/// Flag that is set when Ctrl-C is pressed.
#[derive(Clone, Debug, Default)]
pub struct Interruption(Arc<AtomicBool>);

/// How a long task ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// The task is complete.
    Done,
    /// Ctrl-C ended it; the same command resumes it.
    Interrupted,
}

impl Interruption {
    /// Installs the handler of Ctrl-C and returns the flag that it sets. May be called only once in a program.
    ///
    /// # Errors
    /// If the handler cannot be installed.
    #[cfg(any(feature = "demo", feature = "study"))]
    pub fn watch() -> Result<Interruption> {
        let flag = Interruption::default();
        let seen = flag.0.clone();
        ctrlc::set_handler(move || seen.store(true, Ordering::Relaxed))
            .context("setting the handler of Ctrl-C")?;
        Ok(flag)
    }

    /// Whether Ctrl-C was pressed.
    #[cfg_attr(not(any(feature = "demo", feature = "learn")), expect(dead_code))]
    pub fn is_set(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

impl From<Ended> for ExitCode {
    fn from(ended: Ended) -> ExitCode {
        match ended {
            Ended::Done => ExitCode::SUCCESS,
            Ended::Interrupted => ExitCode::from(status::INTERRUPTED),
        }
    }
}
