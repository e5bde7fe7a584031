//! Size of an aircraft relative to a reference size. The catalogue of effects states bounds of coefficients for aircraft up to
//! the reference size.

use super::airframe::Geometry;
use super::effects::Coefficient;
use super::rigid_body::RigidBody;

/// Mass (kg) and span (m) up to which the catalogue's bounds apply unchanged.
const WRITTEN_FOR: [f64; 2] = [25.0, 5.0];

/// Name of the coefficient whose bounds grow with the lift coefficient of slow flight, not with the size.
const LIFT: &str = "CL0";
/// Load factor of a gentle pull-up in slow flight. The bounds of `CL0` allow for it.
const PULL: f64 = 1.5;
/// Density of the standard atmosphere at sea level, kg/m³ (ISO 2533).
const SEA_LEVEL: f64 = 1.225;
/// Standard gravity, m/s² (ISO 80000-3).
const GRAVITY: f64 = 9.80665;

/// Size of an aircraft relative to 25 kg and 5 m span: the ratios of mass and span, each at least 1, and the factor for `CL0`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Size {
    mass: f64,
    length: f64,
    lift: f64,
}

impl Size {
    /// Size of an aircraft with `body` and `geometry`.
    pub fn new(body: &RigidBody, geometry: &Geometry) -> Size {
        let [mass, span] = WRITTEN_FOR;
        let length = (geometry.span / span).max(1.0);
        Size { mass: (body.mass / mass).max(1.0), length, lift: 1.0 }
    }

    /// Sets the factor for the bounds of `CL0`: 1.5 times the lift coefficient of level flight at sea level at the smallest
    /// `airspeed` (m/s), and at least 1.
    pub fn lifted_at(self, airspeed: f64, body: &RigidBody, geometry: &Geometry) -> Size {
        let pressure = 0.5 * SEA_LEVEL * airspeed * airspeed;
        let level = body.mass * GRAVITY / (pressure * geometry.area);
        Size { lift: (PULL * level).max(1.0), ..self }
    }

    /// Physical bounds of `coefficient`. Bounds in units of force, length, moment, angular momentum or inertia grow with the
    /// aircraft. The bounds of `CL0` grow with the lift coefficient of slow flight. Other bounds, and those of a coefficient
    /// without `grows` (the default in effect files), are unchanged.
    pub fn bounds(&self, coefficient: &Coefficient) -> (f64, f64) {
        if !coefficient.grows {
            return coefficient.bounds;
        }
        let of_unit = || self.factor(coefficient.unit).unwrap_or(1.0);
        let factor = if coefficient.name == LIFT { self.lift } else { of_unit() };
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

    /// Whether bounds in `unit` grow with the aircraft.
    pub fn scales(unit: &str) -> bool {
        Size { mass: 1.0, length: 1.0, lift: 1.0 }.factor(unit).is_some()
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
        // ten times the mass, twice the span
        let large = Size::new(&body(250.0), &geometry(10.0));
        assert_eq!(large.bounds(&torque), (-1000.0, 1000.0));
        assert_eq!(large.bounds(&coefficient("k", "", "", (-1.0, 1.0))), (-1.0, 1.0));
        // a wing loading of 100 N/m² at 6 m/s gives CL = 4.5 in level flight, so a CL0 of 2 must be allowed
        let slow = Geometry { area: 0.1, span: 1.0, chord: 0.1 };
        let lift = coefficient("CL0", "", "", (-1.0, 1.0));
        let at = |airspeed| Size::new(&body(1.0), &slow).lifted_at(airspeed, &body(1.0), &slow);
        assert!(at(6.0).bounds(&lift).1 > 2.0, "{:?}", at(6.0));
        assert_eq!(at(30.0).bounds(&lift), (-1.0, 1.0));
        let written = Coefficient { grows: false, ..torque };
        assert_eq!(large.bounds(&written), (-50.0, 50.0));
    }
}
