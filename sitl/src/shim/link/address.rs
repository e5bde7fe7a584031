//! Parses link addresses such as `udpout:127.0.0.1:14600`.

use std::fmt;
use std::str::FromStr;

/// Transport protocol and the side that opens the connection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transport {
    /// UDP: listens on a port and answers the sender of the first frame from the companion.
    UdpIn,
    /// UDP: sends to a fixed address.
    UdpOut,
    /// TCP: listens for one connection.
    TcpIn,
    /// TCP: connects, and retries until it succeeds.
    TcpOut,
    /// Stream over a serial port, `DEVICE:BAUD`.
    Serial,
    /// Stream over a pseudo-terminal that the shim creates and that the companion opens under a given name.
    Pty,
}

impl Transport {
    const ALL: [(&'static str, Transport); 6] = [
        ("serial", Transport::Serial),
        ("pty", Transport::Pty),
        ("udpin", Transport::UdpIn),
        ("udpout", Transport::UdpOut),
        ("tcpin", Transport::TcpIn),
        ("tcpout", Transport::TcpOut),
    ];
}

/// A link address: a transport and its endpoint.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Address {
    /// Transport protocol and the side that opens it.
    pub transport: Transport,
    /// `host:port`, with a host name or a numeric address; `device:baud` for a serial port; the name for a pseudo-terminal.
    pub endpoint: String,
}

impl Address {
    /// Device and baud rate of a serial port; the baud rate is 0 if the endpoint has none.
    pub(super) fn device(&self) -> (String, u32) {
        let (device, baud) = self.endpoint.rsplit_once(':').unwrap_or((&self.endpoint, ""));
        (device.to_owned(), baud.parse().unwrap_or(0))
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let prefix = Transport::ALL.iter().find(|(_, transport)| *transport == self.transport);
        write!(f, "{}:{}", prefix.map_or("", |(prefix, _)| prefix), self.endpoint)
    }
}

/// Error of parsing a link address.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "cannot read the link address '{given}': {fault}; write it like udpout:127.0.0.1:14600 (udpin, udpout, tcpin or tcpout, then host:port), serial:/dev/ttyUSB0:921600, or pty:NAME"
)]
pub struct AddressError {
    given: String,
    fault: &'static str,
}

impl FromStr for Address {
    type Err = AddressError;

    fn from_str(given: &str) -> Result<Self, AddressError> {
        let fail = |fault| AddressError { given: given.to_owned(), fault };
        let (prefix, endpoint) = given.split_once(':').ok_or(fail("it has no transport"))?;
        let transport = Transport::ALL
            .iter()
            .find(|(name, _)| *name == prefix)
            .map(|(_, transport)| *transport)
            .ok_or(fail("the transport is not known"))?;
        if transport == Transport::Pty {
            return match endpoint {
                "" => Err(fail("the pseudo-terminal has no name")),
                name => Ok(Address { transport, endpoint: name.to_owned() }),
            };
        }
        let (host, port) = endpoint.rsplit_once(':').ok_or(fail("it has no port"))?;
        if host.is_empty() {
            return Err(fail("it has no host"));
        }
        if transport == Transport::Serial {
            let baud: u32 = port.parse().map_err(|_| fail("the baud rate is not a number"))?;
            if baud == 0 {
                return Err(fail("the baud rate must be positive"));
            }
            return Ok(Address { transport, endpoint: endpoint.to_owned() });
        }
        let port: u16 = port.parse().map_err(|_| fail("the port is not a number 0..65535"))?;
        if port == 0 && matches!(transport, Transport::UdpOut | Transport::TcpOut) {
            return Err(fail("port 0 cannot be sent to"));
        }
        Ok(Address { transport, endpoint: endpoint.to_owned() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_what_it_writes() {
        for text in [
            "udpin:0.0.0.0:14600",
            "udpout:localhost:1",
            "tcpin:[::1]:5760",
            "tcpout:h:9",
            "serial:/dev/ttyUSB0:921600",
            "pty:near/end",
        ] {
            assert_eq!(text.parse::<Address>().map(|a| a.to_string()).as_deref(), Ok(text));
        }
    }

    #[test]
    fn refuses_in_one_line_that_names_the_address() {
        for text in [
            "",
            "udp:1.2.3.4:5",
            "udpin:14600",
            "udpin::5",
            "tcpin:h:65536",
            "udpout:h:0",
            "serial:/dev/ttyUSB0",
            "serial:/dev/ttyUSB0:fast",
            "serial:/dev/ttyUSB0:0",
            "pty:",
        ] {
            let error = text.parse::<Address>().expect_err(text).to_string();
            assert!(error.contains(&format!("'{text}'")) && !error.contains('\n'), "{error}");
        }
    }
}
