//! The links of a flight, by number.

use std::net::SocketAddr;

use crossbeam_channel::{Receiver, bounded};

use super::Options;
use crate::link::peer::{LinkId, PeerId};
use crate::link::transport::{Arrival, Link, Network, TransportError};

/// Packets of the vehicle that may wait: two seconds, far beyond what control may stall.
const VEHICLE_QUEUE: usize = 256;
/// Packets of clients that may wait; a flood loses the rest.
const CLIENT_QUEUE: usize = 512;

/// The open links with the channels of what arrives on them.
pub(super) struct Ports {
    pub(super) vehicle: Link,
    pub(super) clients: Vec<Link>,
    pub(super) from_vehicle: Receiver<Arrival>,
    pub(super) from_clients: Receiver<Arrival>,
    // Dropped last: it closes the sockets.
    _network: Network,
}

impl Ports {
    /// Opens all links, or none.
    pub(super) fn open(options: &Options) -> Result<Self, TransportError> {
        let network = Network::start()?;
        let (to_vehicle, from_vehicle) = bounded(VEHICLE_QUEUE);
        let (to_clients, from_clients) = bounded(CLIENT_QUEUE);
        let vehicle = network.open(LinkId(0), &options.vehicle, "--vehicle", to_vehicle)?;
        let open = |(i, address)| {
            network.open(LinkId(1 + i as u16), address, "--client", to_clients.clone())
        };
        let clients = options.clients.iter().enumerate().map(open).collect::<Result<_, _>>()?;
        Ok(Ports { vehicle, clients, from_vehicle, from_clients, _network: network })
    }

    pub(super) fn vehicle_address(&self) -> Option<SocketAddr> {
        self.vehicle.local()
    }

    pub(super) fn client_addresses(&self) -> Vec<Option<SocketAddr>> {
        self.clients.iter().map(Link::local).collect()
    }

    /// Sends a frame to a client on the link where it was heard.
    pub(super) fn send_to_client(&self, peer: PeerId, frame: Vec<u8>) {
        if let Some(link) = self.clients.iter().find(|link| link.id() == peer.link) {
            link.send(peer, frame);
        }
    }
}
