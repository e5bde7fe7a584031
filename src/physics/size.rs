//! How the physical bounds of coefficients grow with an aircraft.

use super::airframe::Geometry;
use super::effects::Coefficient;
use super::rigid_body::RigidBody;

/// Mass (kg) and span (m) up to which bounds hold as the catalogue has them.
const WRITTEN_FOR: [f64; 2] = [25.0, 5.0];

/// How many times heavier and wider an aircraft is than one of 25 kg and 5 m; at least 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Size {
    mass: f64,
    length: f64,
}

impl Size {
    /// That of an aircraft of `body` and `geometry`.
    pub fn new(body: &RigidBody, geometry: &Geometry) -> Size {
        let [mass, span] = WRITTEN_FOR;
        Size { mass: (body.mass / mass).max(1.0), length: (geometry.span / span).max(1.0) }
    }

    /// The physically possible values of `coefficient`: those of the catalogue, which are without unit or per angle,
    /// or grow with forces, lengths, moments, angular momenta and inertias. Those of an effect file stay as written.
    pub fn bounds(&self, coefficient: &Coefficient) -> (f64, f64) {
        if !coefficient.grows {
            return coefficient.bounds;
        }
        let factor = self.factor(coefficient.unit).unwrap_or(1.0);
        let (least, most) = coefficient.bounds;
        (factor * least, factor * most)
    }

    fn factor(&self, unit: &str) -> Option<f64> {
        match unit {
            "N" => Some(self.mass),
            "m" => Some(self.length),
            "N m" => Some(self.mass * self.length),
            "N m s" | "kg m²" => Some(self.mass * self.length * self.length),
            _ => None,
        }
    }

    /// Whether bounds in `unit` grow with an aircraft.
    pub fn scales(unit: &str) -> bool {
        Size { mass: 1.0, length: 1.0 }.factor(unit).is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::coefficient;

    #[test]
    fn bounds_grow_with_the_aircraft_and_never_shrink() {
        let body = |mass| RigidBody { mass, jx: 1.0, jy: 1.0, jz: 1.0, jxz: 0.0 };
        let geometry = |span| Geometry { area: 1.0, span, chord: 1.0 };
        let torque = coefficient("k_nm", "", "N m", (-50.0, 50.0));
        let small = Size::new(&body(3.4), &geometry(2.1));
        assert_eq!(small.bounds(&torque), (-50.0, 50.0));
        // ten times heavier, twice as wide
        let large = Size::new(&body(250.0), &geometry(10.0));
        assert_eq!(large.bounds(&torque), (-1000.0, 1000.0));
        assert_eq!(large.bounds(&coefficient("k", "", "", (-1.0, 1.0))), (-1.0, 1.0));
        let written = Coefficient { grows: false, ..torque };
        assert_eq!(large.bounds(&written), (-50.0, 50.0));
    }
}
