//! The complete catalogue of effects.
//!
//! An effect adds terms to forces, moments or the body (mass and inertia). An input effect changes the deflections between the
//! measured actuator position and the surface.

use super::effects::{self, Description};
use super::{formula, inputs};

/// All effects that a model may have: compiled effects, shipped effect files, then input effects.
pub fn all() -> impl Iterator<Item = Description> {
    on_air().chain(inputs::Kind::ALL.iter().map(|kind| kind.describe()))
}

/// The effects on forces, moments or the body: compiled effects, then those of the shipped effect files.
pub fn on_air() -> impl Iterator<Item = Description> {
    let compiled = effects::Kind::ALL.iter().map(|kind| kind.describe());
    // a user's file replaces a shipped file with the same id
    let of_files =
        formula::register::shipped().iter().filter_map(|effect| describe(effect.about.id));
    compiled.chain(of_files)
}

/// Description of the effect `id` of the catalogue, or of an effect file that was read. `None` if there is no such effect.
pub fn describe(id: &str) -> Option<Description> {
    let on_air = effects::Kind::from_id(id).map(|kind| kind.describe());
    on_air.or_else(|| inputs::Kind::from_id(id).map(|kind| kind.describe()))
}
