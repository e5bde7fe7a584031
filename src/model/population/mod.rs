//! A distribution of fixed-wing aircraft. Each drawn aircraft has an exact model, and a textbook model that is estimated
//! from its mass, dimensions and propulsion.

mod character;
mod draw;

use std::path::Path;

use serde::Deserialize;

use greylag_physics::airframe::{FileError, check_schema, toml_error};

pub use character::{Character, TRAITS, Trait};
pub use draw::{DrawError, Drawn, Layout};

/// Smallest and largest value of a quantity.
type Range = [f64; 2];

/// A distribution of aircraft, read from a file such as `params/any/aircraft.toml`. The comments there explain each number.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Population {
    schema: u32,
    size: Sizes,
    layout: Layouts,
    balance: Balance,
    shape: Shape,
    controls: Servos,
    propulsion: Propulsion,
    flyable: Flyable,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Sizes {
    mass_kg: Range,
    loading_ratio: Range,
    aspect_ratio: Range,
    aspect_ratio_tailless: Range,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Layouts {
    conventional: f64,
    v_tail: f64,
    without_rudder: f64,
    elevons: f64,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Balance {
    static_margin: Range,
    static_margin_tailless: Range,
    elevator_offset_rad: Range,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Shape {
    inertia_width: f64,
    width_most: f64,
    crooked: Range,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Servos {
    travel_deg: Range,
    servo_radps: Range,
    servo_damping: Range,
    delay_s: Range,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Propulsion {
    thrust_weight: Range,
    pitch_speed_ratio: Range,
    lag_s: Range,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Flyable {
    throttle_most: f64,
    climb_least: f64,
    elevator_most: f64,
    doubling_s: f64,
    fastest_radps: f64,
}

impl Population {
    /// Reads a distribution from a file (`schema = 1`).
    ///
    /// # Errors
    /// If the file cannot be read, is not TOML of this schema, or has invalid proportions of the layouts. Also if the ends of a
    /// range are not finite, not in order, or not positive where this is required.
    pub fn load(path: &Path) -> Result<Population, FileError> {
        let what = "distribution of aircraft";
        let text = greylag_physics::text_file::read(path).map_err(|why| FileError::Read {
            what,
            path: path.into(),
            why,
            example: "../any/aircraft.toml",
        })?;
        Population::parse(&text).map_err(|why| FileError::Content { what, path: path.into(), why })
    }

    /// Reads the text of a distribution, as [`load`](Self::load) does. The error describes the fault.
    pub fn parse(text: &str) -> Result<Population, String> {
        let read: Population = toml::from_str(text).map_err(|e| toml_error(text, &e))?;
        check_schema(read.schema, 1)?;
        for (name, [least, most]) in read.positive() {
            if !(0.0 < least && least <= most && most.is_finite()) {
                return Err(format!(
                    "{name} = [{least}, {most}] must be two numbers above zero, the larger one last"
                ));
            }
        }
        for (name, [least, most]) in read.signed() {
            if !(least <= most && (most - least).is_finite()) {
                return Err(format!(
                    "{name} = [{least}, {most}] must be two numbers, the larger one last"
                ));
            }
        }
        if read.shares().iter().any(|(_, share)| !(0.0..=1.0).contains(share))
            || read.whole() <= 0.0
        {
            return Err("layout: shares lie in 0..1, and one is above zero".into());
        }
        Ok(read)
    }

    fn shares(&self) -> [(Layout, f64); 4] {
        let Layouts { conventional, v_tail, without_rudder, elevons } = self.layout;
        [
            (Layout::Conventional, conventional),
            (Layout::VTail, v_tail),
            (Layout::WithoutRudder, without_rudder),
            (Layout::Elevons, elevons),
        ]
    }

    fn whole(&self) -> f64 {
        self.shares().iter().map(|(_, share)| share).sum()
    }

    fn positive(&self) -> [(&'static str, Range); 10] {
        let (size, controls, thrust) = (&self.size, &self.controls, &self.propulsion);
        [
            ("size.mass_kg", size.mass_kg),
            ("size.loading_ratio", size.loading_ratio),
            ("size.aspect_ratio", size.aspect_ratio),
            ("size.aspect_ratio_tailless", size.aspect_ratio_tailless),
            ("controls.travel_deg", controls.travel_deg),
            ("controls.servo_radps", controls.servo_radps),
            ("controls.servo_damping", controls.servo_damping),
            ("propulsion.thrust_weight", thrust.thrust_weight),
            ("propulsion.pitch_speed_ratio", thrust.pitch_speed_ratio),
            ("propulsion.lag_s", thrust.lag_s),
        ]
    }

    fn signed(&self) -> [(&'static str, Range); 5] {
        [
            ("balance.static_margin", self.balance.static_margin),
            ("balance.static_margin_tailless", self.balance.static_margin_tailless),
            ("balance.elevator_offset_rad", self.balance.elevator_offset_rad),
            ("shape.crooked", self.shape.crooked),
            ("controls.delay_s", self.controls.delay_s),
        ]
    }
}
