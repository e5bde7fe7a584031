//! Progress display of a long command, and its cancellation by Ctrl-C.

use std::io::IsTerminal;
use std::ops::ControlFlow;
use std::process;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, Once};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

use crate::commands::status::INTERRUPTED;
use crate::sysid::progress::{Cancelled, Stage, not_cancelled};

/// Number of steps of a full progress bar.
const STEPS: u64 = 1000;
/// Interval at which the bar is redrawn.
const TICK: Duration = Duration::from_millis(200);

/// Number of times that Ctrl-C was pressed.
static PRESSED: AtomicUsize = AtomicUsize::new(0);
static LISTENING: Once = Once::new();
/// Whether `--quiet` was given.
static SILENT: AtomicBool = AtomicBool::new(false);

/// Switches the progress display off if `quiet`.
pub fn silence(quiet: bool) {
    SILENT.store(quiet, Ordering::Relaxed);
}

/// Returns whether `--quiet` was given.
pub fn is_silent() -> bool {
    SILENT.load(Ordering::Relaxed)
}

/// Progress of a task on standard error: a bar if this is a terminal, otherwise one line per stage.
pub struct Bar {
    bar: Option<ProgressBar>,
    last: Mutex<String>,
}

impl Bar {
    /// Starts the progress display of a long task. From then on, the first Ctrl-C cancels the task, and a second Ctrl-C
    /// ends the program.
    pub fn new() -> Bar {
        LISTENING.call_once(|| {
            let press = || {
                if PRESSED.fetch_add(1, Ordering::Relaxed) > 0 {
                    process::exit(INTERRUPTED.into());
                }
            };
            if let Err(error) = ctrlc::set_handler(press) {
                tracing::warn!("Ctrl-C ends the program at once: {error}");
            }
        });
        let bar = (std::io::stderr().is_terminal() && !is_silent()).then(|| {
            let style = ProgressStyle::with_template("{msg} {wide_bar} {percent:>3} %, {eta} left");
            let bar = ProgressBar::new(STEPS);
            if let Ok(style) = style {
                bar.set_style(style);
            }
            bar.enable_steady_tick(TICK);
            bar
        });
        Bar { bar, last: Mutex::default() }
    }

    /// Displays `stage`. Returns `Break` if Ctrl-C was pressed.
    pub fn update(&self, stage: Stage<'_>) -> ControlFlow<()> {
        match &self.bar {
            Some(bar) => {
                bar.set_message(stage.doing.to_owned());
                bar.set_position((stage.fraction * STEPS as f64) as u64);
            }
            None => self.line(stage.doing),
        }
        pressed()
    }

    /// Fails if Ctrl-C was pressed. Call it before a command writes its files.
    ///
    /// # Errors
    /// If Ctrl-C was pressed.
    pub fn go_on(&self) -> Result<(), Cancelled> {
        not_cancelled(pressed())
    }

    /// Prints `line` to standard output, above the bar.
    #[cfg(feature = "study")]
    pub fn print(&self, line: &str) {
        match &self.bar {
            Some(bar) => bar.suspend(|| println!("{line}")),
            None => println!("{line}"),
        }
    }

    /// Prints the stage's name `doing` to standard error, unless it is the last one printed.
    fn line(&self, doing: &str) {
        let Ok(mut last) = self.last.lock() else { return };
        if *last != doing && !is_silent() {
            eprintln!("{doing}");
            doing.clone_into(&mut last);
        }
    }
}

/// The parts of the progress bar for the work and for the writing of the report, each as [start, end] in fractions of the
/// bar. Without a report the work has the whole bar.
#[cfg(feature = "study")]
pub fn shares(report: Option<&std::path::Path>) -> [[f64; 2]; 2] {
    let end = if report.is_some() { 0.9 } else { 1.0 };
    [[0.0, end], [end, 1.0]]
}

/// Returns `Break` if Ctrl-C was pressed.
fn pressed() -> ControlFlow<()> {
    match PRESSED.load(Ordering::Relaxed) {
        0 => ControlFlow::Continue(()),
        _ => ControlFlow::Break(()),
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
