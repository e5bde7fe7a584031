//! Long work beside the interpreter: the lock is released, progress is reported, Ctrl-C ends the
//! work.

use std::ops::ControlFlow;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use greylag::sysid::progress::{Progress, Stage};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

/// Time between two looks at signals.
const LOOK: Duration = Duration::from_millis(20);

/// Does `work` on a thread of its own. `on_stage` is called with each stage and its share of the
/// whole; an exception that it raises, or Ctrl-C, ends the work at its next stage and is returned.
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
