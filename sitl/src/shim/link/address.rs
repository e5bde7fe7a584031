//! Link addresses as people write them: `udpout:127.0.0.1:14600`.

use std::fmt;
use std::str::FromStr;

/// Which protocol, with which side beginning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transport {
    /// Datagrams; listens, answers whom it hears.
    UdpIn,
    /// Datagrams; sends to a fixed address.
    UdpOut,
    /// Stream; listens.
    TcpIn,
    /// Stream; connects, again and again until it succeeds.
    TcpOut,
}

impl Transport {
    const ALL: [(&'static str, Transport); 4] = [
        ("udpin", Transport::UdpIn),
        ("udpout", Transport::UdpOut),
        ("tcpin", Transport::TcpIn),
        ("tcpout", Transport::TcpOut),
    ];
}

/// A link address: transport, host, port.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Address {
    /// Protocol and side.
    pub transport: Transport,
    /// `host:port`, the host a name or a number.
    pub endpoint: String,
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let prefix = Transport::ALL.iter().find(|(_, transport)| *transport == self.transport);
        write!(f, "{}:{}", prefix.map_or("", |(prefix, _)| prefix), self.endpoint)
    }
}

/// An address that cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "cannot read the link address '{given}': {fault}; write it like udpout:127.0.0.1:14600 (udpin, udpout, tcpin or tcpout, then host:port)"
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
        let (host, port) = endpoint.rsplit_once(':').ok_or(fail("it has no port"))?;
        if host.is_empty() {
            return Err(fail("it has no host"));
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
        for text in ["udpin:0.0.0.0:14600", "udpout:localhost:1", "tcpin:[::1]:5760", "tcpout:h:9"]
        {
            assert_eq!(text.parse::<Address>().map(|a| a.to_string()).as_deref(), Ok(text));
        }
    }

    #[test]
    fn refuses_in_one_line_that_names_the_address() {
        for text in ["", "udp:1.2.3.4:5", "udpin:14600", "udpin::5", "tcpin:h:65536", "udpout:h:0"]
        {
            let error = text.parse::<Address>().expect_err(text).to_string();
            assert!(error.contains(&format!("'{text}'")) && !error.contains('\n'), "{error}");
        }
    }
}
