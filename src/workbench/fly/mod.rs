//! Flights in the workbench: flights in the simulator with the session's model, and recordings that another program is writing.
//! During a flight, the page compares the measured channels with the predictions of the models.

mod live;
mod order;
mod program;

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use serde::Serialize;

pub(super) use live::channels;
pub use live::{Live, Warning};
pub use order::Order;
pub(super) use order::{AIRCRAFT, SCHEDULES, controllers};

use super::bench::Bench;
use super::error::{WorkbenchError, io};
use super::jobs::{Event, Stop};
use super::roles::now_s;
use super::session::{Flown, Outcome, Role};
use greylag_logs::Growing;
use greylag_model::GreyBox;
use live::Watcher;
use program::Program;

/// Subfolder of the session's folder for the recordings of simulator flights.
const FLIGHTS: &str = "flights";
/// File name of a recording's log.
const LOG: &str = "flight.csv";
/// Interval between two reads of a growing recording.
const LOOK: Duration = Duration::from_millis(100);
/// Largest number of characters that are kept of the last line that a program printed.
const LINE_LENGTH: usize = 400;

/// The present flight, or the last one if none is in progress. It is simulated, or recorded by another program.
pub struct Flying {
    /// Number by which the pages identify the flight. Jobs and flights share one sequence of numbers.
    pub number: u64,
    /// Index of the flight in the session's list of flights.
    pub place: usize,
    /// Whether the flight is in progress.
    pub on: bool,
    /// Samples, predictions and warnings of the flight so far.
    pub live: Live,
    /// Number of points that were removed from the start of `live`, because its length is limited.
    pub gone: usize,
    stop: Stop,
}

/// A part of a flight that is sent to a page.
#[derive(Clone, Debug, Serialize)]
pub struct Part {
    /// Number of the flight.
    pub number: u64,
    /// Whether the flight is in progress.
    pub on: bool,
    /// Number of points of the flight that precede this part.
    pub from: usize,
    /// Samples, predictions and warnings of the part.
    pub live: Live,
}

/// Inputs of the thread that follows a flight.
struct Task {
    number: u64,
    log: PathBuf,
    models: Vec<GreyBox>,
    program: Option<Program>,
    stop: Stop,
}

impl Bench {
    /// Starts a flight in the simulator. It is flown with the amended model if its fit is complete and has an accepted effect,
    /// otherwise with the given model.
    pub(super) fn fly(self: &Arc<Self>, seen: u64, order: &Order) -> Result<(), WorkbenchError> {
        if !cfg!(feature = "sitl") {
            return Err(WorkbenchError::NoSimulator);
        }
        self.same_model()?;
        let (model, cruise_mps, folder) = {
            let inner = self.lock();
            if inner.flying.as_ref().is_some_and(|f| f.on) {
                return Err(WorkbenchError::Flying);
            }
            let cruise_mps = inner.model.airframe.envelope.airspeed_cruise_mps;
            (inner.flying_model(), cruise_mps, self.folder.join(FLIGHTS))
        };
        std::fs::create_dir_all(&folder).map_err(|e| io(&folder, e))?;
        let number = free(&folder);
        let record = folder.join(number.to_string());
        let words = order.words(&self.folder, &model, cruise_mps, &record)?;
        let begun = Flown {
            schedule: order.schedule.clone(),
            command: order::line(&words),
            ..Flown::new(PathBuf::from(FLIGHTS).join(number.to_string()))
        };
        self.begin(seen, begun, || Program::start(&words).map(Some).map_err(|e| io(&record, e)))
    }

    /// Displays the recording in `folder` while another program writes it. `folder` may also be the path of the log.
    pub(super) fn watch(self: &Arc<Self>, seen: u64, folder: &Path) -> Result<(), WorkbenchError> {
        let folder = match folder.file_name() {
            Some(name) if name == LOG => folder.parent().unwrap_or(folder),
            _ => folder,
        };
        if !folder.join(LOG).is_file() {
            return Err(WorkbenchError::NoRecording(folder.into()));
        }
        let folder = std::fs::canonicalize(folder).map_err(|e| io(folder, e))?;
        self.begin(seen, Flown::new(folder), || Ok(None))
    }

