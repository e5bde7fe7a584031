//! Decides which client's setpoints are accepted. A client is a ground station or an offboard program. One client at a time has
//! this authority, until its setpoints stop.

use std::time::Duration;

use crate::peer::PeerId;

/// Time without setpoints from the holder after which another client may take the authority. It equals the default timeout that
/// changes the mode from OFFBOARD to HOLD. A client that was restarted can therefore have the authority again by the time of
/// that change.
const RELEASE: Duration = Duration::from_secs(1);

/// Authority over one kind of setpoint. Without it, two clients that send setpoints at the same time would command the aircraft
/// alternately.
#[derive(Debug, Default)]
pub struct SetpointAuthority {
    holder: Option<(PeerId, Duration)>,
}

impl SetpointAuthority {
    /// Whether a setpoint that `peer` sends at the time `host` is accepted. If so, `peer` holds the authority from now on.
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

    /// Releases the authority if `peer` holds it, for instance when its connection is closed.
    pub fn release(&mut self, peer: PeerId) {
        if self.holder.is_some_and(|(holder, _)| holder == peer) {
            self.holder = None;
        }
    }
}
