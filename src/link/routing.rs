//! Routing of MAVLink frames between clients (ground stations and offboard programs) and a flight controller.
//!
//! Frames that are not addressed to this program are forwarded unmodified. A frame from the controller to a
//! target goes to the peers from which frames of that target have arrived. A frame without a target goes to all peers.

use std::time::Duration;

use super::framing::{Frame, Source, pieces};
use super::peer::PeerId;
use super::wire::controller as wire;

/// Largest number of routes.
const MAX_ROUTES: usize = 64;
/// Time without frames after which a route is removed.
const FORGOTTEN: Duration = Duration::from_secs(60);

/// Destination of a client's frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// The frame is forwarded to the flight controller.
    Controller,
    /// The frame is only handled by this program.
    Ours,
    /// The frame is dropped. It has this program's own ids as its source, commands the aircraft while this program has control
    /// authority, or contains a signing key.
    Nowhere,
}

/// The routing table. It lists the peers from which frames of each system and component have arrived.
#[derive(Clone, Debug, Default)]
pub struct Router {
    routes: Vec<(Source, PeerId, Duration)>,
    /// Number of frames from clients that were dropped ([`Way::Nowhere`]).
    pub held: u64,
}

impl Router {
    /// Adds or renews a route for the sender of each frame in `bytes`, which `peer` has sent. Removes old routes.
    pub fn learn(&mut self, host: Duration, peer: PeerId, bytes: &[u8]) {
        pieces(bytes, |_, frame| {
            let Some(Frame { source, .. }) = frame else { return };
            let known = self.routes.iter().position(|(s, at, _)| (*s, *at) == (source, peer));
            match known {
                Some(at) => self.routes[at].2 = host,
                None if self.routes.len() < MAX_ROUTES => self.routes.push((source, peer, host)),
                None => {}
            }
        });
        self.routes.retain(|(.., heard)| host.saturating_sub(*heard) < FORGOTTEN);
    }

    /// Removes the routes of a peer.
    pub fn forget(&mut self, peer: PeerId) {
        self.routes.retain(|(_, at, _)| *at != peer);
    }

    /// Those frames of `bytes` from a client that are forwarded to the controller. `us` identifies this program. `engaged` states
    /// whether this program has control authority.
    pub fn to_controller(&mut self, bytes: &[u8], us: Source, engaged: bool) -> Vec<u8> {
        let mut on = Vec::new();
        let mut held = 0;
        pieces(bytes, |bytes, frame| match way(frame.as_ref(), us, engaged) {
            Way::Controller => on.extend_from_slice(bytes),
            Way::Nowhere => held += 1,
            Way::Ours => {}
        });
        self.held += held;
        on
    }

    /// Those frames of `bytes` from the controller that are forwarded to `peer`: broadcasts, and frames for a system and
    /// component whose frames `peer` has sent before. SETUP_SIGNING, which contains a secret key, is never forwarded.
    pub fn to_client(&self, bytes: &[u8], peer: PeerId) -> Vec<u8> {
        let mut on = Vec::new();
        pieces(bytes, |bytes, frame| {
            if frame.as_ref().is_some_and(|frame| frame.id == wire::SETUP_SIGNING) {
                return;
            }
            let target = frame.as_ref().map_or((0, 0), wire::recipient);
            if self.is_there(target, peer) {
                on.extend_from_slice(bytes);
            }
        });
        on
    }

    fn is_there(&self, (system, component): (u8, u8), peer: PeerId) -> bool {
        system == 0
            || self.routes.iter().any(|(source, at, _)| {
                *at == peer
                    && source.system == system
                    && (component == 0 || source.component == component)
            })
    }
}

/// Destination of a client's frame.
pub fn way(frame: Option<&Frame<'_>>, us: Source, engaged: bool) -> Way {
    // a frame of an unknown message cannot be decoded and is forwarded
    let Some(frame) = frame else { return Way::Controller };
    if frame.source == us || frame.id == wire::SETUP_SIGNING {
        return Way::Nowhere;
    }
    let (system, component) = wire::recipient(frame);
    if component == us.component && (system == 0 || system == us.system) {
        Way::Ours
    } else if engaged && wire::steers(frame.id) && (system == 0 || system == us.system) {
        Way::Nowhere
    } else {
        Way::Controller
    }
}
