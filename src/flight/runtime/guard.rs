//! The signatures of a flight's links: which of them are signed, with what key.

use std::path::PathBuf;

use super::FlightOptions;
use greylag_link::address::Address;
use greylag_link::peer::LinkId;
use greylag_link::signing::{Key, KeyError, Signer, SigningCounts, StampError, StampFile};

/// How links are signed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Signing {
    /// The file that holds the key; the timestamp is kept beside it.
    pub key: PathBuf,
    /// Whether the vehicle's link is signed.
    pub vehicle: VehicleLink,
    /// Those of the clients' links that are declared local: nothing is signed there.
    pub local: Vec<Address>,
}

/// What is demanded on the vehicle's link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VehicleLink {
    /// Signatures.
    Signed,
    /// Nothing.
    Open,
}

/// Why links cannot be signed.
#[derive(Debug, thiserror::Error)]
pub enum SigningError {
    /// The key cannot be used.
    #[error(transparent)]
    Key(#[from] KeyError),
    /// The timestamp cannot be kept.
    #[error(transparent)]
    Stamp(#[from] StampError),
}

/// The signer with the numbers of the links that it guards.
pub(super) struct Guard {
    signer: Signer,
    file: StampFile,
    links: Vec<LinkId>,
}

impl Guard {
    /// Reads key and timestamp. Link 0 is the vehicle's, the clients' follow.
    pub(super) fn open(signing: &Signing, options: &FlightOptions) -> Result<Self, SigningError> {
        let key = Key::load(&signing.key)?;
        let (file, stamp) = StampFile::open(&signing.key)?;
        let clients = options.clients.iter().enumerate();
        let guarded = clients.filter(|(_, address)| !signing.local.contains(address));
        let mut links: Vec<_> = guarded.map(|(i, _)| LinkId(1 + i as u16)).collect();
        if signing.vehicle == VehicleLink::Signed {
            links.push(LinkId(0));
        }
        Ok(Guard { signer: Signer::new(key, stamp), file, links })
    }

    /// What leaves on `link` in place of `bytes`.
    pub(super) fn sign(&mut self, unix_us: u64, link: LinkId, bytes: Vec<u8>) -> Vec<u8> {
        if !self.links.contains(&link) {
            return bytes;
        }
        let signed = self.signer.sign(unix_us, link.0 as u8, &bytes);
        self.file.show(self.signer.stamp());
        signed
    }

    /// What is to be believed of `bytes` that came on `link`.
    pub(super) fn believed(&mut self, unix_us: u64, link: LinkId, bytes: Vec<u8>) -> Vec<u8> {
        if !self.links.contains(&link) {
            return bytes;
        }
        let believed = self.signer.believed(unix_us, &bytes);
        self.file.show(self.signer.stamp());
        believed
    }

    pub(super) fn counts(&self) -> SigningCounts {
        self.signer.counts()
    }
}
