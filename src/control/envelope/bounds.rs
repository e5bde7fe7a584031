//! The limits of the envelope that plans and commands are held to.

use greylag_physics::Airframe;
use greylag_physics::airframe::{Envelope, Incidence};

/// Bank beyond its largest command that a transient may have, rad: 3 % of a step from −60° to 60°.
const OVERSHOOT: f64 = 0.0628;

/// Limits in SI units: least and most.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Load factor along the body's z axis, in g, positive upward.
    pub load: [f64; 2],
    /// Angle of attack, rad: before the stall.
    pub alpha: [f64; 2],
    /// Sideslip to either side, rad.
    pub sideslip: f64,
    /// Bank to either side, rad.
    pub bank: f64,
}

impl Bounds {
    /// Those of an aircraft.
    pub fn of(airframe: &Airframe) -> Bounds {
        Bounds::new(&airframe.envelope, &airframe.incidence)
    }

    /// Those of an envelope with the angles of attack that belong to it.
    pub fn new(envelope: &Envelope, incidence: &Incidence) -> Bounds {
        let most = incidence.before_stall();
        Bounds {
            load: [envelope.load_factor_least(), envelope.load_factor_max],
            alpha: [-most, most],
            sideslip: envelope.sideslip_most_deg().to_radians(),
            bank: envelope.bank_max_deg.to_radians() + OVERSHOOT,
        }
    }

    /// The same with load factor, incidence and sideslip at `part` of their limits.
    pub fn within(self, part: f64) -> Bounds {
        let scaled = |[low, high]: [f64; 2]| [part * low, part * high];
        Bounds {
            load: scaled(self.load),
            alpha: scaled(self.alpha),
            sideslip: part * self.sideslip,
            ..self
        }
    }
}
