//! Runs cells of a campaign on this machine, each in a separate process. A cell is one command line of the campaign.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::OpenOptions;
use std::path::Path;
use std::process::{Child, Command, ExitCode, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, Result};

use super::cost::{Cost, time};
use crate::campaign::gather::gather;
use crate::campaign::{Cell, Plan, Record, Standing, Store};
use crate::commands::bar::Bar;
use crate::commands::status;
use crate::sysid::progress::Stage;

/// Interval at which the processes are polled.
const LOOK: Duration = Duration::from_millis(50);
/// Pause before another attempt at a cell.
const PAUSE: Duration = Duration::from_secs(2);
/// After Ctrl-C a process has this time to write its checkpoint and end. Then it is killed.
const GRACE: Duration = Duration::from_secs(20);
/// A cell fails if a signal has ended its process this many times, for example for lack of memory.
const KILLS: u32 = 3;
/// Subfolder of the campaign's folder with the text that the cells print.
const LOGS: &str = "logs";

/// Treatment of cells that failed in an earlier run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failed {
    /// Failed cells are left as they are.
    Leave,
    /// Failed cells are tried again.
    Again,
}

/// State of a cell in this run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Waiting { not_before: Option<Instant>, kills: u32 },
    Running { kills: u32 },
    Done,
    Failed,
    NotChosen,
}

/// A run of cells of a campaign, at most `jobs` at a time.
struct Local<'a> {
    plan: &'a Plan,
    store: &'a Store,
    file: &'a Path,
    jobs: usize,
    states: Vec<State>,
    running: BTreeMap<usize, Child>,
    bar: Bar,
}

/// Runs the cells with the numbers `chosen` that have no result, at most `jobs` at a time. Prints their final state.
pub fn run(
    plan: &Plan,
    store: &Store,
    file: &Path,
    chosen: &BTreeSet<usize>,
    jobs: usize,
    failed: Failed,
) -> Result<ExitCode> {
    let logs = store.folder().join(LOGS);
    std::fs::create_dir_all(&logs).with_context(|| format!("cannot make {}", logs.display()))?;
    let state = |cell: &Cell| match chosen.contains(&cell.number) {
        true => begin(store, cell, failed),
        false => Ok(State::NotChosen),
    };
    let states = plan.cells.iter().map(state).collect::<Result<Vec<_>>>()?;
    let bar = Bar::new();
    let mut local = Local { plan, store, file, jobs, states, running: BTreeMap::new(), bar };
    let interrupted = local.all();
    // no process may remain, even after an error
    local.end();
    let interrupted = interrupted?;
    drop(local);
    if interrupted {
        eprintln!("interrupted; the same command goes on");
        return Ok(ExitCode::from(status::INTERRUPTED));
    }
    ended(plan, store, chosen)
}

fn begin(store: &Store, cell: &Cell, failed: Failed) -> Result<State> {
    Ok(match store.standing(cell)? {
        Standing::Done(_) => State::Done,
        Standing::Failed(_) if failed == Failed::Leave => State::Failed,
        _ => State::Waiting { not_before: None, kills: 0 },
    })
}

/// Prints the final state of the cells. The exit status is 0 if all are done, 1 otherwise.
fn ended(plan: &Plan, store: &Store, chosen: &BTreeSet<usize>) -> Result<ExitCode> {
    let cells = plan.cells.iter().filter(|cell| chosen.contains(&cell.number)).cloned().collect();
    let plan = Plan { file: plan.file.clone(), cells };
    let all = gather(&plan, store)?;
    println!(
        "{} of {} cells are done in {}",
        all.records.len(),
        plan.cells.len(),
        store.folder().display()
    );
    for (cell, failure) in &all.failed {
        println!("cell {cell} failed: {}", failure.error);
    }
    if all.is_whole() {
        return Ok(ExitCode::SUCCESS);
    }
    println!("what the cells printed is in {}", store.folder().join(LOGS).display());
    Ok(ExitCode::FAILURE)
}

