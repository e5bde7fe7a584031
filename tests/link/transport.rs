//! The transports over real sockets of this machine.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream, UdpSocket};
use std::time::{Duration, Instant};

use crossbeam_channel::{Receiver, bounded};
use greylag::link::address::{Address, HostPort};
use greylag::link::framing::{self, Source, Version};
use greylag::link::peer::{LinkId, PeerId};
use greylag::link::transport::{Arrival, Network, Packet};

/// Far above what loopback needs, so that only a hang fails.
const PATIENCE: Duration = Duration::from_secs(10);

fn local(port: u16) -> HostPort {
    HostPort { host: "127.0.0.1".into(), port }
}

/// A heartbeat-sized frame with a running number in it.
fn frame(number: u8) -> Vec<u8> {
    framing::write(
        Version::V2,
        number,
        Source { system: 1, component: 1 },
        0,
        &[1, 2, 3, 4, 5, 6, 7, 8, 9],
    )
    .unwrap()
}

fn next(inbox: &Receiver<Arrival>) -> Arrival {
    inbox.recv_timeout(PATIENCE).expect("nothing arrived")
}

fn packet(inbox: &Receiver<Arrival>) -> Packet {
    match next(inbox) {
        Arrival::Packet(packet) => packet,
        other => panic!("{other:?}"),
    }
}

fn opened(inbox: &Receiver<Arrival>) -> PeerId {
    match next(inbox) {
        Arrival::Opened(peer) => peer,
        other => panic!("{other:?}"),
    }
}

fn udp_client() -> UdpSocket {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    socket.set_read_timeout(Some(PATIENCE)).unwrap();
    socket
}

fn receive(socket: &UdpSocket) -> (Vec<u8>, SocketAddr) {
    let mut buffer = [0; 2048];
    let (len, from) = socket.recv_from(&mut buffer).expect("nothing received");
    (buffer[..len].to_vec(), from)
}

#[test]
fn a_udp_server_answers_each_peer_and_survives_a_dead_one() {
    let network = Network::start().unwrap();
    let (to, inbox) = bounded(64);
    let link = network.open(LinkId(3), &Address::UdpIn(local(0)), "--client", to).unwrap();
    let server = link.local().unwrap();
    let (one, two) = (udp_client(), udp_client());
    let mut peers = vec![];
    for (client, number) in [(&one, 1), (&two, 2)] {
        client.send_to(&frame(number), server).unwrap();
        let packet = packet(&inbox);
        assert_eq!((packet.bytes, packet.peer.link), (frame(number), LinkId(3)));
        assert_eq!(packet.peer.address, client.local_addr().unwrap());
        assert!(packet.arrived.elapsed() < PATIENCE);
        peers.push(packet.peer);
    }
    link.send(peers[1], frame(20));
    link.send(peers[0], frame(10));
    assert_eq!(receive(&one), (frame(10), server));
    assert_eq!(receive(&two), (frame(20), server));
    // The first one dies; what is sent to it comes back as ICMP port unreachable.
    drop(one);
    for number in 0..20 {
        link.send(peers[0], frame(number));
        link.send(peers[1], frame(number));
        assert_eq!(receive(&two).0, frame(number));
        two.send_to(&frame(number), server).unwrap();
        assert_eq!(packet(&inbox).bytes, frame(number));
    }
}

#[test]
fn a_udp_client_speaks_first_and_hears_an_answer_from_any_port() {
    let network = Network::start().unwrap();
    let (server, other) = (udp_client(), udp_client());
    let (to, inbox) = bounded(64);
    let port = server.local_addr().unwrap().port();
    let link = network.open(LinkId(0), &Address::UdpOut(local(port)), "--client", to).unwrap();
    let target = link.target().unwrap();
    assert_eq!(target.address, server.local_addr().unwrap());
    link.send(target, frame(1));
    let (bytes, us) = receive(&server);
    assert_eq!(bytes, frame(1));
    other.send_to(&frame(2), us).unwrap();
    assert_eq!(packet(&inbox).peer.address, other.local_addr().unwrap());
}

#[test]
fn a_port_in_use_is_one_clear_error() {
    let network = Network::start().unwrap();
    let (to, _inbox) = bounded(1);
    let udp = udp_client();
    let address = Address::UdpIn(local(udp.local_addr().unwrap().port()));
    let error = network.open(LinkId(0), &address, "--client", to.clone()).unwrap_err().to_string();
    assert_eq!(
        error,
        format!(
            "opening {address}: port already in use: stop the other program or give another address with --client"
        )
    );
    let tcp = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = Address::TcpIn(local(tcp.local_addr().unwrap().port()));
    let error = network.open(LinkId(0), &address, "--client", to.clone()).unwrap_err().to_string();
    assert!(error.contains("already in use"), "{error}");
    let serial = "serial:/dev/no-such-port:921600".parse().unwrap();
    let error = network.open(LinkId(0), &serial, "--vehicle", to.clone()).unwrap_err().to_string();
    assert!(error.contains("no such device") && error.contains("--vehicle"), "{error}");
    let nowhere = Address::UdpIn(HostPort { host: "no.such.host.invalid".into(), port: 1 });
    let error = network.open(LinkId(0), &nowhere, "--client", to).unwrap_err().to_string();
    assert!(error.contains("no.such.host.invalid"), "{error}");
}

