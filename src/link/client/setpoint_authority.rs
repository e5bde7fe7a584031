//! Control authority over setpoints: one client at a time, until its stream stops.

use std::time::Duration;

use crate::peer::PeerId;

/// Silence after which another client may take control authority. It equals the default timeout that ends OFFBOARD, so
/// a restarted client can have authority again when the aircraft changes to HOLD.
const RELEASE: Duration = Duration::from_secs(1);

/// Holder of control authority for one kind of setpoint. Without it, two simultaneous streams would command the
/// surfaces alternately.
#[derive(Debug, Default)]
pub struct SetpointAuthority {
    holder: Option<(PeerId, Duration)>,
}

impl SetpointAuthority {
    /// Whether a setpoint from `peer` is accepted. If so, `peer` holds control authority from now on.
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

    /// Releases the control authority of `peer`, for instance when its connection is closed.
    pub fn release(&mut self, peer: PeerId) {
        if self.holder.is_some_and(|(holder, _)| holder == peer) {
            self.holder = None;
        }
    }
}
