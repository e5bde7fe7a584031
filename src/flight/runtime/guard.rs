//! Message signing of a flight's links.

use std::path::PathBuf;

use super::FlightOptions;
use greylag_link::address::Address;
use greylag_link::peer::LinkId;
use greylag_link::signing::{Key, KeyError, Signer, SigningCounts, StampError, StampFile};

/// Signing options of a flight.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Signing {
    /// Path of the key file. The signing timestamp is stored next to the key.
    pub key: PathBuf,
    /// Whether the vehicle's link is signed.
    pub vehicle: VehicleLink,
    /// Client links that are declared local. Their frames are neither signed nor checked.
    pub local: Vec<Address>,
}

/// Signing of the vehicle's link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VehicleLink {
    /// Frames are signed, and frames without a valid signature are refused.
    Signed,
    /// Frames are neither signed nor checked.
    Open,
}

/// Signing cannot be set up.
#[derive(Debug, thiserror::Error)]
pub enum SigningError {
    /// The key is unusable.
    #[error(transparent)]
    Key(#[from] KeyError),
    /// The timestamp cannot be stored.
    #[error(transparent)]
    Stamp(#[from] StampError),
}

/// The signer with the numbers of the signed links.
pub(super) struct Guard {
    signer: Signer,
    file: StampFile,
    links: Vec<LinkId>,
}

impl Guard {
    /// Reads key and timestamp. Link 0 is the vehicle's link. The clients' links are numbered from 1.
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

    /// Signs the frames in `bytes`, which are sent on `link` at `unix_us` (µs since 1970). Bytes of unsigned links stay
    /// unchanged.
    pub(super) fn sign(&mut self, unix_us: u64, link: LinkId, bytes: Vec<u8>) -> Vec<u8> {
        if !self.links.contains(&link) {
            return bytes;
        }
        let signed = self.signer.sign(unix_us, link.0 as u8, &bytes);
        self.file.show(self.signer.stamp());
        signed
    }

    /// The authenticated frames of `bytes`, which arrived on `link` at `unix_us` (µs since 1970). All bytes of unsigned
    /// links are returned.
    pub(super) fn believed(&mut self, unix_us: u64, link: LinkId, bytes: Vec<u8>) -> Vec<u8> {
        if !self.links.contains(&link) {
            return bytes;
        }
        let believed = self.signer.believed(unix_us, &bytes);
        self.file.show(self.signer.stamp());
        believed
    }

    /// An error of the timestamp file as text, returned once; `None` without a new error.
    pub(super) fn trouble(&self) -> Option<String> {
        self.file.trouble()
    }

    pub(super) fn counts(&self) -> SigningCounts {
        self.signer.counts()
    }
}
