//! Envelope limits in SI units, for planners and for the envelope limiter.

use greylag_physics::Airframe;
use greylag_physics::airframe::{Envelope, Incidence};

/// Allowed transient overshoot beyond the largest commanded bank, rad: 3 % of a step from −60° to 60°.
const OVERSHOOT: f64 = 0.0628;

/// Limits of the quantities that planner and limiter keep within the envelope.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Smallest and largest load factor along the body's z axis, in g, positive upward.
    pub load: [f64; 2],
    /// Smallest and largest angle of attack, rad: ±95 % of the stall angle.
    pub alpha: [f64; 2],
    /// Largest |sideslip|, rad.
    pub sideslip: f64,
    /// Largest |bank|, rad: the envelope's limit plus 0.0628 for overshoot.
    pub bank: f64,
}

impl Bounds {
    /// The bounds of the envelope in an airframe file.
    pub fn of(airframe: &Airframe) -> Bounds {
        Bounds::new(&airframe.envelope, &airframe.incidence)
    }

    /// The bounds of `envelope`, with the angles of attack from `incidence`.
    pub fn new(envelope: &Envelope, incidence: &Incidence) -> Bounds {
        let most = incidence.before_stall();
        Bounds {
            load: [envelope.load_factor_least(), envelope.load_factor_max],
            alpha: [-most, most],
            sideslip: envelope.sideslip_most_deg().to_radians(),
            bank: envelope.bank_max_deg.to_radians() + OVERSHOOT,
        }
    }

    /// The same bounds with load factor, angle of attack and sideslip multiplied by `part`. The bank is unchanged.
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
