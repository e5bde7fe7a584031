//! A queue to another thread. It never blocks the sender: entries that do not fit are dropped and counted.

use crate::threads::{AtomicU64, Builder, JoinHandle, Ordering, Receiver, Sender, bounded};

/// Sending end of a queue of entries `E`. The receiving thread returns a `W` when it ends.
#[derive(Debug)]
pub struct Queue<E, W> {
    entries: Option<Sender<E>>,
    dropped: AtomicU64,
    thread: Option<JoinHandle<W>>,
}

impl<E: Send + 'static, W: Default + Send + 'static> Queue<E, W> {
    /// Starts a thread called `name` that runs `work`, and returns a queue of at most `size` entries to this thread. `work` can
    /// receive entries until the queue is closed and empty.
    ///
    /// # Errors
    ///
    /// If the thread cannot be started.
    pub fn start(
        name: &str,
        size: usize,
        work: impl FnOnce(Receiver<E>) -> W + Send + 'static,
    ) -> std::io::Result<Self> {
        let (entries, to_do) = bounded(size);
        let thread = Builder::new().name(name.into()).spawn(move || work(to_do))?;
        Ok(Queue { entries: Some(entries), dropped: AtomicU64::new(0), thread: Some(thread) })
    }

    /// Queues `entry`, or drops it if the queue is full or its thread has ended. Never blocks.
    pub fn hand_over(&self, entry: E) {
        let lost = self.entries.as_ref().is_none_or(|entries| entries.try_send(entry).is_err());
        if lost {
            self.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Number of entries dropped.
    pub fn dropped(&self) -> u64 {
        self.dropped.load(Ordering::Relaxed)
    }

    /// Closes the queue, waits for the thread and returns its result. Returns the default value if the thread has
    /// panicked or the queue was closed before.
    pub fn close(&mut self) -> W {
        self.entries = None;
        self.thread.take().and_then(|thread| thread.join().ok()).unwrap_or_default()
    }
}
