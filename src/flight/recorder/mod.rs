//! The recorder: a thread that writes the files `flight.csv` (a row per tick), `flight.tlog` (MAVLink frames) and
//! `flight.calls` (calls of the pilot).
//!
//! The control thread queues entries and never waits. Entries that do not fit are dropped and counted. A disk error closes the
//! affected file and is reported once. The flight continues.

pub mod call;
mod folder;
mod queue;
mod row;

use std::io::{BufWriter, Write};
use std::path::PathBuf;
use std::time::{Duration, Instant};

pub use call::Call;
pub use folder::{Place, RecordError};
pub use row::Row;

use crate::threads::{Receiver, RecvTimeoutError, Sender, bounded};
use greylag_link::framing::{FrameCounts, Frames};
use greylag_logs::csv::Rows;
use queue::Queue;

/// Capacity of the queue in entries: about four seconds of flight at 100 Hz with its link traffic.
const QUEUE: usize = 4096;
/// Longest time for which a written entry stays in the program's buffer before it goes to the file.
const FLUSH_INTERVAL: Duration = Duration::from_millis(500);

/// An entry of the queue.
#[derive(Debug)]
enum Entry {
    Row(Box<Row>),
    Bytes { unix_us: u64, bytes: Box<[u8]> },
    Call(Call),
}

/// The control thread's handle to the recorder.
#[derive(Debug)]
pub struct Recorder {
    queue: Queue<Entry, Written>,
    troubles: Receiver<String>,
    folder: PathBuf,
}

/// Counters of a recording.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Written {
    /// Number of rows in `flight.csv`.
    pub rows: u64,
    /// Number of frames in `flight.tlog`.
    pub frames: u64,
    /// Number of frames left out of `flight.tlog`, because this program does not know their message.
    pub unknown: u64,
    /// Number of entries and frames dropped because the queue was full or a file had failed.
    pub dropped: u64,
}

impl Recorder {
    /// Creates the folder and its files, and starts the thread.
    ///
    /// # Errors
    ///
    /// If the folder exists already, or a file or the thread cannot be created.
    pub fn start(place: &Place) -> Result<Self, RecordError> {
        let folder = place.create()?;
        let csv = folder::create(&folder, "flight.csv")?;
        let tlog = folder::create(&folder, "flight.tlog")?;
        let calls = folder::create(&folder, "flight.calls")?;
        Recorder::over(folder.clone(), csv, tlog, calls)
            .map_err(|source| RecordError::File { path: folder, source })
    }

    /// A recorder that writes to three given writers. `folder` is only the path that [`Recorder::folder`] returns.
    ///
    /// # Errors
    ///
    /// If the recorder's thread cannot be started.
    pub fn over(
        folder: PathBuf,
        csv: impl Write + Send + 'static,
        tlog: impl Write + Send + 'static,
        calls: impl Write + Send + 'static,
    ) -> std::io::Result<Self> {
        let (trouble, troubles) = bounded(3);
        let mut files = Files::new(csv, tlog, calls, trouble);
        let queue = Queue::start("recorder", QUEUE, move |entries| files.run(&entries))?;
        Ok(Recorder { queue, troubles, folder })
    }

    /// Path of the folder.
    pub fn folder(&self) -> &std::path::Path {
        &self.folder
    }

    /// Records a tick (control cycle) as a row of `flight.csv`.
    pub fn row(&self, row: Row) {
        self.queue.hand_over(Entry::Row(Box::new(row)));
    }

    /// Records one datagram, or complete frames of a stream, sent or received at `unix_us` (µs since 1970). Frames of unknown
    /// messages are left out and counted.
    pub fn bytes(&self, unix_us: u64, bytes: &[u8]) {
        self.queue.hand_over(Entry::Bytes { unix_us, bytes: bytes.into() });
    }

    /// Records a call of the pilot in `flight.calls`.
    pub fn call(&self, call: Call) {
        self.queue.hand_over(Entry::Call(call));
    }

    /// The oldest error that was not returned yet, as text; `None` without a new error. Each file fails once at most.
    pub fn trouble(&self) -> Option<String> {
        self.troubles.try_recv().ok()
    }

    /// Number of entries dropped because the queue was full or the recorder's thread had ended.
    pub fn dropped(&self) -> u64 {
        self.queue.dropped()
    }

    /// Writes the queued entries, closes the files and returns the counters of the recording.
    pub fn finish(mut self) -> Written {
        self.close()
    }

    fn close(&mut self) -> Written {
        let written = self.queue.close();
        Written { dropped: written.dropped + self.dropped(), ..written }
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        self.close();
    }
}

/// A file that is closed at its first error.
struct File<W> {
    name: &'static str,
    out: Option<W>,
    trouble: Sender<String>,
}

impl<W> File<W> {
    /// Runs `work` on the file. Returns `false` if the file has failed, now or earlier.
    fn attempt(&mut self, work: impl FnOnce(&mut W) -> std::io::Result<()>) -> bool {
        let Some(out) = &mut self.out else {
            return false;
        };
        if let Err(error) = work(out) {
            self.out = None;
            let _ = self.trouble.try_send(format!("recording of {} ended: {error}", self.name));
        }
        self.out.is_some()
    }
}

