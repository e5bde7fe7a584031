//! Systemd's watchdog: it is told that the control thread goes its rounds.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use sd_notify::NotifyState;

/// Tells systemd, where its watchdog watches this process, twice in each of its periods that `rounds` has grown. A
/// control thread that hangs is said nothing of, and the process is started anew.
pub fn feed(rounds: Arc<AtomicU64>) {
    let Some(period) = sd_notify::watchdog_enabled() else { return };
    let told = std::thread::Builder::new().name("watchdog".into()).spawn(move || {
        let mut last = None;
        loop {
            let now = rounds.load(Ordering::Relaxed);
            if last != Some(now) {
                // without systemd's socket nobody watches either
                let _ = sd_notify::notify(&[NotifyState::Watchdog]);
            }
            last = Some(now);
            std::thread::sleep((period / 2).max(Duration::from_millis(10)));
        }
    });
    if let Err(why) = told {
        eprintln!("greylag: systemd's watchdog will not be fed: {why}");
    }
}
