//! Notifies systemd's watchdog as long as the control thread runs.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use sd_notify::NotifyState;

use crate::commands::terminal::complain;

/// Starts a thread that checks `rounds` twice per watchdog period and notifies systemd's watchdog if the value has changed.
/// The control thread increments `rounds` in each of its cycles. If it hangs, the notifications stop, and systemd restarts
/// the process. Without a watchdog for this process, the function does nothing.
pub fn feed(rounds: Arc<AtomicU64>) {
    let Some(period) = sd_notify::watchdog_enabled() else { return };
    let started = std::thread::Builder::new().name("watchdog".into()).spawn(move || {
        let mut last = None;
        loop {
            let now = rounds.load(Ordering::Relaxed);
            if last != Some(now) {
                // an error means that there is no systemd socket, and no watchdog
                let _ = sd_notify::notify(&[NotifyState::Watchdog]);
            }
            last = Some(now);
            std::thread::sleep((period / 2).max(Duration::from_millis(10)));
        }
    });
    if let Err(why) = started {
        complain(format_args!("systemd's watchdog will not be fed: {why}"));
    }
}
