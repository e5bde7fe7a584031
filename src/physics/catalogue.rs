//! The whole catalogue: effects on the air together with those on the deflections.

use super::effects::{self, Description};
use super::{formula, inputs};

/// Every effect of the catalogue that a model may have: compiled ones, then those of its files.
pub fn all() -> impl Iterator<Item = Description> {
    on_air().chain(inputs::Kind::ALL.iter().map(|kind| kind.describe()))
}

/// Those of them that make forces and moments or change the body.
pub fn on_air() -> impl Iterator<Item = Description> {
    let compiled = effects::Kind::ALL.iter().map(|kind| kind.describe());
    // a user's own file of the same id takes the shipped one's place
    let of_files =
        formula::register::shipped().iter().filter_map(|effect| describe(effect.about.id));
    compiled.chain(of_files)
}

/// The effect of that id: of the catalogue, or of a file that was read.
pub fn describe(id: &str) -> Option<Description> {
    let on_air = effects::Kind::from_id(id).map(|kind| kind.describe());
    on_air.or_else(|| inputs::Kind::from_id(id).map(|kind| kind.describe()))
}
