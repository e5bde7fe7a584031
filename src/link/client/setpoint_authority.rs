//! Who steers: one client at a time, until it falls silent.

use std::time::Duration;

use crate::peer::PeerId;

/// After this silence another client may take control authority. It equals the time after which a lost
/// setpoint stream ends OFFBOARD, so that a restarted client waits no longer than the aircraft.
const RELEASE: Duration = Duration::from_secs(1);

/// Who may send one kind of setpoint: two clients that send at once must not shake the surfaces.
#[derive(Debug, Default)]
pub struct SetpointAuthority {
    holder: Option<(PeerId, Duration)>,
}

impl SetpointAuthority {
    /// Whether a setpoint from `peer` is to be followed; if so it has control authority from now on.
    pub fn takes(&mut self, peer: PeerId, host: Duration) -> bool {
        match self.holder {
            Some((holder, heard)) if holder != peer && host.saturating_sub(heard) < RELEASE => {
                false
            }
            _ => {
                self.holder = Some((peer, host));
                true
            }
        }
    }

    /// Leaves control authority to the next one, as when the holder's connection has closed.
    pub fn release(&mut self, peer: PeerId) {
        if self.holder.is_some_and(|(holder, _)| holder == peer) {
            self.holder = None;
        }
    }
}
