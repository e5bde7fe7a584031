//! The process of a flight in the simulator. It runs this program with the command `greylag demo`.

use std::io::{BufRead, BufReader, Read};
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Largest number of output lines kept.
const LINES: usize = 40;
/// Time for the program to end normally after the stop request, including its report.
const STOP_TIMEOUT: Duration = Duration::from_secs(120);
/// Start of the line that `greylag demo` prints when a flight is complete.
const COMPLETE: &str = "report: ";

/// A flight in a separate process. The process ends with this program, because its standard input is then closed.
pub struct Program {
    child: Child,
    input: Option<ChildStdin>,
    stop_requested: Option<Instant>,
    output: [Arc<Mutex<Vec<String>>>; 2],
    /// Threads that read the output.
    listeners: Vec<JoinHandle<()>>,
}

impl Program {
    /// Starts this program with the arguments `words`.
    ///
    /// # Errors
    /// If the operating system cannot start the process.
    pub fn start(words: &[String]) -> std::io::Result<Program> {
        let mut command = Command::new(std::env::current_exe()?);
        command.args(words).arg("--attached");
        Program::of(command)
    }

    /// Starts `command` and reads its output.
    fn of(mut command: Command) -> std::io::Result<Program> {
        let command = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn()?;
        let output: [Arc<Mutex<Vec<String>>>; 2] = Default::default();
        let listeners =
            [listen(child.stdout.take(), &output[0]), listen(child.stderr.take(), &output[1])];
        let listeners = listeners.into_iter().flatten().collect();
        let input = child.stdin.take();
        Ok(Program { child, input, stop_requested: None, output, listeners })
    }

    /// Requests the end of the flight by closing the program's input.
    pub fn stop(&mut self) {
        self.input = None;
        self.stop_requested.get_or_insert_with(Instant::now);
    }

    /// Exit status; `None` while the program runs. The program is killed [`STOP_TIMEOUT`] after the stop request. Its
    /// output is complete when there is a status.
    pub fn ended(&mut self) -> Option<ExitStatus> {
        if self.stop_requested.is_some_and(|at| at.elapsed() > STOP_TIMEOUT) {
            let _ = self.child.kill();
        }
        let status = self.child.try_wait().ok().flatten()?;
        // the last lines may still be in the pipes, which the end of the process has closed
        self.listeners.drain(..).for_each(|listener| drop(listener.join()));
        Some(status)
    }

    /// Whether the flight reached its planned end.
    pub fn is_whole(&self) -> bool {
        self.lines(0).iter().any(|line| line.starts_with(COMPLETE))
    }

    /// Last non-empty line of output: the tracking result of a complete flight, otherwise the error.
    pub fn last_line(&self) -> String {
        let [out, errors] = [self.lines(0), self.lines(1)];
        let words = if self.is_whole() { &out } else { &errors };
        let mut useful = words.iter().filter(|l| !l.trim().is_empty() && !l.starts_with(COMPLETE));
        useful.next_back().cloned().unwrap_or_default()
    }

    fn lines(&self, of: usize) -> Vec<String> {
        self.output[of].lock().unwrap_or_else(PoisonError::into_inner).clone()
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

/// Keeps the last [`LINES`] lines of `from` in `output`, on a separate thread.
fn listen(
    from: Option<impl Read + Send + 'static>,
    output: &Arc<Mutex<Vec<String>>>,
) -> Option<JoinHandle<()>> {
    let (from, output) = (from?, output.clone());
    Some(std::thread::spawn(move || {
        for line in BufReader::new(from).lines().map_while(Result::ok) {
            let mut lines = output.lock().unwrap_or_else(PoisonError::into_inner);
            lines.push(line);
            let old = lines.len().saturating_sub(LINES);
            lines.drain(..old);
        }
    }))
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn the_output_is_complete_at_the_end() {
        let mut command = Command::new("sh");
        command.args(["-c", "seq 20000; echo 'report: page.html'; echo tracked"]);
        let mut program = Program::of(command).unwrap();
        while program.ended().is_none() {}
        assert!(program.is_whole());
        assert_eq!(program.last_line(), "tracked");
    }
}
