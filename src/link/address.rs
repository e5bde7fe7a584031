//! Addresses of MAVLink links on the command line, such as `udpin:0.0.0.0:14550`.

use std::fmt;
use std::net::{SocketAddr, ToSocketAddrs};
use std::str::FromStr;

use thiserror::Error;

/// A host name or IP address with a port. The name is not resolved yet.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct HostPort {
    /// Host name, IPv4 address, or IPv6 address without its brackets.
    pub host: String,
    /// Port number, 1..65535. With 0, which tests use, the system chooses a free port.
    pub port: u16,
}

/// The address of a MAVLink link.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Address {
    /// Listens for datagrams on this address and replies to each sender.
    UdpIn(HostPort),
    /// Sends the first datagram to this address, then replies to the sender of each received datagram.
    UdpOut(HostPort),
    /// Listens for connections on this address.
    TcpIn(HostPort),
    /// Connects to this address, and reconnects when the connection is lost.
    TcpOut(HostPort),
    /// A serial port with its baud rate.
    Serial {
        /// Device, such as `/dev/ttyACM0`.
        port: String,
        /// Baud rate, such as 921600.
        baud: u32,
    },
}

/// Reason for which an address cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum AddressError {
    /// The word before the first colon is not a kind of link.
    #[error(
        "address `{0}`: unknown kind of link; write udpin:HOST:PORT, udpout:HOST:PORT, \
         tcpin:HOST:PORT, tcpout:HOST:PORT or serial:DEVICE:BAUD"
    )]
    Kind(String),
    /// The host or the port is missing.
    #[error("address `{0}`: expected HOST:PORT after the kind, as in udpin:127.0.0.1:14550")]
    Parts(String),
    /// The port is not a number from 0 to 65535.
    #[error("address `{0}`: `{1}` is not a port number (0 to 65535)")]
    Port(String, String),
    /// The baud rate is missing or not a positive integer.
    #[error(
        "address `{0}`: `{1}` is not a baud rate; write for example serial:/dev/ttyACM0:921600"
    )]
    Baud(String, String),
    /// The host name cannot be resolved.
    #[error("looking up host `{host}`: {reason}; give a number such as 127.0.0.1")]
    Lookup {
        /// Host name as written.
        host: String,
        /// The operating system's error text.
        reason: String,
    },
}

impl HostPort {
    fn parse(whole: &str, rest: &str) -> Result<Self, AddressError> {
        let (host, port) =
            rest.rsplit_once(':').ok_or_else(|| AddressError::Parts(whole.into()))?;
        let host = host.strip_prefix('[').and_then(|h| h.strip_suffix(']')).unwrap_or(host);
        if host.is_empty() || host.contains(['[', ']', ' ']) {
            return Err(AddressError::Parts(whole.into()));
        }
        let port = port.parse().map_err(|_| AddressError::Port(whole.into(), port.into()))?;
        Ok(HostPort { host: host.into(), port })
    }

    /// The first address to which the host name resolves.
    ///
    /// # Errors
    /// If the host name cannot be resolved.
    pub fn resolve(&self) -> Result<SocketAddr, AddressError> {
        let failed = |reason: String| AddressError::Lookup { host: self.host.clone(), reason };
        (self.host.as_str(), self.port)
            .to_socket_addrs()
            .map_err(|e| failed(e.to_string()))?
            .next()
            .ok_or_else(|| failed("it has no address".into()))
    }
}

impl Address {
    /// Whether the link is reachable only from this machine: its address is a loopback address or a serial port. A name that
    /// cannot be resolved counts as reachable from other machines.
    pub fn stays_here(&self) -> bool {
        match self {
            Address::UdpIn(at) | Address::UdpOut(at) | Address::TcpIn(at) | Address::TcpOut(at) => {
                at.resolve().is_ok_and(|address| address.ip().is_loopback())
            }
            Address::Serial { .. } => true,
        }
    }
}

impl FromStr for Address {
    type Err = AddressError;

    fn from_str(text: &str) -> Result<Self, AddressError> {
        let (kind, rest) = text.split_once(':').ok_or_else(|| AddressError::Kind(text.into()))?;
        match kind {
            "udpin" => HostPort::parse(text, rest).map(Address::UdpIn),
            "udpout" => HostPort::parse(text, rest).map(Address::UdpOut),
            "tcpin" => HostPort::parse(text, rest).map(Address::TcpIn),
            "tcpout" => HostPort::parse(text, rest).map(Address::TcpOut),
            "serial" => parse_serial(text, rest),
            _ => Err(AddressError::Kind(text.into())),
        }
    }
}

fn parse_serial(whole: &str, rest: &str) -> Result<Address, AddressError> {
    let (port, rate) = rest.rsplit_once(':').unwrap_or((rest, ""));
    let baud = rate.parse().unwrap_or(0);
    match (port, baud) {
        (_, 0) => Err(AddressError::Baud(whole.into(), rate.into())),
        ("", _) => Err(AddressError::Parts(whole.into())),
        _ => Ok(Address::Serial { port: port.into(), baud }),
    }
}

impl fmt::Display for HostPort {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.host.contains(':') {
            true => write!(f, "[{}]:{}", self.host, self.port),
            false => write!(f, "{}:{}", self.host, self.port),
        }
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Address::UdpIn(at) => write!(f, "udpin:{at}"),
            Address::UdpOut(to) => write!(f, "udpout:{to}"),
            Address::TcpIn(at) => write!(f, "tcpin:{at}"),
            Address::TcpOut(to) => write!(f, "tcpout:{to}"),
            Address::Serial { port, baud } => write!(f, "serial:{port}:{baud}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_survives_a_round_trip() {
        for text in [
            "udpin:0.0.0.0:14550",
            "udpout:127.0.0.1:14540",
            "tcpin:[::1]:5760",
            "tcpout:autopilot.local:5760",
            "serial:/dev/ttyACM0:921600",
        ] {
            assert_eq!(text.parse::<Address>().unwrap().to_string(), text);
        }
    }

    #[test]
    fn mistakes_are_named() {
        let complaint = |text: &str| text.parse::<Address>().unwrap_err().to_string();
        assert!(complaint("udp:127.0.0.1:14550").contains("unknown kind"));
        assert!(complaint("14550").contains("unknown kind"));
        assert!(complaint("udpin:14550").contains("HOST:PORT"));
        assert!(complaint("udpin::14550").contains("HOST:PORT"));
        // the largest port number plus one
        assert!(complaint("udpin:127.0.0.1:65536").contains("`65536` is not a port"));
        assert!(complaint("serial:/dev/ttyACM0").contains("baud"));
        assert!(complaint("serial:/dev/ttyACM0:fast").contains("`fast`"));
        assert!(complaint("serial::57600").contains("HOST:PORT"));
    }

    #[test]
    fn loopback_and_wires_stay_here_and_everything_else_does_not() {
        let stays = |text: &str| text.parse::<Address>().unwrap().stays_here();
        for here in [
            "udpin:127.0.0.1:14550",
            "udpout:localhost:1",
            "tcpin:[::1]:5",
            "serial:/dev/ttyACM0:57600",
        ] {
            assert!(stays(here), "{here}");
        }
        for out in [
            "udpin:0.0.0.0:14550",
            "udpin:[::]:1",
            "udpout:192.0.2.7:14550",
            "tcpin:10.0.0.1:5",
            "tcpout:no.such.host.invalid:5",
        ] {
            assert!(!stays(out), "{out}");
        }
    }
}
