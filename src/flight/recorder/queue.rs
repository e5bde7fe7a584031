//! A queue into a thread that never holds up whoever fills it: what does not fit is dropped and counted.

use crate::threads::{AtomicU64, Builder, JoinHandle, Ordering, Receiver, Sender, bounded};

/// The filling end of a queue of `E` into a thread that comes to a `W`.
#[derive(Debug)]
pub struct Queue<E, W> {
    entries: Option<Sender<E>>,
    dropped: AtomicU64,
    thread: Option<JoinHandle<W>>,
}

impl<E: Send + 'static, W: Default + Send + 'static> Queue<E, W> {
    /// A queue for `size` entries into a thread called `name`, which does `work` until the queue is closed and empty.
    ///
    /// # Errors
    /// The thread cannot be started.
    pub fn start(
        name: &str,
        size: usize,
        work: impl FnOnce(Receiver<E>) -> W + Send + 'static,
    ) -> std::io::Result<Self> {
        let (entries, to_do) = bounded(size);
        let thread = Builder::new().name(name.into()).spawn(move || work(to_do))?;
        Ok(Queue { entries: Some(entries), dropped: AtomicU64::new(0), thread: Some(thread) })
    }

    /// Hands `entry` over, or drops it if the queue is full or its thread has died. Never waits.
    pub fn hand_over(&self, entry: E) {
        let lost = self.entries.as_ref().is_none_or(|entries| entries.try_send(entry).is_err());
        if lost {
            self.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// How many entries were dropped so far.
    pub fn dropped(&self) -> u64 {
        self.dropped.load(Ordering::Relaxed)
    }

    /// Closes the queue, waits until all that is in it is done, and gives what it came to; the default if the thread has died
    /// of a panic or the queue was closed before.
    pub fn close(&mut self) -> W {
        self.entries = None;
        self.thread.take().and_then(|thread| thread.join().ok()).unwrap_or_default()
    }
}
