//! The complete catalogue: effects on the air and input effects.

use super::effects::{self, Description};
use super::{formula, inputs};

/// All effects that a model may have: compiled ones, then those of the shipped effect files.
pub fn all() -> impl Iterator<Item = Description> {
    on_air().chain(inputs::Kind::ALL.iter().map(|kind| kind.describe()))
}

/// The effects on forces and moments or on the body.
pub fn on_air() -> impl Iterator<Item = Description> {
    let compiled = effects::Kind::ALL.iter().map(|kind| kind.describe());
    // a user's own file of the same id takes the shipped one's place
    let of_files =
        formula::register::shipped().iter().filter_map(|effect| describe(effect.about.id));
    compiled.chain(of_files)
}

/// Description of the effect `id`, of the catalogue or of an effect file that was read.
pub fn describe(id: &str) -> Option<Description> {
    let on_air = effects::Kind::from_id(id).map(|kind| kind.describe());
    on_air.or_else(|| inputs::Kind::from_id(id).map(|kind| kind.describe()))
}