    fn begin(
        self: &Arc<Self>,
        seen: u64,
        begun: Flown,
        start: impl FnOnce() -> Result<Option<Program>, WorkbenchError>,
    ) -> Result<(), WorkbenchError> {
        let log = self.folder.join(&begun.folder).join(LOG);
        let task = self.change(seen, |inner| {
            if inner.flying.as_ref().is_some_and(|f| f.on) {
                return Err(WorkbenchError::Flying);
            }
            let models = inner.models();
            let effects = inner.session.effects.iter().map(|e| e.id.clone()).collect();
            let model = models.last().map_or_else(String::new, |m| m.name.clone());
            inner.session.flown.push(Flown { model, effects, ..begun });
            let (number, stop) = (inner.next_job, Stop::default());
            inner.next_job += 1;
            let program = start()?;
            inner.flying = Some(Flying {
                number,
                place: inner.session.flown.len() - 1,
                on: true,
                live: Live::default(),
                gone: 0,
                stop: stop.clone(),
            });
            Ok(Task { number, log, models, program, stop })
        });
        let task = task.inspect_err(|_| {
            // a flight whose record could not be written did not start
            let mut inner = self.lock();
            let flown = inner.session.flown.len();
            inner.flying = inner.flying.take().filter(|f| f.place < flown);
        })?;
        let bench = self.clone();
        std::thread::spawn(move || bench.follow(task));
        Ok(())
    }

    /// Stops the simulated flight, or the display of a recording.
    pub(super) fn stop_flight(&self) -> Result<(), WorkbenchError> {
        let inner = self.lock();
        let flying = inner.flying.as_ref().filter(|f| f.on);
        flying.ok_or(WorkbenchError::Nothing("stop"))?.stop.stop();
        Ok(())
    }

    /// Adds the recording of the flight with index `place` to the session as a log.
    pub(super) fn take_flight(&self, seen: u64, place: usize) -> Result<(), WorkbenchError> {
        let (file, name) = {
            let inner = self.lock();
            let flown = inner.session.flown.get(place);
            let flown = flown.ok_or(WorkbenchError::NoFlight(place))?;
            if flown.outcome == Outcome::Flying {
                return Err(WorkbenchError::Flying);
            }
            let name = flown.folder.file_name().unwrap_or_default().to_string_lossy();
            (self.folder.join(&flown.folder).join(LOG), format!("flown-{name}.csv"))
        };
        let bytes = std::fs::read(&file).map_err(|e| io(&file, e))?;
        // the log is added as unused: it then changes no result until the user gives it a role
        self.take_as(seen, &name, &bytes, Some(Role::Unused))
    }

    /// The present or last flight with all its points; `None` without a flight.
    pub fn flying(&self) -> Option<Part> {
        let inner = self.lock();
        let Flying { number, on, live, gone, .. } = inner.flying.as_ref()?;
        Some(Part { number: *number, on: *on, from: *gone, live: live.clone() })
    }

    /// Reads the recording until the flight ends or is stopped, and then stores the outcome.
    fn follow(self: &Arc<Self>, mut task: Task) {
        let mut watcher = Watcher::new(&task.models);
        let mut tail = Tail::default();
        let mut trouble = None;
        let outcome = loop {
            let stopped = task.stop.answer().is_break();
            // this is checked before rows are read, so that no rows are missed that the program writes before it ends
            let ended = match &mut task.program {
                Some(program) => {
                    if stopped {
                        program.stop();
                    }
                    program.ended().is_some()
                }
                None => stopped,
            };
            match tail.rows(&task.log) {
                Ok(rows) if rows.is_empty() => {}
                Ok(rows) => self.seen(task.number, watcher.take(&rows)),
                Err(error) => trouble = Some(error.to_string()),
            }
            let whole = task.program.as_ref().is_none_or(Program::is_whole);
            match (ended || trouble.is_some(), whole && trouble.is_none(), stopped) {
                (false, ..) => std::thread::sleep(LOOK),
                (true, true, false) => break Outcome::Flown,
                (true, _, true) => break Outcome::Stopped,
                (true, ..) => break Outcome::Failed,
            }
        };
        self.seen(task.number, watcher.rest());
        let last = trouble.or(task.program.as_ref().map(Program::last_line)).unwrap_or_default();
        self.record_end(task.number, outcome, &last, tail.seconds());
    }

