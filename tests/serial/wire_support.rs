//! A serial cable between two pseudo-terminals: it carries bytes at its baud rate, garbles them for
//! a port that is set to another, and can be pulled and plugged in again.
#![allow(dead_code)] // each test that includes this module uses its part

use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use serialport::{SerialPort, TTYPort};

/// One end: the pseudo-terminal's far side, held by the cable, and the name of its near side.
struct End {
    far: Mutex<Option<TTYPort>>,
    name: PathBuf,
}

impl End {
    fn plug(&self) {
        let (mut far, near) = TTYPort::pair().expect("a pseudo-terminal");
        far.set_timeout(Duration::from_millis(5)).unwrap();
        std::os::unix::fs::symlink(near.name().unwrap(), &self.name).unwrap();
        *self.far.lock().unwrap() = Some(far);
    }

    fn pull(&self) {
        *self.far.lock().unwrap() = None;
        let _ = std::fs::remove_file(&self.name);
    }

    /// Another handle on the far side, if the end is plugged in.
    fn handle(&self) -> Option<TTYPort> {
        let far = self.far.lock().unwrap();
        let mut copy = far.as_ref()?.try_clone_native().ok()?;
        copy.set_timeout(Duration::from_millis(5)).ok()?;
        Some(copy)
    }
}

/// What runs in the cable's two threads.
struct Core {
    ends: [End; 2],
    baud: u32,
    stop: AtomicBool,
    /// Pulled on purpose: bytes are lost.
    epoch: AtomicU64,
    /// Bytes carried, towards the first and the second end.
    carried: [AtomicU64; 2],
}

/// The cable. Its ends are files in a folder: `companion` and `controller`.
pub struct Cable {
    core: Arc<Core>,
    threads: Vec<JoinHandle<()>>,
    _folder: tempfile::TempDir,
}

impl Cable {
    pub fn new(baud: u32) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let end = |name: &str| End { far: Mutex::new(None), name: folder.path().join(name) };
        let core = Arc::new(Core {
            ends: [end("companion"), end("controller")],
            baud,
            stop: AtomicBool::new(false),
            epoch: AtomicU64::new(0),
            carried: Default::default(),
        });
        core.ends.iter().for_each(End::plug);
        let carry = |from: usize| {
            let core = core.clone();
            std::thread::spawn(move || core.carry(from))
        };
        let threads = vec![carry(0), carry(1)];
        Cable { core, threads, _folder: folder }
    }

    /// The companion's `--vehicle`, at a baud rate of its own.
    pub fn companion_at(&self, baud: u32) -> String {
        format!("serial:{}:{baud}", self.core.ends[0].name.display())
    }

    pub fn companion(&self) -> String {
        self.companion_at(self.core.baud)
    }

    /// The shim's `--link`.
    pub fn controller(&self) -> String {
        format!("serial:{}:{}", self.core.ends[1].name.display(), self.core.baud)
    }

    pub fn companion_device(&self) -> &Path {
        &self.core.ends[0].name
    }

    /// Pulls the companion's plug: its device is gone, as that of a USB adapter is.
    pub fn pull(&self) {
        self.core.epoch.fetch_add(1, Ordering::Relaxed);
        self.core.ends[0].pull();
        // The threads' own handles go too, or the device would linger.
        std::thread::sleep(Duration::from_millis(30));
    }

    pub fn plug(&self) {
        self.core.ends[0].plug();
        self.core.epoch.fetch_add(1, Ordering::Relaxed);
    }

    /// Bytes carried so far: towards the companion, towards the controller.
    pub fn carried(&self) -> [u64; 2] {
        [0, 1].map(|i| self.core.carried[i].load(Ordering::Relaxed))
    }
}

impl Drop for Cable {
    fn drop(&mut self) {
        self.core.stop.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
        self.core.ends.iter().for_each(End::pull);
    }
}

impl Core {
    /// Carries bytes from one end to the other until told to stop.
    fn carry(&self, from: usize) {
        let to = 1 - from;
        let mut free_at = Instant::now();
        while !self.stop.load(Ordering::Relaxed) {
            let epoch = self.epoch.load(Ordering::Relaxed);
            let (Some(mut source), Some(mut sink)) =
                (self.ends[from].handle(), self.ends[to].handle())
            else {
                // One end hangs in the air: what the other one says is lost.
                if let Some(mut source) = self.ends[from].handle() {
                    let _ = source.read(&mut [0; 512]);
                }
                std::thread::sleep(Duration::from_millis(2));
                continue;
            };
            let mut bytes = [0; 64];
            while epoch == self.epoch.load(Ordering::Relaxed) && !self.stop.load(Ordering::Relaxed)
            {
                let len = match source.read(&mut bytes) {
                    Ok(len) => len,
                    Err(error) => {
                        if error.kind() != std::io::ErrorKind::TimedOut {
                            // Nobody holds the near end.
                            std::thread::sleep(Duration::from_millis(2));
                        }
                        continue;
                    }
                };
                // Ten bits a byte: start, eight, stop.
                let bits = Duration::from_secs_f64(len as f64 * 10.0 / f64::from(self.baud));
                free_at = free_at.max(Instant::now()) + bits;
                std::thread::sleep(free_at.saturating_duration_since(Instant::now()));
                self.garble(&source, &sink, &mut bytes[..len]);
                if write_all(&mut sink, &bytes[..len]) {
                    self.carried[to].fetch_add(len as u64, Ordering::Relaxed);
                }
            }
        }
    }

    /// A port at another rate than the wire's reads, or writes, something else.
    fn garble(&self, source: &TTYPort, sink: &TTYPort, bytes: &mut [u8]) {
        let wrong = |port: &TTYPort| port.baud_rate().is_ok_and(|baud| baud != self.baud);
        if wrong(source) || wrong(sink) {
            bytes.iter_mut().for_each(|b| *b = b.rotate_left(3) ^ 0x5A);
        }
    }
}

fn write_all(port: &mut TTYPort, mut bytes: &[u8]) -> bool {
    let end = Instant::now() + Duration::from_millis(50);
    while !bytes.is_empty() {
        match port.write(bytes) {
            Ok(len) => bytes = &bytes[len..],
            // Nobody reads: the bytes fall out of the end of the wire.
            Err(_) if Instant::now() >= end => return false,
            Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => return false,
            Err(_) => {}
        }
    }
    true
}
