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

/// Reason why signing cannot be set up.
#[derive(Debug, thiserror::Error)]
pub enum SigningError {
    /// The key is unusable.
    #[error(transparent)]
    Key(#[from] KeyError),
    /// The timestamp cannot be stored.
    #[error(transparent)]
    Stamp(#[from] StampError),
}

/// Signs and checks the frames of the links whose ids are in `links`.
pub(super) struct Guard {
    signer: Signer,
    file: StampFile,
    links: Vec<LinkId>,
}

impl Guard {
    /// Reads the key and the timestamp. The vehicle's link has id 0. The links to clients (ground stations and offboard programs)
    /// have ids from 1, in the order of `options`.
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

    /// Signs the frames in `bytes`, which are to be sent on `link` at `unix_us` (µs since 1970). If the link is not signed,
    /// `bytes` is returned unchanged.
    pub(super) fn sign(&mut self, unix_us: u64, link: LinkId, bytes: Vec<u8>) -> Vec<u8> {
        if !self.links.contains(&link) {
            return bytes;
        }
        let signed = self.signer.sign(unix_us, link.0 as u8, &bytes);
        self.file.show(self.signer.stamp());
        signed
    }

    /// Returns those frames of `bytes` that have a valid signature. `bytes` arrived on `link` at `unix_us` (µs since 1970). If
    /// the link is not signed, `bytes` is returned unchanged.
    pub(super) fn believed(&mut self, unix_us: u64, link: LinkId, bytes: Vec<u8>) -> Vec<u8> {
        if !self.links.contains(&link) {
            return bytes;
        }
        let believed = self.signer.believed(unix_us, &bytes);
        self.file.show(self.signer.stamp());
        believed
    }

    /// A new error of the timestamp file as text. Each error is returned once; `None` if there is none.
    pub(super) fn trouble(&self) -> Option<String> {
        self.file.trouble()
    }

    pub(super) fn counts(&self) -> SigningCounts {
        self.signer.counts()
    }
}
