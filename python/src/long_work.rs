//! Runs long computations in a thread: the interpreter's lock is released, progress is reported, and Ctrl-C cancels
//! them.

use std::ops::ControlFlow;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use greylag::sysid::progress::{Progress, Stage};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

/// Interval between two checks for signals and progress.
const LOOK: Duration = Duration::from_millis(20);

/// Runs `work` in a separate thread and returns its result. `on_stage` is called with the name of a stage and the
/// completed fraction, 0 to 1; stages that follow each other within `LOOK` may be skipped.
///
/// # Errors
/// The error of `work`. An exception that `on_stage` raises, or Ctrl-C, cancels the work at its next stage and is
/// returned.
pub fn done<T: Send>(
    py: Python<'_>,
    on_stage: Option<Py<PyAny>>,
    work: impl FnOnce(&Progress) -> Result<T, String> + Send,
) -> PyResult<T> {
    let stage = Mutex::new(None);
    let stop = AtomicBool::new(false);
    let progress = |now: Stage<'_>| {
        if let Ok(mut stage) = stage.lock() {
            *stage = Some((now.doing.to_owned(), now.fraction));
        }
        match stop.load(Ordering::Relaxed) {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    };
    let report = || -> PyResult<()> {
        py.check_signals()?;
        let news = stage.lock().ok().and_then(|mut stage| stage.take());
        if let (Some(on_stage), Some((doing, fraction))) = (&on_stage, news) {
            on_stage.call1(py, (doing, fraction))?;
        }
        Ok(())
    };
    thread::scope(|scope| {
        let worker = scope.spawn(|| work(&progress));
        let mut raised = None;
        while !worker.is_finished() && raised.is_none() {
            py.detach(|| thread::sleep(LOOK));
            raised = report().err();
        }
        stop.store(raised.is_some(), Ordering::Relaxed);
        let result = py.detach(|| worker.join());
        if let Some(error) = raised {
            return Err(error);
        }
        result
            .map_err(|_| {
                PyRuntimeError::new_err("the work failed where it should not; report this")
            })?
            .map_err(crate::error::raised)
    })
}
