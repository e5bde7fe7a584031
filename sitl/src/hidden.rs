//! Effects hidden in the aircraft: terms that JSBSim flies and that no one is told of.

/// One hidden effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hidden {
    /// Id of the effect in the catalogue.
    pub effect: &'static str,
    /// Its amplitude.
    pub amplitude: f64,
}

/// Why an effect cannot be hidden.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum HiddenError {}

/// The aircraft document `xml` with `effects` written into it.
pub(crate) fn write_into(xml: &str, _effects: &[Hidden]) -> Result<String, HiddenError> {
    Ok(xml.to_owned())
}

/// Property with the thrust that hidden effects add, lbf.
pub(crate) const THRUST_PROPERTY: &str = "greylag/hidden-thrust-lbs";