/// The recorder's files with their counters.
struct Files<C: Write, T: Write, L: Write> {
    csv: File<Rows<BufWriter<C>>>,
    tlog: File<BufWriter<T>>,
    calls: File<BufWriter<L>>,
    written: Written,
}

impl<C: Write, T: Write, L: Write> Files<C, T, L> {
    fn new(csv: C, tlog: T, calls: L, trouble: Sender<String>) -> Self {
        let mut text = File { name: "flight.csv", out: None, trouble: trouble.clone() };
        match Rows::new(BufWriter::new(csv), &Row::EXTRA) {
            Ok(rows) => text.out = Some(rows),
            Err(error) => {
                drop(text.trouble.try_send(format!("recording of flight.csv ended: {error}")))
            }
        }
        let tlog =
            File { name: "flight.tlog", out: Some(BufWriter::new(tlog)), trouble: trouble.clone() };
        let mut calls = File { name: "flight.calls", out: Some(BufWriter::new(calls)), trouble };
        calls.attempt(|out| writeln!(out, "{}", call::HEADER));
        Files { csv: text, tlog, calls, written: Written::default() }
    }

    fn run(&mut self, entries: &Receiver<Entry>) -> Written {
        let mut flushed = Instant::now();
        loop {
            match entries.recv_timeout(FLUSH_INTERVAL) {
                Ok(entry) => self.write(&entry),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            if flushed.elapsed() >= FLUSH_INTERVAL {
                self.flush();
                flushed = Instant::now();
            }
        }
        self.flush();
        self.written.clone()
    }

    fn write(&mut self, entry: &Entry) {
        match entry {
            Entry::Row(row) => {
                let done = self.csv.attempt(|out| row.write(out));
                self.written.rows += u64::from(done);
                self.written.dropped += u64::from(!done);
            }
            Entry::Call(call) => {
                let done = self.calls.attempt(|out| writeln!(out, "{call}"));
                self.written.dropped += u64::from(!done);
            }
            Entry::Bytes { unix_us, bytes } => {
                let mut counts = FrameCounts::default();
                for frame in Frames::new(bytes, &mut counts) {
                    let done = self.tlog.attempt(|out| {
                        out.write_all(&unix_us.to_be_bytes())?;
                        out.write_all(frame.bytes)
                    });
                    self.written.frames += u64::from(done);
                    self.written.dropped += u64::from(!done);
                }
                self.written.unknown += counts.unknown;
            }
        }
    }

    /// Flushes the files. If a file fails here, an unknown number of entries counted as written are lost. The file adds one to
    /// the dropped entries.
    fn flush(&mut self) {
        let open = self.open();
        self.csv.attempt(Rows::flush);
        self.tlog.attempt(BufWriter::flush);
        self.calls.attempt(BufWriter::flush);
        self.written.dropped += open - self.open();
    }

    /// Number of files that have not failed.
    fn open(&self) -> u64 {
        u64::from(self.csv.out.is_some())
            + u64::from(self.tlog.out.is_some())
            + u64::from(self.calls.out.is_some())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pilot::{Decision, Source};
    use greylag_control::Target;
    use greylag_link::autopilot::Mode;
    use greylag_logs::Sample;
    use greylag_logs::csv::{self, Tolerance};
    use greylag_physics::{Command, Time};

    fn row(i: u64) -> Row {
        let sample = Sample {
            time_s: i as f64 * 0.01,
            attitude_rad: [0.1, 0.2, 0.3],
            rates_radps: [0.0; 3],
            airspeed_mps: 20.0,
            aileron_cmd: 0.1,
            elevator_cmd: 0.1,
            throttle_cmd: 0.1,
            ..Sample::default()
        };
        let decision = Decision {
            time: Time::default(),
            command: Command::IDLE,
            source: Source::Planned,
            armed: true,
            mode: Mode::Offboard,
            target: Target { roll: 0.0, pitch: 0.0, airspeed: 20.0 },
            failsafe: false,
            refused: None,
        };
        let residuals = [0.5, -2.0, 0.0, 0.0, 0.0, f64::NAN];
        let derivatives = [90.0, -12.5, f64::NAN, f64::NAN];
        Row { sample, decision, latency_us: 123.4, residuals, derivatives }
    }

    /// A heartbeat of system 1, component 1 in MAVLink 2, written by rust-mavlink.
    fn frame() -> Vec<u8> {
        use mavlink::dialects::ardupilotmega::{HEARTBEAT_DATA, MavMessage};
        let header = mavlink::MavHeader { system_id: 1, component_id: 1, sequence: 0 };
        let mut bytes = Vec::new();
        mavlink::write_v2_msg(
            &mut bytes,
            header,
            &MavMessage::HEARTBEAT(HEARTBEAT_DATA::default()),
        )
        .unwrap();
        bytes
    }

    #[test]
    fn a_recording_reads_back_with_its_extra_columns_and_whole_frames() {
        let root = tempfile::tempdir().unwrap();
        let recorder = Recorder::start(&Place::Numbered(root.path().to_owned())).unwrap();
        (0..300).for_each(|i| recorder.row(row(i)));
        // A message id that no dialect has: 0x7F3039.
        let unknown = [0xFD_u8, 2, 0, 0, 5, 7, 1, 0x39, 0x30, 0x7F, 1, 2, 0, 0];
        let two = [&frame()[..], &unknown[..], &frame()[..]].concat();
        recorder.bytes(0x0001_0203_0405_0607, &two);
        let folder = recorder.folder().to_owned();
        assert!(folder.ends_with("0001"));
        assert_eq!(recorder.finish(), Written { rows: 300, frames: 2, unknown: 1, dropped: 0 });
        let reading = csv::load(&folder.join("flight.csv"), Tolerance::Strict).unwrap();
        assert_eq!(reading.flight.samples.len(), 300);
        assert_eq!(reading.unknown_columns, Row::EXTRA);
        let text = std::fs::read_to_string(folder.join("flight.csv")).unwrap();
        let end = ",20,OFFBOARD,1,planned,0,123.4,0.500,-2.000,0.000,0.000,0.000,,90.000,-12.500,,";
        assert!(text.lines().nth(1).unwrap().ends_with(end), "{text}");
        let record = [&[0, 1, 2, 3, 4, 5, 6, 7][..], &frame()].concat();
        assert_eq!(
            std::fs::read(folder.join("flight.tlog")).unwrap(),
            [record.clone(), record].concat()
        );
    }

    #[test]
    fn what_is_recorded_is_on_the_disk_within_a_second() {
        let root = tempfile::tempdir().unwrap();
        let recorder = Recorder::start(&Place::Exactly(root.path().join("flight"))).unwrap();
        recorder.row(row(1));
        std::thread::sleep(Duration::from_secs(1));
        let text = std::fs::read_to_string(recorder.folder().join("flight.csv")).unwrap();
        assert_eq!(text.lines().count(), 2);
    }

    #[test]
    fn nothing_is_overwritten() {
        let root = tempfile::tempdir().unwrap();
        let numbered = Place::Numbered(root.path().join("flights"));
        let folders: Vec<_> =
            (0..3).map(|_| Recorder::start(&numbered).unwrap().folder().to_owned()).collect();
        assert!(folders[2].ends_with("0003"));
        let error = Recorder::start(&Place::Exactly(folders[0].clone())).unwrap_err();
        assert!(matches!(error, RecordError::Exists { .. }), "{error}");
        std::fs::write(root.path().join("file"), "").unwrap();
        assert!(Recorder::start(&Place::Numbered(root.path().join("file"))).is_err());
    }

    #[test]
    fn a_full_disk_is_told_once_and_control_is_not_disturbed() {
        // /dev/full refuses every write as a full disk does.
        let full = || std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let recorder = Recorder::over(PathBuf::from("nowhere"), full(), full(), full()).unwrap();
        for i in 0..1000 {
            recorder.call(Call::Advance(Time::from_micros(i)));
            recorder.row(row(i));
            recorder.bytes(0, &frame());
        }
        std::thread::sleep(Duration::from_secs(1));
        let reported: Vec<_> = std::iter::from_fn(|| recorder.trouble()).collect();
        assert_eq!(reported.len(), 3, "{reported:?}");
        assert!(
            reported.iter().any(|t| t.contains("flight.csv"))
                && reported.iter().any(|t| t.contains("flight.tlog"))
        );
        recorder.row(row(2000));
        assert!(recorder.trouble().is_none());
        assert!(recorder.finish().dropped > 0);
    }

    #[test]
    fn a_disk_that_refuses_the_last_buffer_is_not_summed_up_as_a_whole_recording() {
        let full = || std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let recorder = Recorder::over(PathBuf::from("nowhere"), full(), full(), full()).unwrap();
        recorder.row(row(1));
        // The row fits into the buffer, so the write fails only when the file is closed.
        assert!(recorder.finish().dropped > 0);
    }

    /// A disk that hangs at its first write.
    struct Stuck {
        hangs: Duration,
    }

    impl Write for Stuck {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            std::thread::sleep(std::mem::take(&mut self.hangs));
            Ok(bytes.len())
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_slow_disk_costs_rows_that_are_counted_and_no_time() {
        let stuck = || Stuck { hangs: Duration::from_secs(1) };
        let recorder = Recorder::over(PathBuf::from("nowhere"), stuck(), stuck(), stuck()).unwrap();
        let before = Instant::now();
        // Twice the capacity of the queue: nearly half of the rows are dropped while the disk hangs.
        (0..2 * QUEUE as u64).for_each(|i| recorder.row(row(i)));
        assert!(before.elapsed() < Duration::from_millis(500), "{:?}", before.elapsed());
        assert!(recorder.dropped() > QUEUE as u64 / 2, "{}", recorder.dropped());
    }
}
