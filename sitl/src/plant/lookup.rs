//! Looks up properties of a loaded aircraft by name.

use jsbsim::{Fdm, NodeId};

use super::PlantError;

/// A property of a loaded aircraft; `None` if the aircraft lacks it.
pub(super) fn look(fdm: &Fdm, name: &str) -> Option<NodeId> {
    fdm.node(name).ok().flatten()
}

/// A property of a loaded aircraft; the error names the aircraft and the missing property.
pub(super) fn needed(fdm: &Fdm, aircraft: &str, name: &str) -> Result<NodeId, PlantError> {
    look(fdm, name).ok_or_else(|| PlantError::Property {
        aircraft: aircraft.to_owned(),
        property: name.to_owned(),
    })
}
