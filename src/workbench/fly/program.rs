//! The program that flies: this one, as `greylag demo`, in a process of its own.

use std::io::{BufRead, BufReader, Read};
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Lines that are kept of what it says.
const LINES: usize = 40;
/// How long it may take to end by itself, with its report, once it is told to.
const PATIENCE: Duration = Duration::from_secs(120);
/// What `greylag demo` says once a flight is whole.
const WHOLE: &str = "report: ";

/// A flight in a process of its own. It ends with this program, for its standard input ends then.
pub struct Program {
    child: Child,
    input: Option<ChildStdin>,
    told: Option<Instant>,
    said: [Arc<Mutex<Vec<String>>>; 2],
}

impl Program {
    /// Starts this program with `words`.
    ///
    /// # Errors
    /// The system refuses.
    pub fn start(words: &[String]) -> std::io::Result<Program> {
        let mut child = Command::new(std::env::current_exe()?)
            .args(words)
            .arg("--attached")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()?;
        let said: [Arc<Mutex<Vec<String>>>; 2] = Default::default();
        listen(child.stdout.take(), &said[0]);
        listen(child.stderr.take(), &said[1]);
        let input = child.stdin.take();
        Ok(Program { child, input, told: None, said })
    }

    /// Tells it to end the flight.
    pub fn stop(&mut self) {
        self.input = None;
        self.told.get_or_insert_with(Instant::now);
    }

    /// How it ended, if it has. One that does not end in time is killed.
    pub fn ended(&mut self) -> Option<ExitStatus> {
        if self.told.is_some_and(|told| told.elapsed() > PATIENCE) {
            let _ = self.child.kill();
        }
        self.child.try_wait().ok().flatten()
    }

    /// Whether the flight was flown to the end that it was to have.
    pub fn is_whole(&self) -> bool {
        self.lines(0).iter().any(|line| line.starts_with(WHOLE))
    }

    /// What it said last: how targets were tracked, or why it failed.
    pub fn last_words(&self) -> String {
        let [out, errors] = [self.lines(0), self.lines(1)];
        let words = if self.is_whole() { &out } else { &errors };
        let mut useful = words.iter().filter(|l| !l.trim().is_empty() && !l.starts_with(WHOLE));
        useful.next_back().cloned().unwrap_or_default()
    }

    fn lines(&self, of: usize) -> Vec<String> {
        self.said[of].lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        self.input = None;
        if self.child.try_wait().is_ok_and(|ended| ended.is_none()) {
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
    }
}

/// Keeps the last lines of `from` in `said`, on a thread of its own.
fn listen(from: Option<impl Read + Send + 'static>, said: &Arc<Mutex<Vec<String>>>) {
    let (Some(from), said) = (from, said.clone()) else { return };
    std::thread::spawn(move || {
        for line in BufReader::new(from).lines().map_while(Result::ok) {
            let mut said = said.lock().unwrap_or_else(PoisonError::into_inner);
            said.push(line);
            let old = said.len().saturating_sub(LINES);
            said.drain(..old);
        }
    });
}
