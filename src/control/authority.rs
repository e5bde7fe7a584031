//! Control authority: steady roll rate, and pitch and yaw accelerations, at full travel of the surfaces.

use serde::Serialize;

use greylag_model::modes::rates;
use greylag_model::{GreyBox, Trim};

/// Control authority about a trim, at the smaller of a surface's two travel limits. Rates and accelerations are about the body
/// axes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Authority {
    /// Steady roll rate at full positive aileron, rad/s. Positive to the right.
    pub roll_rate: f64,
    /// Initial pitch acceleration at full positive elevator, rad/s². Positive nose up.
    pub pitch_acceleration: f64,
    /// Initial yaw acceleration at full positive rudder, rad/s², positive nose right. `None` without a rudder.
    pub yaw_acceleration: Option<f64>,
}

impl Authority {
    /// The authority about `trim`, at an altitude in m.
    pub(crate) fn at(model: &GreyBox, trim: &Trim, altitude: f64) -> Authority {
        let linear = rates(model, trim, altitude);
        let figures = &model.airframe.actuators;
        let full = |place: usize, column: usize, travel: f64| linear.b[(place, column)] * travel;
        let rudder = figures.rudder.filter(|_| model.has_rudder());
        Authority {
            // the roll rate is steady when roll damping balances the aileron's moment
            roll_rate: full(3, 0, figures.aileron.travel.smallest()) / -linear.a[(3, 3)],
            pitch_acceleration: full(4, 1, figures.elevator.travel.smallest()),
            yaw_acceleration: rudder.map(|rudder| full(5, 3, rudder.travel.smallest())),
        }
    }

    /// Steady roll rate with full aileron in level flight at the cruise airspeed, rad/s. `None` if level flight at this
    /// airspeed is not possible or positive aileron does not roll to the right.
    pub(crate) fn roll_rate(model: &GreyBox) -> Option<f64> {
        let altitude = model.airframe.reference.altitude;
        let trim =
            Trim::level(model, model.airframe.envelope.airspeed_cruise_mps, altitude).ok()?;
        let rate = Authority::at(model, &trim, altitude).roll_rate;
        (rate.is_finite() && rate > 0.0).then_some(rate)
    }
}
