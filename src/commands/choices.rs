//! Options whose values are the names of a list. `--help` shows these names.

use clap::builder::{PossibleValuesParser, TypedValueParser};

use crate::control::ControllerKind;

/// Option values: the names of the controllers.
pub fn controller() -> impl TypedValueParser<Value = ControllerKind> {
    PossibleValuesParser::new(ControllerKind::ALL.iter().map(|kind| kind.name()))
        .try_map(|name| name.parse::<ControllerKind>())
}

/// Option values: the names of the groups of targets.
#[cfg(feature = "demo")]
pub fn group() -> impl TypedValueParser<Value = crate::sim::Group> {
    use crate::sim::Group;
    PossibleValuesParser::new(Group::ALL.map(Group::name)).try_map(|name| {
        Group::ALL.into_iter().find(|g| g.name() == name).ok_or("there is no such group")
    })
}
