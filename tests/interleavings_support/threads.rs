//! A bounded queue as crossbeam's, on locks that shuttle schedules. A deadline passes at any time that nothing waits.

use shuttle::rand::{Rng, thread_rng};
use shuttle::sync::{Condvar, Mutex};
use std::collections::VecDeque;
use std::time::Instant;

pub use shuttle::sync::Arc;
pub use shuttle::sync::atomic::{AtomicU64, Ordering};
pub use shuttle::thread::{Builder, JoinHandle};

pub use crossbeam_channel::{RecvError, RecvTimeoutError, SendError, TryRecvError, TrySendError};

struct Inner<T> {
    waiting: VecDeque<T>,
    senders: usize,
    receivers: usize,
}

struct Shared<T> {
    size: usize,
    inner: Mutex<Inner<T>>,
    changed: Condvar,
}

pub struct Sender<T>(Arc<Shared<T>>);
pub struct Receiver<T>(Arc<Shared<T>>);

pub fn bounded<T>(size: usize) -> (Sender<T>, Receiver<T>) {
    let inner = Mutex::new(Inner { waiting: VecDeque::new(), senders: 1, receivers: 1 });
    let shared = Arc::new(Shared { size, inner, changed: Condvar::new() });
    (Sender(shared.clone()), Receiver(shared))
}

impl<T> Sender<T> {
    pub fn try_send(&self, item: T) -> Result<(), TrySendError<T>> {
        let mut inner = self.0.inner.lock().unwrap();
        if inner.receivers == 0 {
            return Err(TrySendError::Disconnected(item));
        }
        if inner.waiting.len() == self.0.size {
            return Err(TrySendError::Full(item));
        }
        inner.waiting.push_back(item);
        self.0.changed.notify_all();
        Ok(())
    }

    pub fn send(&self, item: T) -> Result<(), SendError<T>> {
        let mut inner = self.0.inner.lock().unwrap();
        while inner.waiting.len() == self.0.size && inner.receivers > 0 {
            inner = self.0.changed.wait(inner).unwrap();
        }
        if inner.receivers == 0 {
            return Err(SendError(item));
        }
        inner.waiting.push_back(item);
        self.0.changed.notify_all();
        Ok(())
    }
}

impl<T> Receiver<T> {
    pub fn try_recv(&self) -> Result<T, TryRecvError> {
        let mut inner = self.0.inner.lock().unwrap();
        let item = inner.waiting.pop_front();
        self.0.changed.notify_all();
        let none =
            if inner.senders == 0 { TryRecvError::Disconnected } else { TryRecvError::Empty };
        item.ok_or(none)
    }

    pub fn recv(&self) -> Result<T, RecvError> {
        let mut inner = self.0.inner.lock().unwrap();
        while inner.waiting.is_empty() && inner.senders > 0 {
            inner = self.0.changed.wait(inner).unwrap();
        }
        self.0.changed.notify_all();
        inner.waiting.pop_front().ok_or(RecvError)
    }

    pub fn recv_deadline(&self, _: Instant) -> Result<T, RecvTimeoutError> {
        loop {
            match self.try_recv() {
                Ok(item) => return Ok(item),
                Err(TryRecvError::Disconnected) => return Err(RecvTimeoutError::Disconnected),
                Err(TryRecvError::Empty) if thread_rng().gen_bool(0.3) => {
                    return Err(RecvTimeoutError::Timeout);
                }
                Err(TryRecvError::Empty) => shuttle::thread::yield_now(),
            }
        }
    }
}

impl<T> Iterator for IntoIter<T> {
    type Item = T;
    fn next(&mut self) -> Option<T> {
        self.0.recv().ok()
    }
}

pub struct IntoIter<T>(Receiver<T>);

impl<T> IntoIterator for Receiver<T> {
    type Item = T;
    type IntoIter = IntoIter<T>;
    fn into_iter(self) -> IntoIter<T> {
        IntoIter(self)
    }
}

impl<T> Drop for Sender<T> {
    fn drop(&mut self) {
        // while a panic unwinds, nobody is left who waits
        if let Ok(mut inner) = self.0.inner.lock() {
            inner.senders -= 1;
            self.0.changed.notify_all();
        }
    }
}

impl<T> Drop for Receiver<T> {
    fn drop(&mut self) {
        if let Ok(mut inner) = self.0.inner.lock() {
            inner.receivers -= 1;
            inner.waiting.clear();
            self.0.changed.notify_all();
        }
    }
}

impl<T> std::fmt::Debug for Sender<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Sender")
    }
}