    /// Stores the new part `later` of the flight and sends it to the pages.
    fn seen(&self, number: u64, later: Live) {
        if later.time_s.is_empty() && later.warnings.is_empty() {
            return;
        }
        let mut inner = self.lock();
        let Some(flying) = inner.flying.as_mut().filter(|f| f.number == number) else { return };
        let from = flying.gone + flying.live.time_s.len();
        flying.gone += flying.live.append(later.clone());
        drop(inner);
        (self.on_event)(Event::Flight { part: Part { number, on: true, from, live: later } });
    }

    /// Records the outcome of the flight in the session.
    fn record_end(&self, number: u64, outcome: Outcome, last: &str, seconds: f64) {
        let recorded = self.amend_session(|inner| {
            let Some(flying) = inner.flying.as_mut().filter(|f| f.number == number) else { return };
            flying.on = false;
            let name =
                |w: &Warning| flying.live.models.get(w.model).map_or("", |m| m.model.as_str());
            let warning = |w: &Warning| format!("{:.1} s, {}: {}", w.time_s, name(w), w.text);
            let warnings = flying.live.warnings.iter().map(warning).collect();
            let place = flying.place;
            let flown = &mut inner.session.flown[place];
            (flown.outcome, flown.seconds, flown.warnings) = (outcome, seconds, warnings);
            flown.said = last.chars().take(LINE_LENGTH).collect();
        });
        if let Err(error) = recorded {
            tracing::warn!("the flight's end is not in the session: {error}");
        }
    }
}

impl Flown {
    /// A record of a flight that begins now, with the recording in `folder`.
    fn new(folder: PathBuf) -> Flown {
        Flown {
            unix_s: now_s(),
            folder,
            model: String::new(),
            effects: Vec::new(),
            schedule: String::new(),
            command: String::new(),
            outcome: Outcome::Flying,
            seconds: 0.0,
            warnings: Vec::new(),
            said: String::new(),
        }
    }
}

/// The lowest number above all numbers of recordings in `folder`.
fn free(folder: &Path) -> u64 {
    let names = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let numbers = names.filter_map(|e| e.file_name().to_str()?.parse::<u64>().ok());
    numbers.max().unwrap_or(0) + 1
}

/// State of the reader of a growing recording.
#[derive(Default)]
struct Tail {
    growing: Growing,
    read: u64,
    span: Option<[f64; 2]>,
}

impl Tail {
    /// Rows added to the file since the last call; empty if the file does not exist yet.
    fn rows(&mut self, log: &Path) -> Result<Vec<greylag_logs::Sample>, WorkbenchError> {
        let mut file = match File::open(log) {
            Ok(file) => file,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
            Err(e) => return Err(io(log, e)),
        };
        let mut bytes = Vec::new();
        file.seek(SeekFrom::Start(self.read)).map_err(|e| io(log, e))?;
        file.read_to_end(&mut bytes).map_err(|e| io(log, e))?;
        self.read += bytes.len() as u64;
        let rows = self.growing.take(&bytes, log)?;
        if let (Some(first), Some(last)) = (rows.first(), rows.last()) {
            let begun = self.span.map_or(first.time_s, |[begun, _]| begun);
            self.span = Some([begun, last.time_s]);
        }
        Ok(rows)
    }

    /// Time from the first to the last row, s; 0 without rows.
    fn seconds(&self) -> f64 {
        self.span.map_or(0.0, |[first, last]| last - first)
    }
}
