//! Parsers of options whose value is one of several names. `--help` shows these names.

use clap::builder::{PossibleValuesParser, TypedValueParser};

use crate::control::ControllerKind;

/// Parser of an option whose value is the name of a controller.
pub fn controller() -> impl TypedValueParser<Value = ControllerKind> {
    PossibleValuesParser::new(ControllerKind::ALL.iter().map(|kind| kind.name()))
        .try_map(|name| name.parse::<ControllerKind>())
}

/// Parser of an option whose value is the name of a group of target attitudes.
#[cfg(feature = "demo")]
pub fn group() -> impl TypedValueParser<Value = crate::sim::Group> {
    use crate::sim::Group;
    PossibleValuesParser::new(Group::ALL.map(Group::name)).try_map(|name| {
        Group::ALL.into_iter().find(|g| g.name() == name).ok_or("there is no such group")
    })
}
