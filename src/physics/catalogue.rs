//! The whole catalogue: effects on the air together with those on the deflections.

use super::effects::{self, Description};
use super::inputs;

/// Every effect that a model may have.
pub fn all() -> impl Iterator<Item = Description> {
    let on_air = effects::Kind::ALL.iter().map(|kind| kind.describe());
    on_air.chain(inputs::Kind::ALL.iter().map(|kind| kind.describe()))
}

/// The effect of that id.
pub fn describe(id: &str) -> Option<Description> {
    all().find(|about| about.id == id)
}
