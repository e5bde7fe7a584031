//! The whole catalogue: effects on the air together with those on the deflections.

use super::effects::{self, Description};
use super::{formula, inputs};

/// Every effect of the catalogue that a model may have.
pub fn all() -> impl Iterator<Item = Description> {
    let on_air = effects::Kind::ALL.iter().map(|kind| kind.describe());
    on_air.chain(inputs::Kind::ALL.iter().map(|kind| kind.describe()))
}

/// The effect of that id: of the catalogue, or of a file that was read.
pub fn describe(id: &str) -> Option<Description> {
    let known = all().find(|about| about.id == id);
    known.or_else(|| formula::register::find(id).map(|effect| effect.about))
}
