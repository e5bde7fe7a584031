//! Routing: what is not for us goes on unmodified, only where its target was heard.

use std::time::Duration;

use super::framing::{Frame, Source, pieces};
use super::peer::PeerId;
use super::wire::controller as wire;

/// Correspondents remembered at most.
const MAX_ROUTES: usize = 64;
/// One that was silent for this long is forgotten.
const FORGOTTEN: Duration = Duration::from_secs(60);

/// What becomes of a frame of a client.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// It goes on to the controller.
    Controller,
    /// It is for us alone.
    Ours,
    /// It goes nowhere: it would take control authority from whoever has it, or give a key away.
    Nowhere,
}

/// Who was heard where.
#[derive(Clone, Debug, Default)]
pub struct Router {
    routes: Vec<(Source, PeerId, Duration)>,
    /// Frames that were kept from the controller.
    pub held: u64,
}

impl Router {
    /// Learns from a client's bytes who is where.
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

    /// Forgets a peer that is gone.
    pub fn forget(&mut self, peer: PeerId) {
        self.routes.retain(|(_, at, _)| *at != peer);
    }

    /// The frames of a client's bytes that the controller shall have, as they came. `us` is who we
    /// are, `engaged` whether we steer.
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

    /// The frames of the controller's bytes that `peer` shall have: those for everybody, and those
    /// for whoever was heard there; a key never.
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

/// Where a client's frame goes.
pub fn way(frame: Option<&Frame<'_>>, us: Source, engaged: bool) -> Way {
    // Of an unknown message nothing is known but that it is none of ours.
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