#[test]
fn a_full_inbox_drops_and_counts_and_never_waits() {
    let network = Network::start().unwrap();
    let (to, inbox) = bounded(4);
    let link = network.open(LinkId(0), &Address::UdpIn(local(0)), "--client", to).unwrap();
    let client = udp_client();
    for number in 0..200 {
        client.send_to(&frame(number), link.local().unwrap()).unwrap();
    }
    let start = Instant::now();
    while link.counts().received < 200 {
        assert!(start.elapsed() < PATIENCE, "{:?}", link.counts());
        std::thread::sleep(Duration::from_millis(1));
    }
    assert_eq!((inbox.len(), link.counts().inbox_full), (4, 196));
    // Once fetched, the next one comes through.
    while inbox.try_recv().is_ok() {}
    client.send_to(&frame(7), link.local().unwrap()).unwrap();
    assert_eq!(packet(&inbox).bytes, frame(7));
}

#[test]
fn an_oversize_datagram_is_dropped_and_counted() {
    let network = Network::start().unwrap();
    let (to, inbox) = bounded(4);
    let link = network.open(LinkId(0), &Address::UdpIn(local(0)), "--client", to).unwrap();
    let client = udp_client();
    client.send_to(&[0xFD; 20_000], link.local().unwrap()).unwrap();
    client.send_to(&frame(1), link.local().unwrap()).unwrap();
    assert_eq!(packet(&inbox).bytes, frame(1));
    assert_eq!(link.counts().oversize, 1);
}

fn read_exactly(stream: &mut TcpStream, len: usize) -> Vec<u8> {
    let mut bytes = vec![0; len];
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    stream.read_exact(&mut bytes).expect("nothing received");
    bytes
}

#[test]
fn a_tcp_server_serves_several_and_cuts_the_stream_into_frames() {
    let network = Network::start().unwrap();
    let (to, inbox) = bounded(64);
    let link = network.open(LinkId(1), &Address::TcpIn(local(0)), "--client", to).unwrap();
    let mut one = TcpStream::connect(link.local().unwrap()).unwrap();
    let first = opened(&inbox);
    assert_eq!(first.address, one.local_addr().unwrap());
    let mut two = TcpStream::connect(link.local().unwrap()).unwrap();
    let second = opened(&inbox);
    // A listener is spoken to before it says a word.
    link.send(first, frame(1));
    link.send(second, frame(2));
    assert_eq!(read_exactly(&mut one, frame(1).len()), frame(1));
    assert_eq!(read_exactly(&mut two, frame(2).len()), frame(2));
    // A frame in two pieces is passed on whole, noise before it is not.
    let whole = frame(3);
    one.write_all(&[0x55, 0xFE]).unwrap();
    one.write_all(&whole[..5]).unwrap();
    std::thread::sleep(Duration::from_millis(20));
    one.write_all(&whole[5..]).unwrap();
    assert_eq!(packet(&inbox).bytes, whole);
    // A connection that ends is told.
    drop(one);
    assert!(matches!(next(&inbox), Arrival::Closed(peer) if peer == first));
    two.write_all(&frame(4)).unwrap();
    assert_eq!(packet(&inbox).peer, second);
}

#[test]
fn a_tcp_client_connects_again_when_the_server_comes_back() {
    let network = Network::start().unwrap();
    let (to, inbox) = bounded(64);
    // A port that was free a moment ago, with nobody listening yet.
    let at = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let link =
        network.open(LinkId(0), &Address::TcpOut(local(at.port())), "--vehicle", to).unwrap();
    std::thread::sleep(Duration::from_millis(300));
    for round in 0..2 {
        let server = TcpListener::bind(at).unwrap();
        let (mut stream, _) = server.accept().unwrap();
        let peer = opened(&inbox);
        assert_eq!(peer.address, at);
        stream.write_all(&frame(round)).unwrap();
        assert_eq!(packet(&inbox).bytes, frame(round));
        link.send(peer, frame(9));
        assert_eq!(read_exactly(&mut stream, frame(9).len()), frame(9));
        drop((stream, server));
        assert!(matches!(next(&inbox), Arrival::Closed(p) if p == peer));
    }
}

#[test]
fn a_tcp_peer_that_does_not_read_loses_frames_and_holds_up_nobody() {
    let network = Network::start().unwrap();
    let (to, inbox) = bounded(64);
    let link = network.open(LinkId(0), &Address::TcpIn(local(0)), "--client", to).unwrap();
    let _deaf = TcpStream::connect(link.local().unwrap()).unwrap();
    let deaf = opened(&inbox);
    let mut good = TcpStream::connect(link.local().unwrap()).unwrap();
    let keen = opened(&inbox);
    let big =
        framing::write(Version::V2, 0, Source { system: 1, component: 1 }, 110, &[7; 254]).unwrap();
    // Loopback sockets hold some megabytes; 40 MB are more than they and the queue take.
    let start = Instant::now();
    let mut asked = Duration::ZERO;
    for round in 0..150_000u32 {
        let before = Instant::now();
        link.send(deaf, big.clone());
        asked += before.elapsed();
        if round % 500 == 0 {
            std::thread::sleep(Duration::from_millis(1));
        }
    }
    assert!(link.counts().outbox_full > 0, "{:?}", link.counts());
    assert!(asked < Duration::from_secs(2), "sending held up its caller for {asked:?}");
    std::thread::sleep(Duration::from_millis(50));
    link.send(keen, frame(5));
    assert_eq!(read_exactly(&mut good, frame(5).len()), frame(5));
    assert!(start.elapsed() < PATIENCE);
}