impl Local<'_> {
    /// Runs cells until none can be run any more. Returns whether Ctrl-C ended the run.
    fn all(&mut self) -> Result<bool> {
        self.show()?;
        loop {
            let now = Instant::now();
            while self.running.len() < self.jobs
                && let Some(next) = self.next(now)
            {
                self.start(next)?;
            }
            if self.running.is_empty() && !self.is_waiting() {
                return Ok(false);
            }
            std::thread::sleep(LOOK);
            self.reap()?;
            if self.show()? {
                return Ok(true);
            }
        }
    }

    /// Index of the first waiting cell that can be started now: its pause is over, and the cells that it depends on are done.
    fn next(&self, now: Instant) -> Option<usize> {
        let ready = |i: &usize| {
            let State::Waiting { not_before, .. } = self.states[*i] else { return false };
            not_before.is_none_or(|time| time <= now) && self.after(*i, |s| s == State::Done)
        };
        (0..self.states.len()).find(ready)
    }

    /// Whether a waiting cell remains that can still be run, because no cell on which it depends has failed.
    fn is_waiting(&self) -> bool {
        let waits = |i: &usize| matches!(self.states[*i], State::Waiting { .. });
        (0..self.states.len()).filter(waits).any(|i| self.may_come(i))
    }

    /// Whether neither this cell nor any cell that it depends on has failed.
    fn may_come(&self, index: usize) -> bool {
        self.states[index] != State::Failed
            && self.plan.cells[index].after.iter().all(|number| self.may_come(number - 1))
    }

    fn after(&self, index: usize, is: impl Fn(State) -> bool) -> bool {
        self.plan.cells[index].after.iter().all(|number| is(self.states[number - 1]))
    }

    fn start(&mut self, index: usize) -> Result<()> {
        let cell = &self.plan.cells[index];
        let path = self.store.folder().join(LOGS).join(cell.stem() + ".txt");
        let log = OpenOptions::new().create(true).append(true).open(&path);
        let log = log.with_context(|| format!("cannot write {}", path.display()))?;
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let child = Command::new(std::env::current_exe().context("finding this program")?)
            .args(["campaign", "run"])
            .arg(self.file)
            .arg("--out")
            .arg(self.store.folder())
            // The cell is named by its id, because its number may change if the user edits the campaign file during the run.
            .args(["--cell", &cell.id])
            .env("RAYON_NUM_THREADS", (cores / self.jobs).max(1).to_string())
            .stdin(Stdio::null())
            .stdout(log.try_clone().context("opening the log twice")?)
            .stderr(log)
            .spawn()
            .context("starting a process for a cell")?;
        let kills = if let State::Waiting { kills, .. } = self.states[index] { kills } else { 0 };
        self.states[index] = State::Running { kills };
        self.running.insert(index, child);
        Ok(())
    }

    /// Finds the processes that have ended, and updates and prints the states of their cells.
    fn reap(&mut self) -> Result<()> {
        let mut ended = Vec::new();
        for (index, child) in &mut self.running {
            if let Some(status) = child.try_wait().context("waiting for a cell")? {
                ended.push((*index, status.code()));
            }
        }
        for (index, code) in ended {
            self.running.remove(&index);
            let kills = if let State::Running { kills } = self.states[index] { kills } else { 0 };
            self.states[index] = self.state_after(index, code, kills)?;
            self.row(index)?;
        }
        Ok(())
    }

    fn state_after(&self, index: usize, code: Option<i32>, kills: u32) -> Result<State> {
        let again = |kills| State::Waiting { not_before: Some(Instant::now() + PAUSE), kills };
        Ok(match (code, self.store.standing(&self.plan.cells[index])?) {
            (_, Standing::Done(_)) => State::Done,
            (Some(code), _) if code == i32::from(status::TRY_AGAIN) => again(kills),
            (None, _) if kills + 1 < KILLS => again(kills + 1),
            _ => State::Failed,
        })
    }

    /// Prints the line of a cell that has ended.
    fn row(&self, index: usize) -> Result<()> {
        let cell = &self.plan.cells[index];
        let what = match (self.states[index], self.store.standing(cell)?) {
            (State::Done, Standing::Done(record)) => self.reached(&record),
            (State::Failed, Standing::Failed(failure)) => format!("failed: {}", failure.error),
            (State::Failed, _) => "ended without a word; see its log".into(),
            _ => return Ok(()),
        };
        let took = self.store.times(cell)?.map_or(String::new(), |t| time(t.seconds));
        let (done, cells) = (self.count(State::Done), self.chosen());
        let left = self.left()?.map_or(String::new(), |[_, left]| format!("{} left", time(left)));
        self.bar
            .print(&format!("{done:>4}/{cells}  {:<40} {took:>7}  {left:>11}  {what}", cell.id));
        Ok(())
    }

    /// Text with at most three quantities of a result. They are quantities that the campaign's tables summarise.
    fn reached(&self, record: &Record) -> String {
        let file = &self.plan.file;
        let of = |choice: &str| {
            file.choice(choice).is_ok_and(|(stage, levels)| record.has(&stage, &levels))
        };
        let tables = file.tables.iter().filter(|t| of(&t.stage));
        let metrics = tables
            .flat_map(|t| &t.metrics)
            .filter_map(|metric| Some(format!("{metric} {:.4}", record.metrics.get(metric)?)));
        metrics.take(3).collect::<Vec<_>>().join("  ")
    }

    fn count(&self, state: State) -> usize {
        self.states.iter().filter(|s| **s == state).count()
    }

    /// Number of cells of this run.
    fn chosen(&self) -> usize {
        self.states.len() - self.count(State::NotChosen)
    }

    /// Two estimates, s: the processor time of all cells, and the remaining time of this run. The remaining time is the processor
    /// time of the cells that have not ended, divided by the number of jobs. `None` if the cost of a stage is unknown.
    fn left(&self) -> Result<Option<[f64; 2]>> {
        let (mut all, mut left) = (0.0, 0.0);
        for stage in &self.plan.file.stages {
            let Some(cost) = Cost::of(self.plan, self.store, stage)? else { return Ok(None) };
            let indices = self.plan.of_stage(&stage.name).map(|cell| cell.number - 1);
            let states = indices.map(|index| self.states[index]);
            for state in states.filter(|state| *state != State::NotChosen) {
                all += cost.core_seconds;
                left += if matches!(state, State::Done | State::Failed) {
                    0.0
                } else {
                    cost.core_seconds
                };
            }
        }
        Ok(Some([all, left / self.jobs as f64]))
    }

    /// Updates the progress bar. Returns whether Ctrl-C was pressed.
    fn show(&self) -> Result<bool> {
        let done = self.count(State::Done) as f64 / self.chosen() as f64;
        let doing = format!("running campaign {}", self.plan.file.name);
        Ok(self.bar.update(Stage::new(&doing, done)).is_break())
    }

    /// Waits until the processes have written their checkpoints and ended. Kills those that have not ended after [`GRACE`].
    fn end(&mut self) {
        let begun = Instant::now();
        while !self.running.is_empty() && begun.elapsed() < GRACE {
            self.running.retain(|_, child| matches!(child.try_wait(), Ok(None)));
            std::thread::sleep(LOOK);
        }
        for child in self.running.values_mut() {
            // the cell's checkpoint is complete, and a restart resumes from it
            let _ = child.kill();
            let _ = child.wait();
        }
        self.running.clear();
    }
}
