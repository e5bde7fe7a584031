//! Hidden effects: terms of the flight dynamics that JSBSim simulates and that no message to the companion reports.
//!
//! An effect is written into the aircraft's XML before JSBSim loads it, as further aerodynamic functions, flight-control
//! components, external forces, or changed mass properties. Without an effect, or at amplitude 0, the XML stays identical byte
//! for byte.

mod document;
mod effects;
mod expression;

use std::fmt;
use std::str::FromStr;

use crate::plant::Properties;
pub(crate) use document::THRUST_PROPERTY;
use document::{Axis, Document};
pub use effects::EFFECTS;

/// A type of hidden effect, as the catalogue of effects lists it.
pub struct Effect {
    /// Identifier in the catalogue of effects, stable between versions.
    pub id: &'static str,
    /// Contribution at amplitude a, as text. Q = ½ρV²S, δ are deflections in rad, and δt is the throttle position, 0 to 1.
    pub formula: &'static str,
    /// Unit of the amplitude; empty for a dimensionless one.
    pub unit: &'static str,
    /// Smallest and largest amplitude allowed, in the unit `unit`.
    pub bounds: (f64, f64),
    write: fn(&mut Document, f64) -> Result<(), HiddenError>,
}

impl Place {
    /// The aerodynamic axis; `None` for the thrust.
    fn axis(self) -> Option<Axis> {
        Some(match self {
            Place::Drag => Axis::Drag,
            Place::Side => Axis::Side,
            Place::Lift => Axis::Lift,
            Place::Roll => Axis::Roll,
            Place::Pitch => Axis::Pitch,
            Place::Yaw => Axis::Yaw,
            Place::Thrust => return None,
        })
    }
}

impl fmt::Debug for Effect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Effect({})", self.id)
    }
}

/// One hidden effect, written `id=amplitude`.
#[derive(Clone, Copy)]
pub struct Hidden {
    effect: &'static Effect,
    amplitude: f64,
    /// Functions that the effect adds if it is not from the catalogue; otherwise empty.
    functions: &'static [(Place, String)],
    /// Filters whose outputs `functions` reads.
    filters: &'static [Filter],
}

/// A filter in the flight controls whose output the functions of a hidden effect can read.
#[derive(Clone, Debug, PartialEq)]
pub struct Filter {
    /// Input of the filter, an expression of JSBSim's functions.
    pub input: String,
    /// Kind of the filter: lag or delay.
    pub kind: FilterKind,
    /// Time constant or delay of the filter, s.
    pub time_s: f64,
}

/// Kinds of filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FilterKind {
    /// A first-order lag, discretised at the step by the bilinear transform.
    Lag,
    /// A pure delay of a whole number of steps.
    Delay,
}

impl Filter {
    /// Placeholder that stands in an expression for the output of the effect's filter with the index `place`, from 0.
    pub fn placeholder(place: usize) -> String {
        format!("{{filter-{place}}}")
    }
}

/// Aerodynamic axis or propulsion on which an added function acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Drag along the wind axis, lbf, rearward positive.
    Drag,
    /// Side force along the wind axis, lbf, right positive.
    Side,
    /// Lift along the wind axis, lbf, up positive.
    Lift,
    /// Thrust of the propulsion, lbf, forward positive.
    Thrust,
    /// Rolling moment, lbf ft, right wing down positive.
    Roll,
    /// Pitching moment, lbf ft, nose up positive.
    Pitch,
    /// Yawing moment, lbf ft, nose right positive.
    Yaw,
}

impl Hidden {
    /// The effect `id` of the catalogue with `amplitude`, in the effect's unit; an amplitude of 0 changes nothing.
    ///
    /// # Errors
    /// [`HiddenError::Unknown`] if the catalogue has no effect `id`, and [`HiddenError::Amplitude`] if `amplitude` is out of
    /// bounds.
    pub fn new(id: &str, amplitude: f64) -> Result<Self, HiddenError> {
        let effect = EFFECTS
            .iter()
            .find(|effect| effect.id == id)
            .ok_or_else(|| HiddenError::Unknown { id: id.to_owned(), known: known() })?;
        let (min, max) = effect.bounds;
        if !(min..=max).contains(&amplitude) {
            let Effect { id, unit, .. } = *effect;
            return Err(HiddenError::Amplitude { id, amplitude, min, max, unit });
        }
        Ok(Hidden { effect, amplitude, functions: &[], filters: &[] })
    }

    /// An effect `id` outside the catalogue, given as expressions of JSBSim's functions, each with the axis on which it acts. In
    /// an expression, `{aileron}`, `{elevator}`, `{rudder}` (rad) and `{throttle}` stand for the position properties.
    /// [`Filter::placeholder`] stands for the output of one of `filters`. The effect stays in memory until the process ends.
    pub fn written(id: &str, functions: Vec<(Place, String)>, filters: Vec<Filter>) -> Self {
        let effect = Effect {
            id: id.to_owned().leak(),
            formula: "",
            unit: "",
            bounds: (0.0, 1.0),
            write: |_, _| Ok(()),
        };
        Hidden {
            effect: Box::leak(Box::new(effect)),
            amplitude: 1.0,
            functions: functions.leak(),
            filters: filters.leak(),
        }
    }

