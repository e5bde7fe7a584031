//! The links of a flight to the vehicle and to the clients (ground stations and offboard programs), with the queues of arrived
//! packets and with the signing of frames.

use std::net::SocketAddr;

use crossbeam_channel::{Receiver, bounded};

use super::guard::Guard;
use super::{FlightError, FlightOptions, Pace};
use greylag_link::peer::{LinkId, PeerId};
use greylag_link::signing::SigningCounts;
use greylag_link::transport::{Arrival, Link, Network, Packet};

/// Capacity of the vehicle's queue, packets. It holds about 2 s of telemetry, which is longer than most stalls of the control
/// thread.
const VEHICLE_QUEUE: usize = 256;
/// Capacity of the clients' queue, packets. Further packets are dropped.
const CLIENT_QUEUE: usize = 512;

/// The open links, and the queues of the packets that arrive on them.
pub(super) struct Ports {
    vehicle: Link,
    pub(super) clients: Vec<Link>,
    guard: Option<Guard>,
    pub(super) from_vehicle: Receiver<Arrival>,
    pub(super) from_clients: Receiver<Arrival>,
    // Must be dropped last, because dropping it closes the sockets.
    network: Network,
}

impl Ports {
    /// Opens all links. If one cannot be opened, none stays open.
    pub(super) fn open(options: &FlightOptions) -> Result<Self, FlightError> {
        let guard = options.signing.as_ref().map(|s| Guard::open(s, options)).transpose()?;
        let mut network = Network::start()?;
        if options.pace == Pace::Lockstep {
            network.take_all();
        }
        let (to_vehicle, from_vehicle) = bounded(VEHICLE_QUEUE);
        let (to_clients, from_clients) = bounded(CLIENT_QUEUE);
        let vehicle = network.open(LinkId(0), &options.vehicle, "--vehicle", to_vehicle)?;
        let open = |(i, address)| {
            network.open(LinkId(1 + i as u16), address, "--client", to_clients.clone())
        };
        let clients = options.clients.iter().enumerate().map(open).collect::<Result<_, _>>()?;
        Ok(Ports { vehicle, clients, guard, from_vehicle, from_clients, network })
    }

    pub(super) fn vehicle_address(&self) -> Option<SocketAddr> {
        self.vehicle.local()
    }

    pub(super) fn client_addresses(&self) -> Vec<Option<SocketAddr>> {
        self.clients.iter().map(Link::local).collect()
    }

    /// Number of rounds of the network thread. It polls every socket between two rounds.
    pub(super) fn rounds(&self) -> u64 {
        self.network.rounds()
    }

    /// The vehicle's peer, if its address is known before its first packet.
    pub(super) fn vehicle_target(&self) -> Option<PeerId> {
        self.vehicle.target()
    }

    /// Sends frames to the vehicle.
    pub(super) fn send_to_vehicle(&mut self, unix_us: u64, peer: PeerId, frames: Vec<u8>) {
        let frames = self.signed(unix_us, peer.link, frames);
        // frames that cannot be signed were removed
        if !frames.is_empty() {
            self.vehicle.send(peer, frames);
        }
    }

    /// Sends a frame to a client on the client's link.
    pub(super) fn send_to_client(&mut self, unix_us: u64, peer: PeerId, frame: Vec<u8>) {
        let frame = self.signed(unix_us, peer.link, frame);
        if let Some(link) = self.clients.iter().find(|link| link.id() == peer.link)
            && !frame.is_empty()
        {
            link.send(peer, frame);
        }
    }

    fn signed(&mut self, unix_us: u64, link: LinkId, bytes: Vec<u8>) -> Vec<u8> {
        match &mut self.guard {
            Some(guard) => guard.sign(unix_us, link, bytes),
            None => bytes,
        }
    }

    /// Removes frames without a valid signature from a packet.
    pub(super) fn sift(&mut self, unix_us: u64, packet: &mut Packet) {
        if let Some(guard) = &mut self.guard {
            let bytes = std::mem::take(&mut packet.bytes);
            packet.bytes = guard.believed(unix_us, packet.peer.link, bytes);
        }
    }

    /// Text of a new error of the file that stores the signing timestamp. Each error is returned once.
    pub(super) fn trouble(&self) -> Option<String> {
        self.guard.as_ref().and_then(Guard::trouble)
    }

    /// Signing counters; `None` without signing.
    pub(super) fn signing(&self) -> Option<SigningCounts> {
        self.guard.as_ref().map(Guard::counts)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runtime::guard::{Signing, VehicleLink};
    use greylag_link::framing::{Source, Version, write};
    use greylag_link::signing::Key;
    use greylag_physics::servos::Travels;
    use std::net::UdpSocket;
    use std::time::Duration;

    #[test]
    fn frames_that_cannot_be_signed_leave_no_empty_datagram() {
        let folder = tempfile::tempdir().unwrap();
        let key = folder.path().join("key");
        Key::from_bytes([7; 32]).save(&key).unwrap();
        let options = FlightOptions {
            vehicle: "udpin:127.0.0.1:0".parse().unwrap(),
            clients: vec![],
            record: None,
            pace: Pace::RealTime,
            duration: None,
            plan_deadline: FlightOptions::PLAN_DEADLINE,
            travels: Travels::alike(0.4),
            mixer: None,
            controller: None,
            delay_margin: None,
            signing: Some(Signing { key, vehicle: VehicleLink::Signed, local: vec![] }),
        };
        let mut ports = Ports::open(&options).unwrap();
        let vehicle = UdpSocket::bind("127.0.0.1:0").unwrap();
        vehicle.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        let peer = PeerId { link: LinkId(0), address: vehicle.local_addr().unwrap() };
        let source = Source { system: 1, component: 191 };
        // A MAVLink 1 frame cannot be signed. The first datagram must therefore contain the second frame.
        for version in [Version::V1, Version::V2] {
            let heartbeat = write(version, 0, source, 0, &[0; 9]).unwrap();
            ports.send_to_vehicle(0, peer, heartbeat);
        }
        let mut bytes = [0; 300];
        assert!(vehicle.recv(&mut bytes).unwrap() > 0);
    }
}