    fn write(&self, document: &mut Document) -> Result<(), HiddenError> {
        let output = |k: usize| format!("hidden/{}-filter-{k}", self.effect.id);
        for (k, Filter { input, kind, time_s }) in self.filters.iter().enumerate() {
            let input = document.with_positions(input);
            document.filter(&output(k), &input, *kind, *time_s)?;
        }
        for (k, (place, expression)) in self.functions.iter().enumerate() {
            let mut expression = document.with_positions(expression);
            for k in 0..self.filters.len() {
                expression = expression.replace(&Filter::placeholder(k), &output(k));
            }
            let name = format!("{}-{k}", self.effect.id);
            match place.axis() {
                Some(axis) => document.function(axis, &name, &expression)?,
                None => document.add_thrust(expression),
            }
        }
        (self.effect.write)(document, self.amplitude)
    }

    /// The type of the effect.
    pub fn effect(&self) -> &'static Effect {
        self.effect
    }

    /// The amplitude, in the effect's unit.
    pub fn amplitude(&self) -> f64 {
        self.amplitude
    }
}

impl PartialEq for Hidden {
    fn eq(&self, other: &Self) -> bool {
        self.effect.id == other.effect.id
            && self.amplitude == other.amplitude
            && self.functions == other.functions
    }
}

impl fmt::Display for Hidden {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.effect.id, self.amplitude)
    }
}

impl fmt::Debug for Hidden {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Hidden({self})")
    }
}

impl FromStr for Hidden {
    type Err = HiddenError;

    /// Reads `id=amplitude`, such as `pitch_break=-3.0`.
    fn from_str(text: &str) -> Result<Self, HiddenError> {
        let syntax = || HiddenError::Syntax { text: text.to_owned(), known: known() };
        let (id, amplitude) = text.split_once('=').ok_or_else(syntax)?;
        Hidden::new(id.trim(), amplitude.trim().parse().map_err(|_| syntax())?)
    }
}

/// Why an effect cannot be hidden.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum HiddenError {
    /// The text is not an id and a number.
    #[error(
        "hidden effect '{text}': write ID=AMPLITUDE, such as pitch_break=-3.0; known ids: {known}"
    )]
    Syntax {
        /// The text as given.
        text: String,
        /// Identifiers of all known effects.
        known: String,
    },
    /// No effect has that id.
    #[error("hidden effect '{id}' is not known; known ids: {known}")]
    Unknown {
        /// The identifier as given.
        id: String,
        /// Identifiers of all known effects.
        known: String,
    },
    /// The amplitude is outside the bounds of the effect.
    #[error(
        "hidden effect {id}: amplitude {amplitude} {unit} is outside {min} to {max} {unit}; give one within"
    )]
    Amplitude {
        /// Identifier of the effect.
        id: &'static str,
        /// The amplitude as given.
        amplitude: f64,
        /// Smallest amplitude that is allowed.
        min: f64,
        /// Largest amplitude that is allowed.
        max: f64,
        /// Unit of `amplitude`, `min` and `max`; empty for a dimensionless amplitude.
        unit: &'static str,
    },
    /// The delay is not a whole number of steps.
    #[error(
        "hidden effect time_delay: {amplitude} s is not a whole number of steps of {step_s} s; give a multiple"
    )]
    Delay {
        /// The delay as given, s.
        amplitude: f64,
        /// Length of a step, s.
        step_s: f64,
    },
    /// An effect is given twice.
    #[error("hidden effect {id} is given twice; give it once, with the sum")]
    Twice {
        /// Identifier of the effect that is given twice.
        id: &'static str,
    },
    /// The aircraft's XML has no place for the effect.
    #[error(
        "a hidden effect needs {place} in the aircraft's XML, which has none; hide another effect or fly another aircraft"
    )]
    Place {
        /// Element of the XML that is missing.
        place: String,
    },
}

fn known() -> String {
    EFFECTS.iter().map(|effect| effect.id).collect::<Vec<_>>().join(", ")
}

/// The aircraft document `xml` with `effects` written into it, for a simulation in steps of `step_s`, s.
pub(crate) fn write_into(
    xml: &str,
    properties: &Properties,
    effects: &[Hidden],
    step_s: f64,
) -> Result<String, HiddenError> {
    for (i, Hidden { effect, .. }) in effects.iter().enumerate() {
        if effects[..i].iter().any(|earlier| earlier.effect.id == effect.id) {
            return Err(HiddenError::Twice { id: effect.id });
        }
    }
    let acting: Vec<_> = effects.iter().filter(|hidden| hidden.amplitude != 0.0).collect();
    if acting.is_empty() {
        return Ok(xml.to_owned());
    }
    let mut document = Document::new(xml, properties, step_s);
    for hidden in acting {
        hidden.write(&mut document)?;
    }
    document.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_hidden_leaves_the_aircraft_as_it_is_to_the_byte() {
        let plain = crate::aircraft::read(None, crate::aircraft::BUILT_IN_NAME).unwrap();
        let written =
            |effects: &[Hidden]| write_into(&plain, &Properties::default(), effects, 0.01).unwrap();
        assert_eq!(written(&[]), plain);
        let zeros: Vec<Hidden> = EFFECTS.iter().map(|e| Hidden::new(e.id, 0.0).unwrap()).collect();
        assert_eq!(written(&zeros), plain);
        let one = Hidden::new("pitch_break", 1.0).unwrap();
        assert_ne!(written(&[one]), plain);
    }

    #[test]
    fn ids_are_unique_and_zero_is_always_within_bounds() {
        for (i, effect) in EFFECTS.iter().enumerate() {
            assert!(EFFECTS[..i].iter().all(|earlier| earlier.id != effect.id), "{}", effect.id);
            assert!(effect.bounds.0 <= 0.0 && effect.bounds.1 > 0.0, "{}", effect.id);
        }
    }
}
